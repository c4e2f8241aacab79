"""The headings of all rows by compass and gyro together.

The gyro carries the heading from row to row where the tilt is known; the compass says by how much
it is off (`maths.offset`). The gyro's bias and scale are found; errors of calibration and tilt last
and are counted, a lean of the tilt's sensor by what the dip shows of it (`maths.lean`). A field
whose magnitude or dip is off is as likely to be off across, so such readings count the less.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from agonic.arrays import Array, Mask
from agonic.headings.attitude import Attitude
from agonic.headings.compass_heading import Indication, pick_used
from agonic.headings.expected_field import Surroundings
from agonic.headings.maths.gyro_heading import GyroHeading, level_axes
from agonic.headings.maths.offset import (
    BIAS_SD,
    GYRO,
    LIKELY,
    TOLD_LOG_SD,
    Observed,
    Sizes,
    assemble,
    find_sizes,
    find_variances,
    predict,
    solve,
)
from agonic.headings.maths.rest import NO_REST, Rest, find_rest, find_still
from agonic.headings.rows import CompassRows, RowHeadings
from agonic.headings.smoothing.errors import (
    find_lean_errors,
    follow_axes,
    list_shared_errors,
    measure_disturbance,
)
from agonic.headings.smoothing.moments import FEWEST, Moments, carry, put_together
from agonic.maths.one_pass import interpolate

GAIN_SD = np.repeat([0.01, 0.004], 3)
"""Of a common gyro: the scale of each axis, and what goes into another."""
STUDENT = 4.0
"""Degrees of freedom of the compass's noise: a reading far off counts less."""
LEAST_BIAS_SD = float(np.radians(0.02))
"""rad/s."""
TELLING = 3000
"""Moments by which the sizes are found."""
SHOWN = 0.1
"""Mean square of the part of down along an axis that shows the gyro's bias about it."""
FOLLOWED_S = 10.0
"""Over which the compass is averaged where the estimate starts."""
SOUND_S = 5.0
"""A row is relied on where most of those within this time are as they should be."""


class SmoothedHeading(NamedTuple):
    """Magnetic headings (n,), degrees, NaN where there is none, their variances, degrees²; the
    gyro's bias (n, 3), rad/s, and the errors of its gain (6,); and the sizes of what disturbs."""

    magnetic_deg: Array
    variance: Array
    bias: Array
    gain: Array
    sizes: Sizes


def smooth_headings(
    time: Array,
    rate: Array,
    force: Array | None,
    by_row: RowHeadings,
    around: Surroundings,
    settling_s: float,
    sizes: Sizes | None,
) -> SmoothedHeading | None:
    """The headings by compass and gyro together, or `None` where there is too little of them.

    Rates (n, 3), rad/s in body axes, and `force` tell where the log is at rest; `settling_s` is
    that of the filter that the tilt is from, 0 where it is from none; `sizes` are found if `None`.
    """
    n, attitude = len(time), by_row.tilt
    level = np.broadcast_to(level_axes(attitude.tilt, attitude.order), (n, 3, 3))
    moments = put_together(time, np.asarray(np.isfinite(level).all(axis=(1, 2))))
    if moments is None:
        return None
    known, bias_sd = _find_known_bias(attitude)
    carried = carry(time, rate - known, level, moments)
    indicated, sound = _pick_compass(by_row, time)
    parts = (indicated.horizontal, indicated.vertical)
    observed = _observe(indicated, sound, carried, moments)
    if np.isfinite(observed.variance).sum() < FEWEST:
        return None
    rows = moments.rows[moments.middle]
    heading = carried.heading[moments.middle] + observed.offset
    columns, delay = list_shared_errors(by_row, rate, rows)
    lean = follow_axes(_turn(level[rows], heading), moments, settling_s)
    by_lean, by_tilt = find_lean_errors(
        columns, lean, observed.variance, parts, around, attitude, moments
    )
    # what errors that last do within that is not looked at: where a vehicle rocks, errors of the
    # tilt and of the model do the same
    shared = moments.smooth(np.nan_to_num(np.hstack([columns, by_lean])), 5.0)
    axes = find_shown_axes(level[moments.rows, 2])
    observed = observed._replace(
        by_bias=observed.by_bias @ axes @ axes.T,
        by_shared=np.concatenate([shared, delay], axis=1),
        field_size=np.sqrt(measure_disturbance(*parts, sound, around, moments)),
        bias_sd=bias_sd,
        # of the calibration only beside a tilt of our own, whose lasting errors are listed: those
        # of a recorded tilt last as the filter that made it pleases, and would be taken for them
        found=shared.shape[1] - 3 if attitude.source == "gyro" else GYRO,
        rest=_find_rest(time, rate - known, force, (heading, observed.variance), moments),
    )
    found = _estimate(observed, sizes, by_tilt)
    whole = np.full((2, n), np.nan)
    whole[0, moments.rows] = carried.heading + moments.interpolate(time, found.magnetic_deg)
    whole[1, moments.rows] = moments.interpolate(time, found.variance)
    return SmoothedHeading(
        np.degrees(whole[0]) % 360.0,
        np.degrees(np.degrees(whole[1])),
        interpolate(time, moments.time, found.bias + known),
        GAIN_SD * found.gain,
        found.sizes,
    )


