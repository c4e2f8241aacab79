"""Which readings are no measurement of the field, and how unlikely all are about a minimum."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.crowding import weigh_crowded
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise
from agonic.maths.one_pass import median

_LOG_ROOT_2_PI = 0.5 * np.log(2 * np.pi)
_CROWD = 0.2  # of the readings
_STRANGE = 0.35  # of the field: lengths of Gaussian vectors scatter by 0.42 of their mean (Maxwell)
_ALONE = 0.5  # leverage by which a reading decides more than all others together


def find_bad_readings(residuals: dict[str, Array], noise: dict[str, Noise]) -> Mask:
    """Which readings (n,) are no measurement of the field at all: they count in no channel.

    An outlier by its magnitude may have the right dip by chance, and pull there. One by its dip
    alone is a wrong attitude, or a reading with the right magnitude by chance; the latter are few
    beside those that their magnitude gives away.
    """
    out = {c: weigh({c: residuals[c]}, noise) == 0.0 for c in residuals}
    bad = out["magnitude"]
    if "dip" in out and np.count_nonzero(out["dip"] & ~bad) <= np.count_nonzero(bad):
        bad = bad | out["dip"]
    return np.asarray(bad)


def find_corroborated(
    problem: Problem, solution: leastsq.Solution, weights: Array, sd: float
) -> Mask:
    """Which readings other readings speak for, (n,), where only the magnitude is known.

    An outlier can fall near the ellipsoid by chance, in a direction that was never visited;
    nothing there contradicts it, and it or a handful of them decide the result. So where some
    readings are outliers (weight zero), none counts in a cell of directions where outliers are
    the majority. Readings of unusual leverage J C Jᵀ/σ² are a cell of their own, for just off the
    visited directions outliers hide among honest readings; and none counts that decides alone.
    `sd` is that of a reading as it was weighed, times the root of the correlation length.
    """
    outlier = weights == 0.0
    if not outlier.any() or outlier.all():
        return np.ones(len(weights), dtype=bool)
    bias, matrix = split(problem.basis @ solution.params)
    cells = find_cells((problem.points - bias) @ matrix.T)
    leverage = np.concatenate(
        [
            np.einsum("ij,jk,ik->i", jacobian, solution.covariance / sd**2, jacobian)
            for _, jacobian in pieces(problem, "magnitude")(solution.params)
        ]
    )
    unusual = 25 * median(leverage[~outlier])
    if outlier.mean() < _CROWD:  # more are no outliers but another population
        cells[leverage > unusual] = 80
    readings, outliers = np.bincount(cells, minlength=81), np.bincount(cells[outlier], minlength=81)
    alone = min(max(1 / 3, unusual), _ALONE)
    return np.asarray((2 * outliers < readings)[cells] & (leverage < alone))


def weigh(residuals: dict[str, Array], noise: dict[str, Noise]) -> Array:
    """What the robust losses leave of each reading, the least of its channels."""
    weights = [noise[c].loss.weight((r / noise[c].sd) ** 2) for c, r in residuals.items()]
    return np.asarray(np.minimum.reduce(weights))


def compute_surprise(
    problem: Problem, params: Array, noise: dict[str, Noise], residuals: dict[str, Array]
) -> float:
    """How unlikely the readings are about a minimum: Σ mean min(log σ + z²/2 + log √2π, 0) over the
    channels, z the residual over its noise σ; a reading that does not fit is one that may lie
    anywhere within the field.

    A minimum that holds for fewer of the readings has to hold for them by so much better. Where the
    magnitude is alone the mean is over directions rather than readings.
    """
    n = len(problem.points)
    weights = np.full(n, 1.0 / n)
    if problem.magnitude_only:
        bias, matrix = split(problem.basis @ params)
        weights = weigh_crowded(find_cells((problem.points - bias) @ matrix.T))
        weights = weights / weights.sum()
    surprise = 0.0
    for channel, of in noise.items():
        sd = max(of.sd, np.finfo(float).tiny)
        fits = np.log(sd) + (residuals[channel] / sd) ** 2 / 2 + _LOG_ROOT_2_PI
        surprise += float(weights @ np.minimum(fits, 0.0))
    return surprise


def is_no_field(problem: Problem, params: Array, noise: dict[str, Noise]) -> bool:
    """Whether readings about a minimum are none of the field: the magnitude scatters as about the
    middle of readings at rest, whose noise is an ellipsoid of its own, or the dip as that of an
    attitude that is another's."""
    _, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    gain = abs(float(np.trace(matrix))) / 3
    sd = max(of.sd for channel, of in noise.items() if channel != "azimuth")
    return sd * gain > _STRANGE * float(np.mean(problem.magnitude))
