"""`Level`: the headings and tilts of a vehicle that stays level, and what to drive next."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import Affine
from agonic.inertial.plan import RATE_HZ, Drive
from agonic.live.track import Track
from agonic.maths.equation.coverage import make_level_axes
from agonic.maths.rotations.tilt import heading_by_vectors_deg, roll_pitch_deg, tilt_from_down

SECTORS = 12
WIDTH_DEG = 360 / SECTORS
SEEN_ROWS = 3
"""Rows in a sector that is seen."""
LEVEL_DEG = 30.0
"""Of tilt from its usual attitude: a vehicle within it but for a twentieth of its way is level."""
SMOOTH_S = 2.0
"""Over which the acceleration is averaged to tell down."""
TURN_DEG_S = 20.0
COMES_DEG = 90.0
"""By which a vehicle turns on its way to a ramp."""
WORTH_SHARE = 0.95
"""Of the heading's standard error: what lowers it by less is not worth the way."""


class Level(NamedTuple):
    """What a vehicle that stays level has shown.

    `down` (3,) is where the sensor's axes have down when it is level. By `SECTORS` of heading, from
    magnetic north eastwards: `counts` of rows, and the largest tilt `tilts_deg`. `heading_deg`,
    `pitch_deg` (nose up) and `roll_deg` (right side down) are those of the last row.
    """

    down: Array
    counts: Index
    tilts_deg: Array
    heading_deg: float
    pitch_deg: float
    roll_deg: float

    @property
    def seen(self) -> Mask:
        """The sectors that were seen, (12,)."""
        return np.asarray(self.counts >= SEEN_ROWS)

    @property
    def tilt_deg(self) -> float:
        """The largest tilt."""
        return float(self.tilts_deg.max())


class Step(NamedTuple):
    """Something to drive: in words, the attitudes on the way, how much work it is, rad of turning,
    the sectors to be passed, and the slope of the ground, degrees."""

    say: str
    drive: Drive
    work: float
    sectors: tuple[int, ...]
    slope_deg: float = 0.0


class Plan(NamedTuple):
    """The step that lowers the heading's standard error most for its work, and what it is then."""

    step: Step
    after_deg: float


def find_down(track: Track | None) -> tuple[Array, Array] | None:
    """Where the sensor's axes have down when its vehicle is level, (3,), and down in each row of
    the track, (k, 3); `None` where the sensor was turned over, or nothing tells."""
    if track is None or len(track.slots) < SECTORS:
        return None
    down = _smooth(track.down, track.sums[:, 1] / track.sums[:, 0])
    mean = down.mean(axis=0)
    mean /= np.linalg.norm(mean)
    tilted = down @ mean < np.cos(np.radians(LEVEL_DEG))
    return None if tilted.mean() > 0.05 else (mean, down)