def _find_known_bias(attitude: Attitude) -> tuple[Array, float]:
    """What the tilt's filter found of the gyro's bias (3,), rad/s, and how far that may be off."""
    if attitude.gyro_bias is None:
        return np.zeros(3), BIAS_SD
    # a filter takes acceleration for noise, which lasts
    return attitude.gyro_bias, min(max(2.0 * attitude.gyro_bias_sd, LEAST_BIAS_SD), BIAS_SD)


def _pick_compass(by_row: RowHeadings, time: Array) -> tuple[Indication, Mask]:
    """What the compass that each row is taken from indicates, and whether the row is sound."""
    each = [(*one.indicated, _find_sound(one, time)) for one in by_row.compasses]
    *values, sound = (pick_used(by_row.used, one) for one in zip(*each, strict=True))
    picked = Indication(*values)
    return picked, sound & np.isfinite(picked.magnetic_deg) & np.isfinite(picked.random)


def _find_rest(
    time: Array, rate: Array, force: Array | None, compass: tuple[Array, Array], moments: Moments
) -> Rest:
    """Where the log is at rest, by the compass's heading and its variance too."""
    if force is None:
        return NO_REST
    still = find_still(time, rate, force)[moments.rows].astype(np.float64)
    turning = moments.average(rate[moments.rows])
    return find_rest(moments.time, turning, moments.average(still) == 1.0, *compass)


def _find_sound(one: CompassRows, time: Array) -> Mask:
    """The rows whose field, and that of most rows about, is the expected one."""
    sound = ~one.readings.missing
    if one.distance is not None:
        sound &= one.distance <= 1.0
    width = max(round(SOUND_S / float(np.median(np.diff(time)))), 1)
    share = uniform_filter1d(sound.astype(np.float64), width, mode="nearest")
    return np.asarray(sound & (share >= 0.8))


def find_shown_axes(down: Array) -> Array:
    """The axes (3, k) that were turned to the vertical, by down in body axes (n, 3).

    A bias about another hardly turns the heading: found all the same, it follows errors of the
    tilt, which lean the vertical and disturb the compass at once.
    """
    shown, axes = np.linalg.eigh(down.T @ down / len(down))
    return np.asarray(axes[:, shown > SHOWN])


def _observe(
    indicated: Indication, sound: Mask, carried: GyroHeading, moments: Moments
) -> Observed:
    """Compass less gyro at each moment, followed through full turns; shared errors left out."""
    good = sound[moments.rows]
    magnetic = np.radians(indicated.magnetic_deg[moments.rows])
    random = np.radians(np.radians(indicated.random[moments.rows]))
    apart = np.where(good, magnetic, 0.0) - carried.heading
    told = moments.add(good.astype(np.float64))
    noise = moments.add(np.where(good, random, 0.0))
    total = moments.add(np.where(good, np.exp(1j * apart), 0.0))
    known = (told > 0) & (np.abs(total) > 0.5 * told)
    by_bias, by_gain = (moments.average(v) for v in (carried.by_bias, carried.by_gain))
    joined = moments.joined[:, None]
    return Observed(
        moments.time,
        moments.joined,
        _follow(np.where(known, total, 0.0), moments),
        np.where(known, noise / np.maximum(told, 1.0) ** 2, np.inf),
        np.ones(len(told)),
        np.where(joined, np.diff(by_bias, axis=0), 0.0),
        GAIN_SD * np.where(joined, np.diff(by_gain, axis=0), 0.0),
        np.zeros((len(told), 3)),
    )


