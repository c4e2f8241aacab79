"""Structure over direction that no named cause explains, and the prior's share."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.adequacy.fitted import ModelError, Work, make_error
from agonic.maths.equation.coverage import find_cells, icosphere
from agonic.maths.estimation.inference.linearised import sums_by

SIGNIFICANT = 1e-3 / 3

PRIOR_SHARE = 0.5
"""Of what is known of the heading: more than this from the prior alone is no measurement."""

BY_CHANCE = 4.0
"""What n rows hold by noise scatters by 2/√n of it: two standard errors are no knowledge."""

SMOOTHNESS = 2.0
"""Structure over direction is alike by 1/e at 60°."""


def find_structure(work: Work, found: list[ModelError]) -> list[ModelError]:
    """Structure over direction that no named cause explains: scatter of cell means.

    A visit is a stretch of consecutive rows in one cell; visits, not rows, are independent. F
    compares what cell means scatter with what visits within a cell do.
    """
    from scipy.special import fdtrc  # here, so that what only reads a log loads no SciPy

    fit, fitted = work.linear, work.fitted
    kept = np.flatnonzero(fit.weights > 0)
    field = (work.feet[kept] * work.radius - fitted.calibration.bias) @ fitted.calibration.matrix.T
    cells = find_cells(field)
    start = np.flatnonzero(np.r_[True, (np.diff(cells) != 0) | (np.diff(kept) != 1)])
    length = np.diff(np.r_[start, len(cells)])
    means = np.add.reduceat(fit.residuals[kept], start) / length
    cell = cells[start]
    worth = np.maximum(length / max(fitted.correlation, 1.0), 1.0)
    often = np.bincount(cell, minlength=80) >= 2
    inside = often[cell]
    total = sums_by(cell, worth[:, None], 80)[:, 0]
    mean = np.bincount(cell, worth * means, 80) / np.maximum(total, 1e-9)
    k, visits = int(often.sum()), int(inside.sum())
    if k < 15 or visits - k < 15:
        return []
    centre = float(total[often] @ mean[often] / total[often].sum())
    between = float(total[often] @ (mean[often] - centre) ** 2) / (k - 1)
    within = float(worth[inside] @ (means - mean[cell])[inside] ** 2) / (visits - k)
    p_value = float(fdtrc(k - 1, visits - k, between / max(within, 1e-300)))
    if p_value > SIGNIFICANT:
        return []
    variance = max(between - within, 0.0) / float(total[often].mean())
    sizes = [error.size / fitted.noise for error in found if error.probability == 1.0]
    explained = sum(size**2 for size in sizes) / 3
    if variance < 2 * explained:
        return []
    weighted = fit.jacobian[kept] * fit.weights[kept, None]
    sums = sums_by(cells, weighted, 80)[often]
    weights = sums_by(cells, fit.weights[kept, None], 80)[often, 0]
    moved = _smooth_move(sums, weights, total[often], fit.information, often)
    scatter = max(between - within, 0.0) * moved * np.outer(work.scale, work.scale)
    scatter[:3, :3] += np.eye(3) * variance * fitted.noise**2
    size = float(np.sqrt(variance)) * fitted.noise
    return [make_error(work, "by direction", p_value, size, scatter)]


def _smooth_move(
    sums: Array, weights: Array, worth: Array, information: Array, often: Mask
) -> Array:
    """Covariance (p, p) of the calibration by a smooth structure over directions that makes cell
    means scatter by one more than chance.

    What is smooth looks like a bias or a gain, and the fit has taken most of it up. With
    K = exp(−(1 − cos θ) κ) between cells, the calibration moves by A⁻¹Sᵀf, and means keep
    f − (S/W) A⁻¹Sᵀ f. Parameters: Σ w J of each cell S (k, p), Σ w, the weight of its mean.
    """
    centres = icosphere()[0][often]
    alike = np.exp((centres @ centres.T - 1.0) * SMOOTHNESS)
    moves = np.linalg.solve(information, sums.T)
    left = np.eye(len(sums)) - sums / np.maximum(weights, 1e-9)[:, None] @ moves
    left -= worth @ left / worth.sum()
    seen = float(worth @ np.einsum("ij,jk,ik->i", left, alike, left)) / (len(sums) - 1)
    return np.asarray(moves @ alike @ moves.T / max(seen, 1e-9))


def find_prior(work: Work) -> list[ModelError]:
    """What is known of the heading by the prior's word or by noise: its share, and the error
    without it.

    With information A = JᵀWJ + P and the heading's gradient v, the prior's share of what is known
    is (A⁻¹v)ᵀP(A⁻¹v)/vᵀA⁻¹v, here over all headings together. Noise blurs J, and A seems to hold
    Σ w δJᵀδJ more than there is: of readings in two planes the product of their equations could be
    added to any ellipsoid, and but for noise no row would tell.
    """
    fit = work.linear
    whole = np.linalg.inv(fit.information)
    chance = BY_CHANCE / np.sqrt(np.count_nonzero(fit.weights) / max(work.fitted.correlation, 1.0))
    by_others = fit.prior + work.by_noise * (1.0 + chance)
    scales = np.outer(work.scale, work.scale)
    ours = work.fitted.heading_deg(whole @ by_others @ whole * scales) ** 2
    if ours < PRIOR_SHARE * work.fitted.heading_deg(whole * scales) ** 2:
        return []
    values, vectors = np.linalg.eigh(fit.information - by_others)
    floor = np.maximum(values, 1e-12 * values[-1])
    alone = (vectors / floor) @ vectors.T * max(work.fitted.correlation, 1.0)
    growth = alone * scales - work.fitted.calibration.covariance
    return [make_error(work, "prior", 0.0, 0.0, growth)]
