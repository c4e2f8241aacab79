"""Structure over direction that no named cause explains, and the prior's share."""

from __future__ import annotations

import numpy as np

from agonic.health.adequacy.fitted import ModelError, Work, make_error
from agonic.maths.equation.coverage import find_cells
from agonic.maths.estimation.score_test import sums_by

SIGNIFICANT = 1e-3 / 3

PRIOR_SHARE = 0.5
"""Of what is known of the heading: more than this from the prior alone is no measurement."""


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
    total = np.bincount(cell, worth, 80)
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
    explained = sum((error.size / fitted.noise) ** 2 for error in found) / 3
    if variance < 2 * explained:
        return []
    weighted = fit.jacobian[kept] * fit.weights[kept, None]
    sums = sums_by(cells, weighted, 80)
    inverse = np.linalg.inv(fit.information)
    scatter = inverse @ (variance * sums.T @ sums) @ inverse * np.outer(work.scale, work.scale)
    scatter[:3, :3] += np.eye(3) * variance * fitted.noise**2
    size = float(np.sqrt(variance)) * fitted.noise
    return [make_error(work, "by direction", p_value, size, scatter)]


def find_prior(work: Work) -> list[ModelError]:
    """What is known of the heading by the prior's word alone: its share, and the error without it.

    With information A = JᵀWJ + P and the heading's gradient v, the prior's share of what is known
    is (A⁻¹v)ᵀP(A⁻¹v)/vᵀA⁻¹v, here over all headings together.
    """
    fit = work.linear
    whole = np.linalg.inv(fit.information)
    ours = (
        work.fitted.heading_deg(whole @ fit.prior @ whole * np.outer(work.scale, work.scale)) ** 2
    )
    if ours < PRIOR_SHARE * work.fitted.heading_deg(whole * np.outer(work.scale, work.scale)) ** 2:
        return []
    seen = fit.information - fit.prior
    values, vectors = np.linalg.eigh(seen)
    floor = np.maximum(values, 1e-12 * values[-1])
    alone = (vectors / floor) @ vectors.T * max(work.fitted.correlation, 1.0)
    growth = alone * np.outer(work.scale, work.scale) - work.fitted.calibration.covariance
    return [make_error(work, "prior", 0.0, 0.0, growth)]