def see_level(track: Track | None, calibration: Affine) -> Level | None:
    """The headings and tilts on a track; `None` where the sensor was turned over, or may be yet."""
    found = find_down(track)
    if found is None or track is None or track.duration_s < 8.0:  # it may be turned over
        return None
    rows = track.sums[:, 1:] / track.sums[:, :1]
    (mean, down), to_body = found, make_level_axes(found[0]).T
    down, field = down @ to_body, calibration.correct(rows[:, 1:4]) @ to_body
    heading = heading_by_vectors_deg(field, down)
    roll, pitch = roll_pitch_deg(tilt_from_down(down))
    tilt = np.degrees(np.arccos(np.clip(down[:, 2], -1.0, 1.0)))
    sector = (heading // WIDTH_DEG).astype(np.intp) % SECTORS
    counts = np.bincount(sector, minlength=SECTORS)
    tilts = [np.percentile(tilt[sector == k], 95) if n else 0.0 for k, n in enumerate(counts)]
    return Level(
        mean,
        counts.astype(np.intp),
        np.array(tilts),
        float(heading[-1]),
        float(pitch[-1]),
        float(roll[-1]),
    )


def _smooth(down: Array, time: Array) -> Array:
    """Directions (n, 3) averaged over `SMOOTH_S`."""
    step = max(float(np.median(np.diff(time))), 1e-3)
    half = int(min(SMOOTH_S / step, len(down) - 1)) // 2
    sums = np.cumsum(np.pad(down, ((half + 1, half), (0, 0)), mode="edge"), axis=0)
    mean = sums[2 * half + 1 :] - sums[: len(down)]
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def find_gap(seen: Mask) -> tuple[int, int]:
    """The first sector of the longest run that is missing, and how many it has."""
    if not seen.any():
        return 0, len(seen)
    at = np.flatnonzero(seen)
    gaps = np.diff(np.append(at, at[0] + len(seen))) - 1
    widest = int(np.argmax(gaps))
    return int(at[widest] + 1) % len(seen), int(gaps[widest])


def choose_step(level: Level, now_deg: float, predict: Callable[[Drive], float]) -> Plan | None:
    """The step that lowers the heading's standard error most for its work; missing headings
    first."""
    plans = [Plan(step, predict(step.drive)) for step in list_steps(level)]
    if plans and len(plans[0].step.sectors) < SECTORS:  # of missing headings
        return plans[0]
    worth = [plan for plan in plans if plan.after_deg < WORTH_SHARE * now_deg]
    if not worth:
        return None
    return max(worth, key=lambda plan: np.log(now_deg / plan.after_deg) / plan.step.work)


def list_steps(level: Level) -> list[Step]:
    """What could be driven: the missing headings alone, or a circle, a slope, a ramp."""
    first, missing = find_gap(level.seen)
    if missing > 2 or (missing and missing == int((~level.seen).sum())):
        return [_turn_through(first, missing)]
    return list(_list_others(level))


def _turn_through(first: int, count: int) -> Step:
    begin, span = first * WIDTH_DEG, count * WIDTH_DEG
    heading = begin + _ramp(span)
    level = np.zeros_like(heading)
    sectors = tuple((first + k) % SECTORS for k in range(count))
    say = f"turn slowly through headings {begin:.0f}° to {(begin + span) % 360:.0f}°"
    if count == SECTORS:
        say = "turn slowly through a full circle"
    return Step(say, Drive(heading, level, level), float(np.radians(span)), sectors)


def _list_others(level: Level) -> Iterator[Step]:
    everywhere = tuple(range(SECTORS))
    heading = level.heading_deg + _ramp(360.0)
    flat = np.zeros_like(heading)
    yield Step("turn a full circle more", Drive(heading, flat, flat), 2 * np.pi, everywhere)
    slope = next((s for s in (5.0, 10.0, 20.0) if s > 1.2 * level.tilt_deg), None)
    if slope is None:
        return
    along = np.radians(heading)
    pitch, roll = slope * np.cos(along), slope * np.sin(along)
    say = f"turn a full circle on ground that slopes by {slope:.0f}°"
    yield Step(say, Drive(heading, pitch, roll), 2 * np.pi + 2, everywhere, slope)
    way = level.heading_deg + _ramp(COMES_DEG) - COMES_DEG  # the gyro sees it turn, then lean
    stand = np.ones(round(6.0 * RATE_HZ))
    heading = np.concatenate([way, level.heading_deg * stand, level.heading_deg * stand])
    pitch = np.concatenate([0.0 * way, slope * stand, 0.0 * stand])
    roll = np.concatenate([0.0 * way, 0.0 * stand, slope * stand])
    say = f"drive onto a ramp of {slope:.0f}°: nose up, then left side up"
    yield Step(say, Drive(heading, pitch, roll), 4.0, everywhere, slope)


def _ramp(span_deg: float) -> Array:
    """Headings along a turn, from 0."""
    return np.linspace(0.0, span_deg, round(span_deg / TURN_DEG_S * RATE_HZ))
