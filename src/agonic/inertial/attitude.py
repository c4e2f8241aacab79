"""Down and a steady level direction from accelerometer and gyro, and what their errors do to them.

The gyro's rates ω are integrated to attitudes R, from body axes to axes i that hardly turn. There
the specific force f is low-passed, ⟨⟩: what is left points up, for a vehicle does not go on
accelerating. A level direction is carried along with up and turned about it by nothing but the
gyro's errors. With errors δf and δω of the readings, φ = ∫ R δω dt:

    up_i is off by ⟨R δf⟩/g + ⟨φ × up⟩,   up in body axes by Rᵀ (⟨R δf⟩/g − (φ − ⟨φ⟩) × up),
    the azimuth of the field against the level direction by −∫ up·R δω dt.

So every error that all rows share has a known effect on each, to first order, and the fit of the
field finds its size. A steady speed v of the vehicle, in body axes, counts as one: in turns it is
felt as δf = ω × v. So does a delay τ of the field's readings: they are of attitudes ω τ ago; and
one of the accelerometer beside the gyro, which feels gravity f of then, δf = ω τ × f.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.errors import LogError
from agonic.maths.one_pass import interpolate
from agonic.maths.rotations.attitude import integrate_rates
from agonic.maths.rotations.low_pass import (
    low_pass,
    measure_force_variance,
    measure_rate_variance,
)
from agonic.maths.rotations.tilt import down_from_force
from agonic.maths.rotations.vectors import skew
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

SETTLING_S = 3.0
"""Time constant of the low-pass: what lasts longer is taken to be gravity."""
GAP_S = 0.3
"""After a longer pause in the log, of more than five rows, the attitude starts anew."""
MIN_PART_ROWS = 30
"""Rows without which a part between two pauses is left out."""
UNKNOWNS = 14
"""Errors that all rows share beside a gyro: of acceleration, rate, its scale, speed, two delays."""


class Inertial(NamedTuple):
    """The attitude that an inertial unit feels, heading left out, in the axes of the readings.
    `down` (n, 3), NaN where there is none, and `down_by` (n, 3, q) what errors add to it: of the
    accelerometer's bias (3, m/s²), and with a gyro of its bias (3, rad/s), its scale (3), a speed
    (3, m/s), and delays of the field's readings and of the acceleration (s). Then `ahead` (n, 3) is
    a level direction of steady heading, `part` (n,) numbers the parts in which it is steady, and
    `azimuth_by` (n, q) is what the errors add to the azimuth of the field. `force_sd`, m/s², and
    `rate_sd`, rad/s, are the noise of a row that goes through the low-pass and the integral: of the
    accelerometer with all that shakes it, and of the gyro."""

    down: Array
    down_by: Array
    part: Index
    ahead: Array | None = None
    azimuth_by: Array | None = None
    force_sd: float = 0.0
    rate_sd: float = 0.0

    @property
    def known(self) -> Mask:
        """The rows whose down is known."""
        return np.asarray(np.isfinite(self.down).all(axis=1))

    def subset(self, rows: Index) -> Inertial:
        """The same of some rows."""
        columns = (None if one is None else one[rows] for one in self[:5])
        return Inertial._make((*columns, *self[5:]))


def estimate_attitude(samples: Samples, settling_s: float = SETTLING_S) -> Inertial:
    """The attitude without heading by the accelerometer, and the gyro where there is one. Raises
    `LogError` without an accelerometer."""
    force, rate, time = samples.acceleration, samples.rotation_rate, samples.time
    if force is None:
        raise LogError(
            f"the samples of {samples.name} hold no acceleration, so the vertical is not known; "
            f"record it, or fit the magnitude alone with fit_ellipsoid"
        )
    n = len(force)
    if time is None or rate is None:
        down = down_from_force(force)
        across = down[:, :, None] * down[:, None, :] - np.eye(3)
        part = np.zeros(n, dtype=np.intp)
        return Inertial(down, across / STANDARD_GRAVITY_M_S2, part)
    felt = Inertial(
        down=np.full((n, 3), np.nan),
        down_by=np.zeros((n, 3, UNKNOWNS)),
        part=np.zeros(n, dtype=np.intp),
        ahead=np.zeros((n, 3)),
        azimuth_by=np.zeros((n, UNKNOWNS)),
    )
    variances = [(0.0, 0.0, 0)]
    for number, rows in enumerate(find_parts(time)):
        if len(rows) >= MIN_PART_ROWS:
            noise = _estimate_part(felt, rows, time[rows], force[rows], rate[rows], settling_s)
            variances.append((*noise, len(rows)))
            felt.part[rows] = number
    *squares, counts = np.array(variances).T
    force_sd, rate_sd = np.sqrt([s @ counts / max(counts.sum(), 1.0) for s in squares])
    return felt._replace(force_sd=float(force_sd), rate_sd=float(rate_sd))


def find_parts(time: Array) -> list[Index]:
    """The rows between pauses."""
    interval = np.diff(time)
    limit = max(GAP_S, 5 * float(np.median(interval)))
    return np.split(np.arange(len(time)), np.flatnonzero(interval > limit) + 1)


def _estimate_part(
    felt: Inertial, rows: Index, time: Array, force: Array, rate: Array, settling_s: float
) -> tuple[float, float]:
    """What readings (m, 3) without pauses tell, put into their rows."""
    rate_variance, rotation = measure_rate_variance(rate), rate
    step = float(np.median(np.diff(time)))
    even = time[0] + step * np.arange(int(np.ceil((time[-1] - time[0]) / step)) + 1)
    force, rate = interpolate(even, time, force), interpolate(even, time, rate)
    axes = integrate_rates(rate, even).as_matrix()

    def lasting(values: Array) -> Array:
        return low_pass(values, step, settling_s)

    turned_force = np.einsum("nij,nj->ni", axes, force)
    pull = lasting(turned_force)
    up = pull / np.sqrt((pull**2).sum(axis=1, keepdims=True))
    across = np.eye(3) - up[:, :, None] * up[:, None, :]
    by_force = across @ lasting(axes) / STANDARD_GRAVITY_M_S2
    turning = axes @ skew(rate)
    by_speed = across @ lasting(turning) / STANDARD_GRAVITY_M_S2
    turned = np.concatenate([axes, axes * rate[:, None, :]], axis=2)  # R δω of bias and scale
    angle = np.cumsum(turned, axis=0) * step
    shaken = np.concatenate([axes, np.cross(angle, pull[:, :, None], axis=1), turning], axis=2)
    force_variance = measure_force_variance(turned_force, shaken, step, settling_s)
    fast = angle - lasting(angle)
    by_rate = -np.cross(fast, up[:, :, None], axis=1)
    rest = np.einsum("nib,ni->nb", axes, up)
    by_late = across @ lasting(np.einsum("nij,nj->ni", turning, rest))[:, :, None]
    by_errors = np.concatenate([by_force, by_rate, by_speed, by_late], axis=2)
    moved = np.einsum("nib,niq->nbq", axes, by_errors)
    ahead = np.einsum("nib,ni->nb", axes, _carry(up, step))
    down = -interpolate(time, even, rest)
    down /= np.sqrt((down**2).sum(axis=1, keepdims=True))
    ahead = interpolate(time, even, ahead)
    ahead -= down * (ahead * down).sum(axis=1, keepdims=True)
    azimuth = -np.cumsum(np.einsum("ni,niq->nq", up, turned), axis=0) * step
    assert felt.ahead is not None
    assert felt.azimuth_by is not None
    felt.down[rows] = down
    by_unit = -interpolate(time, even, moved.reshape(len(even), -1)).reshape(len(rows), 3, -1)
    felt.down_by[rows, :, :12], felt.down_by[rows, :, 13] = by_unit[:, :, :12], by_unit[:, :, 12]
    felt.down_by[rows, :, 12] = np.cross(down, rotation)
    felt.azimuth_by[rows, 12] = (down * rotation).sum(axis=1)
    felt.ahead[rows] = ahead / np.sqrt((ahead**2).sum(axis=1, keepdims=True))
    felt.azimuth_by[rows, 3:9] = interpolate(time, even, azimuth)
    return force_variance, rate_variance


def _carry(up: Array, step: float) -> Array:
    """A direction (n, 3) square to up that is carried along with it without turning about it."""
    change: Array = np.gradient(up, step, axis=0)
    rate: Array = np.cross(up, change)
    times = np.asarray(step * np.arange(len(up)), dtype=np.float64)
    turn = integrate_rates(-rate, times).inv()
    first = np.eye(3)[np.argmin(np.abs(up[0]))]
    first = first - up[0] * (first @ up[0])
    return np.asarray(turn.apply(first / np.sqrt(first @ first)))
