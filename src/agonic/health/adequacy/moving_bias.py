"""A bias that comes and goes along one direction, and two populations of readings."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.health.adequacy.fitted import FEWEST_ROWS, ModelError, Work, make_error
from agonic.maths.estimation.score_test import Linearised, score_test

SIGNIFICANT = 1e-3 / 3


def find_moving_bias(work: Work) -> list[ModelError]:
    """A disturbance along one direction that comes and goes, by the covariance of residuals.

    A bias that varies with covariance M makes E[r_i r_j] = n_iᵀ M n_j for rows close in time;
    noise with memory alone makes it n_i·n_j. Two populations in random rows are not close in
    time: there the residuals' distribution about ± along the direction tells.
    """
    fit, normals = work.linear, work.normals
    close = np.diff(work.rows) == 1
    first = np.flatnonzero(close & (fit.weights[1:] > 0) & (fit.weights[:-1] > 0))
    pairs = (normals[first], normals[first + 1], fit.residuals[first] * fit.residuals[first + 1])
    found = _anisotropy(*pairs, fit.batch[first])
    name = "comes and goes"
    if found is None:
        kept = np.flatnonzero(fit.weights > 0)
        same = (normals[kept], normals[kept], fit.residuals[kept] ** 2)
        found = _anisotropy(*same, fit.batch[kept])
        name = "two populations"
        if found is None or not _two_levels(normals[kept], fit.residuals[kept], found[1]):
            return []
    p_value, spread = found
    growth = np.zeros((len(work.scale), len(work.scale)))
    growth[:3, :3] = spread * work.fitted.noise**2
    return [make_error(work, name, p_value, float(np.sqrt(np.trace(growth[:3, :3]))), growth)]


def _anisotropy(a: Array, b: Array, product: Array, batch: Index) -> tuple[float, Array] | None:
    """Covariance M (3, 3) of a bias that varies by direction, from products of residuals."""
    if len(product) < FEWEST_ROWS:
        return None
    isotropic = np.sum(a * b, axis=1)
    entries = [(0, 0), (1, 1), (0, 1), (0, 2), (1, 2)]
    columns = np.stack(
        [
            a[:, i] * b[:, j] / 2 + a[:, j] * b[:, i] / 2 - (isotropic / 3 if i == j else 0.0)
            for i, j in entries
        ],
        axis=1,
    )
    centred = product - isotropic * (product @ isotropic) / (isotropic @ isotropic)
    _, number = np.unique(batch, return_inverse=True)
    fit = Linearised(centred, isotropic[:, None], np.ones(len(product)), np.zeros((1, 1)), number)
    score = score_test(fit, columns)
    if score is None or score.p_value > SIGNIFICANT:
        return None
    xx, yy, xy, xz, yz = score.size
    traceless = np.array([[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, 0.0]])
    values, vectors = np.linalg.eigh(traceless)
    along = np.maximum(values - values[1], 0.0)  # beyond what all directions share
    if along[2] < (values[1] - values[0]):
        return None  # flat, not along a direction: noise that differs by axis
    return score.p_value, np.asarray((vectors * along) @ vectors.T)


def _two_levels(normals: Array, residuals: Array, spread: Array) -> bool:
    """Whether residuals sit at two levels along a direction rather than spread about one (BIC)."""
    values, vectors = np.linalg.eigh(spread)
    along, size = normals @ vectors[:, 2], float(np.sqrt(values[2]))
    sd = float(np.sqrt(max(np.mean(residuals**2 - (along * size) ** 2), 0.05)))
    low, high, share = -size, size, 0.5
    for _ in range(60):
        z = (residuals[:, None] - along[:, None] * [low, high]) / sd
        weight = np.exp(-0.5 * z**2) * [1 - share, share]
        total = weight.sum(axis=1)
        second = weight[:, 1] / np.maximum(total, 1e-300)
        share = float(np.clip(second.mean(), 0.02, 0.98))
        low = float(((1 - second) * along) @ residuals / (((1 - second) * along) @ along))
        high = float((second * along) @ residuals / ((second * along) @ along))
        left = (1 - second) * (residuals - along * low) ** 2 + second * (
            residuals - along * high
        ) ** 2
        sd = float(np.sqrt(max(left.mean(), 1e-6)))
    z = (residuals[:, None] - along[:, None] * [low, high]) / sd
    mixed = np.log(np.maximum(np.exp(-0.5 * z**2) @ [1 - share, share], 1e-300)) - np.log(sd)
    variance = np.mean(residuals**2 - (along * size) ** 2) + (along * size) ** 2
    variance = np.maximum(variance, 1e-6)
    alone = -0.5 * residuals**2 / variance - 0.5 * np.log(variance)
    return bool(mixed.sum() - alone.sum() > 2 * np.log(len(residuals)) + 8)
