"""Down from gyro and accelerometer in motion, by VQF (Laidig & Seel 2023)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import LogError, MissingExtraError
from agonic.headings.acceleration import SMOOTHED_S, Speed, compute_turn_axis, smooth
from agonic.maths.one_pass import interpolate
from agonic.maths.rotations.low_pass import filter_both_ways
from agonic.units import STANDARD_GRAVITY_M_S2

GAP_S = 1.0
"""A longer pause in the log starts the filter anew, and loses the heading."""
LONGEST_STEP_S = 0.005
"""Slower logs are interpolated to this: VQF holds a rate for the whole step up to its row."""
UNSEEN = 2.138
"""sd of ⟨a⟩ over that of ⟨a − ⟨a⟩⟩ where speeds change at random (their spectrum even), ⟨⟩ the
low-pass of the filter: root of ∫x²(1 + x⁴)⁻² dx over ∫x¹⁰(1 + x⁴)⁻⁴ dx."""


class FilteredDown(NamedTuple):
    """Down in body axes (n, 3), NaN where there is none, and the sds about level axes (n,), rad.

    `roll_sd` about the one ahead, `pitch_sd` about the one to the right. `bias` (3,) of the gyro,
    rad/s, and its sd, where a filter found it.
    """

    down: Array
    roll_sd: Array
    pitch_sd: Array
    bias: Array | None = None
    bias_sd: float = 0.0


class Stretch(NamedTuple):
    """The attitude to axes whose third is up, at even times `step` apart, and what was read; the
    gyro's bias (3,), rad/s, and its sd."""

    time: Array
    step: float
    turn: Rotation
    force: Array
    rate: Array
    bias: Array
    bias_sd: float


def filter_down(
    time: Array, specific_force: Array, rotation_rate: Array, settling_s: float, speed: Speed
) -> tuple[FilteredDown, Speed]:
    """The direction of down by the offline filter (VQF, forwards and backwards over even rows),
    with what acceleration may have done to it; and the speed, trusted or not.

    The acceleration of turning at the speed of the log is taken out, where what the filter did not
    trust agrees with it. What is left is low-passed by `settling_s` and trusted: the tilt is wrong
    by ⟨a⟩/g, of which a − ⟨a⟩ about the corner of the low-pass tells how much (`UNSEEN`).
    """
    n = len(time)
    pauses = np.flatnonzero(np.diff(time) > GAP_S) + 1
    parts = [p for p in np.split(np.arange(n), pauses) if len(p) >= 10]
    if not parts:
        raise LogError(
            "the log has pauses so often that no gyro filter can run; take tilt from the log or "
            "from the accelerometer"
        )
    force = specific_force
    ran = [_ran(time[p], force[p], rotation_rate[p], settling_s) for p in parts]
    shown, shown_sd = _regress_speed(ran, settling_s)
    # least share of what turning at a speed should leave over that has to be there: a filter that
    # was pulled off level shows less than all, a hand next to nothing
    if speed.taken and shown < 0.1 * speed.taken:
        speed = speed._replace(trusted=False)
    if not speed.taken:
        # it does not stand out: no larger than the left-over acceleration allows
        limited = Speed(shown**2, (2.0 * shown_sd) ** 2, speed.gravity, trusted=False)
        speed = min(speed, limited, key=lambda one: one.doubt)
    if speed.taken:
        force = force - speed.taken * compute_turn_axis(rotation_rate)
        ran = [_ran(time[p], force[p], rotation_rate[p], settling_s) for p in parts]
    longest = max(ran, key=lambda one: len(one.time))
    nowhere = np.full((n, 3), np.nan), np.full(n, np.nan), np.full(n, np.nan)
    found = FilteredDown(*nowhere, longest.bias, longest.bias_sd)
    for part, stretch in zip(parts, ran, strict=True):
        up = interpolate(time[part], stretch.time, stretch.turn.as_matrix()[:, 2])
        found.down[part] = -up / np.sqrt((up**2).sum(axis=1, keepdims=True))
        sds = _doubt(stretch, settling_s, speed)
        for whole, sd in zip(found[1:3], sds, strict=True):
            whole[part] = np.interp(time[part], stretch.time, sd)
    return found, speed


def _ran(time: Array, specific_force: Array, rotation_rate: Array, settling_s: float) -> Stretch:
    """The filter over one stretch without pauses."""
    try:
        from vqf import offlineVQF
    except ImportError:
        raise MissingExtraError("tilt from gyros", "gyro") from None
    period = float(np.median(np.diff(time)))
    finer = int(np.ceil(period / LONGEST_STEP_S))
    step = period / finer
    even = time[0] + step * np.arange(int(np.ceil((time[-1] - time[0]) / step)) + 1)
    force, rate = interpolate(even, time, specific_force), interpolate(even, time, rotation_rate)
    found = offlineVQF(rate, force, None, step, {"tauAcc": settling_s})
    kept = slice(None, None, finer)
    turn = Rotation.from_quat(np.roll(found["quat6D"][kept], -1, axis=1))
    bias, sd = found["bias"].mean(axis=0), float(np.median(found["biasSigma"]))
    return Stretch(even[kept], period, turn, force[kept], rate[kept], bias, sd)


def _regress_speed(ran: list[Stretch], settling_s: float) -> tuple[float, float]:
    """The speed ahead that the level acceleration shows which the filter left over, and its sd.

    A hand that turns a sensor to and fro makes |f|² grow with Ω² too, but not towards one side.
    Over some seconds gusts are gone.
    """
    left_over, ahead = [], []
    for one in ran:
        width = max(round(SMOOTHED_S / one.step), 1)
        left_over.append(smooth(one.turn.apply(one.force)[:, :2], width))
        level = smooth(one.turn.apply(compute_turn_axis(one.rate))[:, :2], width)
        ahead.append(level - filter_both_ways(level, one.step, settling_s))
    y, x = np.concatenate(left_over), np.concatenate(ahead)
    square = float((x**2).sum()) + 1e-12
    speed = float((y * x).sum()) / square
    independent = sum(len(one.time) * one.step for one in ran) / (2 * SMOOTHED_S)
    scatter = float(((y - speed * x) ** 2).mean()) * len(y) / max(independent, 1.0)
    return speed, float(np.sqrt(scatter / square))


def _doubt(stretch: Stretch, settling_s: float, speed: Speed) -> tuple[Array, Array]:
    """sds of roll and pitch, rad, by the rest of the acceleration and the doubt about the speed."""
    turn, step = stretch.turn, stretch.step
    nose = turn.as_matrix()[:, :2, 0]
    nose = nose / np.maximum(np.sqrt((nose**2).sum(axis=1, keepdims=True)), 1e-9)
    left = np.stack([-nose[:, 1], nose[:, 0]], axis=1)
    left_over = filter_both_ways(turn.apply(stretch.force)[:, :2], step, settling_s)
    width = max(round(2.0 * settling_s / step), 1)
    rest = UNSEEN**2 * smooth((left_over**2).sum(axis=1) / 2, width)
    ahead = turn.apply(compute_turn_axis(stretch.rate))[:, :2]
    unsure = speed.doubt * filter_both_ways(ahead, step, settling_s)
    across, along = ((unsure * axis).sum(axis=1) for axis in (left, nose))
    roll_sd, pitch_sd = (np.sqrt(rest + part**2) for part in (across, along))
    return roll_sd / STANDARD_GRAVITY_M_S2, pitch_sd / STANDARD_GRAVITY_M_S2
