"""What to tell the person who holds the sensor: how good it is, what is wrong, where to turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.coverage import OPEN_DEG, Coverage
from agonic.health import Finding, figure
from agonic.live.aided import Aided
from agonic.live.level import Level, Plan, find_down, list_steps
from agonic.live.maths import next_turn
from agonic.live.quarantine import WAIT_S
from agonic.live.state import Found, LiveParams, LiveState
from agonic.maths.equation import coverage as cells

BEGIN = "turn slowly through a full circle, and tilt it where it can be tilted"


@dataclass(frozen=True, kw_only=True, eq=False)
class Guidance:
    """What to do next, in words and as directions in the axes of the sensor.

    `present` (3,) is where the calibrated field points now, `wanted` (3,) where it should, `turn`
    (3,) the rotation vector of the sensor between them, rad, and `say` the same in words; `None`
    and a sentence where there is no fit yet. `done` when the target is reached and nothing is
    wrong; `findings` what is. Of a vehicle that stays level `level` are the headings and tilts so
    far, and `plan` is what to drive next, which `say` tells, with the heading error afterwards.
    """

    say: str
    done: bool = False
    present: Array | None = None
    wanted: Array | None = None
    turn: Array | None = None
    findings: tuple[Finding, ...] = field(default_factory=tuple)
    level: Level | None = None
    plan: Plan | None = None


_PLACE_MISSING = Finding(
    "place",
    "check",
    "the vehicle stays level and the field of the place is not known, so accelerometer and gyro "
    "are used only in the accepted result",
    "give the place (--at LAT,LON)",
)


def make_guidance(
    params: LiveParams,
    state: LiveState,
    fitted: tuple[Affine, Coverage] | None,
    examine: Callable[[], tuple[Finding, ...]] = tuple,
    level: Level | None = None,
    aided: Aided | None = None,
) -> Guidance:
    """The guidance at a state, and the calibration and coverage there. `examine` looks at the
    readings as `agonic calibrate` will; it is asked once all else is well. `level` are headings and
    tilts of a vehicle that stays level, `None` before there is a fit."""
    findings = [*_find_stuck(state), *_find_missing(state)]
    stays_level = find_down(state.track) is not None
    if fitted is None or state.found is None:
        say = BEGIN if stays_level else "turn the sensor slowly about all three axes"
        return Guidance(say=say, findings=tuple(findings))
    calibration, coverage = fitted
    findings += [
        *_find_near_metal(state, calibration, coverage),
        *(list(find_held_out(state)) or _find_scatter(calibration)),
        *_find_off_model(params, calibration),
    ]
    if stays_level:
        assert state.track is not None
        if params.field_n is None and state.track.duration_s > 20.0:  # of a way
            findings.append(_PLACE_MISSING)
        if aided is not None and aided.chosen:
            findings += aided.objections
    close = coverage.heading_sd_deg <= params.target_deg
    if close and not findings:
        findings += examine()
    done = close and not findings
    if stays_level:
        return _guide_vehicle(done, level, aided and aided.plan, tuple(findings))
    present = state.recent[-5:, 1:].mean(axis=0)
    present = calibration.correct(present[None])[0]
    wanted = _choose_direction(params, state.found, present / np.linalg.norm(present))
    turn = next_turn.find_turn(present, wanted)
    say = "enough: accept the result" if done else next_turn.describe_turn(turn)
    if not done and np.abs(np.degrees(turn)).max() < next_turn.SMALLEST_DEG:
        say = "go on turning"  # a hand that is told to hold still would not move again
    return Guidance(
        say=say,
        done=done,
        present=present / np.linalg.norm(present),
        wanted=wanted,
        turn=turn,
        findings=tuple(findings),
    )


def _guide_vehicle(
    done: bool, level: Level | None, plan: Plan | None, findings: tuple[Finding, ...]
) -> Guidance:
    """The guidance of a vehicle that stays level: headings and tilts to add."""
    if done:
        say = "enough: accept the result"
    elif level is None:
        say = BEGIN
    elif plan is None:
        say = "go on driving circles" if level.seen.all() else list_steps(level)[0].say
    else:
        say = f"{plan.step.say}: heading error then ±{figure(plan.after_deg)}°"
    return Guidance(say=say, done=done, findings=findings, level=level, plan=plan)


def _choose_direction(params: LiveParams, found: Found, present: Array) -> Array:
    """The direction that tells the fit most for the turn it takes, with what is read on the way."""
    centres = cells.icosphere()[0]
    along, length = next_turn.draw_great_circles(present, centres)
    gains = next_turn.compute_gains(
        along,
        found.bias,
        found.matrix,
        found.covariance,
        found.noise,
        params.inclination_deg,
        50.0 * length / along.shape[1],  # a hand that turns takes 50 readings a radian
    )
    return np.asarray(centres[np.argmax(gains / (0.3 + length))])  # 0.3 rad are hardly any work


def _find_stuck(state: LiveState) -> Iterator[Finding]:
    still = state.repeats >= 50
    if not still.any():
        return
    if still.all():
        what = f"the last {int(state.repeats.min())} readings are all the same"
        yield Finding("stale", "check", what, "look at the sensor and its cable")
        return
    axes = " and ".join("xyz"[i] for i in np.flatnonzero(still))
    what = f"axis {axes} is frozen while the others move"
    yield Finding("frozen axis", "check", what, "look at the sensor")


def _find_missing(state: LiveState) -> Iterator[Finding]:
    total = state.n + state.rejected
    if state.rejected < 0.01 * max(total, 1):
        return
    what = f"{state.rejected} of {total} readings are not numbers, or are impossible for a sensor"
    yield Finding("NaN", "check", what, "look at the sensor and its cable")


def _find_near_metal(
    state: LiveState, calibration: Affine, coverage: Coverage
) -> Iterator[Finding]:
    """The present readings are off the sphere, all to one side, and the fit knows it there."""
    assert calibration.magnitude is not None
    if abs(float(state.recent[-1, 0]) - state.alarm) < WAIT_S:
        off = state.off
    else:
        field = calibration.correct(state.recent[:, 1:])
        sizes = np.linalg.norm(field, axis=1)
        off = float(np.median(sizes)) / calibration.magnitude - 1
        spread = (calibration.noise or 0.0) / calibration.magnitude
        here = cells.find_cells(np.median(field, axis=0)[None])[0]
        unsure = float(coverage.field_sd[here]) / calibration.magnitude
        if abs(off) < max(0.05, 4 * spread, 4 * unsure):  # of the field
            return
    word = "stronger" if off > 0 else "weaker"
    yield Finding(
        "near metal",
        "check",
        f"the field here is {figure(100 * abs(off))} % {word} than elsewhere: iron, a magnet "
        "or a current is near",
        "move away from it and go on turning; if it stays, start again",
    )


def find_held_out(state: LiveState) -> Iterator[Finding]:
    """Much was kept out, and what is near may as well be what was taken for the rest."""
    share = state.held / max(state.n, 1)
    if share < 0.3:  # of the readings
        return
    what = f"{100 * share:.0f} % of the readings do not fit the others: the field was not the same"
    turns = "move away from steel, magnets and currents and start again"
    yield Finding("disturbed", "check", what, turns)


def _find_scatter(calibration: Affine) -> Iterator[Finding]:
    """No sphere fits: the field was not the same all the time."""
    assert calibration.magnitude is not None
    share = (calibration.noise or 0.0) * float(np.trace(calibration.matrix)) / 3
    share /= calibration.magnitude
    if share < 0.02:  # of the field, by single readings
        return
    yield Finding(
        "disturbed",
        "check",
        f"readings scatter by {100 * share:.1f} % of the field about the best sphere: the "
        "field was not the same all the time",
        "move away from steel, magnets and currents and start again",
    )


def _find_off_model(params: LiveParams, calibration: Affine) -> Iterator[Finding]:
    """A mean gain that no sensor has: the whole place is disturbed, or the reference is wrong."""
    if params.magnitude is None or params.unit == "raw":
        return
    gain = float(np.trace(calibration.matrix)) / 3
    off = 1 / gain - 1
    assert calibration.covariance is not None
    sd = np.sqrt(calibration.covariance[3:6, 3:6].sum()) / 3 / gain
    if abs(off) < max(0.15, 4 * sd * (1 + off)):  # of the world model's magnitude
        return
    word = "above" if off > 0 else "below"
    yield Finding(
        "off the model",
        "check",
        f"the field measured is {figure(100 * abs(off))} % {word} the "
        f"{params.source.removeprefix('the ')}",
        "check the place and the unit, or move away from iron",
    )


def tell_error(sd_deg: float | None) -> str:
    """The standard error of the heading; where that says nothing, a word."""
    if sd_deg is None:
        return ""
    return f"  heading ±{sd_deg:.2f}°" if sd_deg < OPEN_DEG else "  heading undetermined"
