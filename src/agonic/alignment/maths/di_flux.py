"""A theodolite with a fluxgate on its telescope: what it reads at any setting of its two circles.

At the horizontal reading h and the zenith reading v the telescope points along t, with A = h − h₀
the azimuth from the magnetic meridian at h₀; q is square to it along the trunnion axis and p where
v goes on to:

    t = (sin v cos A, sin v sin A, −cos v)   q = (−sin A, cos A, 0)
    p = (cos v cos A, cos v sin A, sin v)

The fluxgate lies along t + δ q + ε p with small collimation errors δ and ε, and has an offset S₀;
in the field F (cos I, 0, sin I) it reads

    S = F [cos I (sin v cos A − δ sin A + ε cos v cos A) + sin I (ε sin v − cos v)] + S₀.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.maths.columns import average, find_rows
from agonic.arrays import Array, Mask
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.student import compute_widening

NAMES = ("meridian", "inclination", "delta", "epsilon", "offset", "scale")
"""Unknowns: h₀, I, δ, ε in radians, S₀/F, and F in the unit of the readings."""
LEAST_RAD = np.radians(1.0 / 3600.0)
"""What a circle is read to: few residuals may be smaller by chance."""


class Settings(NamedTuple):
    """Readings of both circles, (n,) radians, and of the fluxgate, (n,). Where `from_meridian` is
    set the horizontal reading counts from the magnetic meridian itself."""

    horizontal: Array
    zenith: Array
    reading: Array
    from_meridian: Mask


class SheetEstimate(NamedTuple):
    """The unknowns (6,) with covariance, residuals (n,) in the unit of the readings, freedom."""

    params: Array
    covariance: Array
    residuals: Array
    freedom: int
    noise: float


def predict(params: Array, at: Settings) -> tuple[Array, Array]:
    """What the fluxgate reads, (n,), and the Jacobian (n, 6)."""
    meridian, inclination, delta, epsilon, offset, scale = params
    azimuth = at.horizontal - np.where(at.from_meridian, 0.0, meridian)
    ca, sa = np.cos(azimuth), np.sin(azimuth)
    cv, sv = np.cos(at.zenith), np.sin(at.zenith)
    ci, si = np.cos(inclination), np.sin(inclination)
    level, upright = sv * ca - delta * sa + epsilon * cv * ca, epsilon * sv - cv
    sighted = ci * level + si * upright + offset
    by_azimuth = ci * (-sv * sa - delta * ca - epsilon * cv * sa)
    jacobian = scale * np.stack(
        [
            np.where(at.from_meridian, 0.0, -by_azimuth),
            ci * upright - si * level,
            -ci * sa,
            ci * cv * ca + si * sv,
            np.ones_like(sa),
            sighted / scale,
        ],
        axis=1,
    )
    return scale * sighted, jacobian


def estimate(
    at: Settings, start: Array, groups: NDArray[np.int64], *, scale_known: bool
) -> SheetEstimate:
    """The unknowns of settings that repeat in `groups`, by least squares. Readings of one setting
    share what the circle was set wrong by, so the noise follows from the means of the groups: their
    misfit over the settings less the unknowns, 1″ at least. The covariance is widened by Student's
    t: the usual eight settings leave three for the noise."""
    free = np.ones(len(NAMES), dtype=bool)
    free[-1] = not scale_known
    unit = start[-1]

    def pieces(step: Array) -> list[tuple[Array, Array]]:
        params = start.copy()
        params[free] += step
        values, jacobian = predict(params, mean)
        return [((values - mean.reading) / unit, jacobian[:, free] / unit)]

    # circles and fluxgate move by so little within a setting that means are exact
    rows = find_rows(groups, np.unique(groups))
    horizontal, zenith, reading = (average(column, rows) for column in at[:3])
    mean = Settings(horizontal, zenith, reading, at.from_meridian[[own[0] for own in rows]])
    solution = leastsq.solve(pieces, np.zeros(int(free.sum())), scale=LEAST_RAD, tolerance=1e-8)
    params = start.copy()
    params[free] += solution.params
    left = solution.residuals
    freedom = len(left) - int(free.sum())
    noise = float(np.sqrt(left @ left / freedom)) if freedom > 0 else float("nan")
    covariance = np.zeros((len(NAMES), len(NAMES)))
    wide = (max(noise / LEAST_RAD, 1.0) * compute_widening(freedom)) ** 2
    covariance[np.ix_(free, free)] = wide * leastsq.inverse(solution.information)
    return SheetEstimate(params, covariance, left * unit, freedom, noise * unit)