def _follow(total: Array, moments: Moments) -> Array:
    """The angles of complex sums (N,) without full turns between neighbours."""
    found = []
    for own, time in zip(*(np.split(v, moments.cuts) for v in (total, moments.time)), strict=True):
        step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        width = min(max(round(FOLLOWED_S / step), 1), len(time))
        steady = uniform_filter1d(own.real, width) + 1j * uniform_filter1d(own.imag, width)
        there = np.abs(steady) > 1e-6
        if not there.any():
            found.append(np.angle(own))
            continue
        at = np.flatnonzero(there)
        slow = np.interp(np.arange(len(own)), at, np.unwrap(np.angle(steady[at])))
        found.append(slow + np.angle(own * np.exp(-1j * slow)))
    return np.concatenate(found)


def _estimate(seen: Observed, sizes: Sizes | None, by_tilt: float) -> SmoothedHeading:
    """Offsets, rad, their variances (N,), bias (N, 3), gain (6,) in units of its sd, and sizes."""
    weights, found_sizes = np.ones(len(seen.time)), sizes or LIKELY
    # the stretch of `TELLING` moments in which the compass tells most
    told = np.isfinite(seen.variance)
    count = np.concatenate([[0], np.cumsum(told)])
    low = int(np.argmax(count[TELLING:] - count[:-TELLING])) if len(told) > TELLING else 0
    high = min(low + TELLING, len(told))
    for turn in range(5):
        # find the sizes anew
        if sizes is None and turn in (1, 3):
            chosen = seen.subset(low, high)
            found_sizes = find_sizes(chosen, weights[low:high], found_sizes, by_tilt)
        system = assemble(seen, found_sizes, weights)
        found = solve(system)
        expected = predict(seen, found_sizes, found)
        left = (seen.offset - expected + np.pi) % (2 * np.pi) - np.pi
        noise = np.where(told, seen.variance, 1.0) + found_sizes.noise**2
        weights = (STUDENT + 1.0) / (STUDENT + left**2 / noise)
        seen = seen._replace(offset=expected + left)  # without full turns
    # the variance of Student's t of as many degrees as there are squares that tell the sizes: those
    # of a Gauss–Markov process are independent after its time constant; what the tilt's errors told
    # counts for as many as it has weight
    field, lasts_s = found_sizes.field, found_sizes.field_s
    # heading and drift of the gyro, which the disturbances that are seen are about
    squares = max((seen.time[high - 1] - seen.time[low]) / lasts_s - 2.0, 0.0)
    # independent squares by which a variance is found, at least: with two it would have no mean
    squares = max(squares + (by_tilt > LIKELY.field) * 0.5 / TOLD_LOG_SD**2, 2.5)
    doubt = squares / (squares - 2.0)
    # of what disturbs for so long half the variance is taken to last for the whole log: few such
    # stretches do not tell that their mean is zero
    lasting = lasts_s / (lasts_s + 30.0)
    return SmoothedHeading(
        found.states[:, 0],
        find_variances(system, found, doubt) + doubt * lasting * field**2,
        found.states[:, 2:],
        found_sizes.gain * found.shared[:GYRO],
        found_sizes,
    )


def _turn(level: Array, heading: Array) -> Array:
    """Rz(heading) L: turns (N, 3, 3) from body to magnetic north, east and down."""
    c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
    north, east, down = np.moveaxis(level, 1, 0)
    return np.stack([c * north - s * east, s * north + c * east, down], axis=1)
