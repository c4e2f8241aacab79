"""Priors of an affine calibration: soft iron, the turn in a free matrix, sources on board."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import ELLIPSE, FREE, SYMMETRIC, model_basis
from agonic.maths.equation.gauge import mean_gain
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.estimation import leastsq

TERM_SD = 0.5  # prior: one standard deviation of a source moves the bias by less than the field

_DIAGONAL = np.eye(12)[[3, 7, 11]]
"""What takes the diagonal of the matrix out of the twelve local numbers."""


def _off_diagonal(sign: float) -> Array:
    """What takes (W_ij + sign W_ji)/2 as xy, xz, yz out of the twelve local numbers, (3, 12)."""
    rows = np.zeros((3, 12))
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        rows[k, 3 + 3 * i + j], rows[k, 3 + 3 * j + i] = 0.5, sign * 0.5
    return rows


@lru_cache(maxsize=32)
def make_prior(
    model: str,
    soft_iron_sd: float | None,
    *,
    gauge: str = SYMMETRIC,
    turn_sd: float | None = None,
    terms: int = 0,
    shared: int = 0,
) -> leastsq.Prior | None:
    """Gaussian priors on soft iron, on the rotation in a free matrix, on k terms of sources, and on
    errors that all rows share, which are in units of their standard deviation.

    Residuals ((W_ij + W_ji)/2g − δ_ij)/soft_iron_sd, (W_ij − W_ji)/(2 g turn_sd), g = tr W/3, and
    coefficients (3 k) over `TERM_SD`. None where there is nothing to hold. Of two axes it holds the
    bias along z, of which the readings show nothing.
    """
    if model == ELLIPSE:
        return _hold_z
    basis = model_basis(model, gauge)
    m, count = basis.shape[1], 3 * terms + shared
    other_sds = np.repeat([TERM_SD, 1.0], [3 * terms, shared])
    soft_iron = soft_iron_sd if model != "sphere" else None
    turn = turn_sd if gauge == FREE else None
    sds = np.repeat([soft_iron or np.inf, turn or np.inf], [6, 3])
    known = np.isfinite(sds)
    if not known.any() and not count:
        return None
    onto = np.concatenate([_DIAGONAL, _off_diagonal(1.0), _off_diagonal(-1.0)]) @ basis
    mean = onto[:3].mean(axis=0)
    shape, sds, wanted = onto[known], sds[known], (np.arange(9) < 3)[known]

    def prior(params: Array) -> tuple[Array, Array]:
        gain = float(mean @ params[:m])
        ratios = shape @ params[:m] / gain
        jacobian = np.zeros((len(sds) + count, m + count))
        jacobian[: len(sds), :m] = (shape - np.outer(ratios, mean)) / gain / sds[:, None]
        jacobian[len(sds) :, m:] = np.diag(1.0 / other_sds)
        return np.concatenate([(ratios - wanted) / sds, params[m:] / other_sds]), jacobian

    return prior


def _hold_z(params: Array) -> tuple[Array, Array]:
    """The bias along z, over the field."""
    return params[2:3], np.eye(1, len(params), 2)


def soft_iron_pull(matrix: Array, covariance: Array, sd: float) -> Array:
    """By how many standard errors that prior would move a fit made without it, at most, (…).

    One step √(gᵀCg) along the gradient g = Jᵀρ of the residuals ρ of the prior on soft iron.
    Parameters: matrix (…, 3, 3) symmetric, covariance (…, 9, 9).
    """
    delta = np.array([1.0, 1, 1, 0, 0, 0])
    gain = np.asarray(mean_gain(matrix))[..., None]
    ratio = pack_symmetric(matrix) / gain
    residuals = (ratio - delta) / sd
    along = (residuals * ratio).sum(axis=-1, keepdims=True)
    gradient = (residuals - along * delta / 3) / (gain * sd)
    spread = covariance[..., 3:, 3:]
    square = np.einsum("...i,...ij,...j", gradient, spread, gradient)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def compute_turn(basis: Array, solution: leastsq.Solution) -> tuple[Array, Array]:
    """The turn in a free matrix, (W − Wᵀ)/2g as xy xz yz, and its covariance (3, 3), rad.

    Parameters: basis (12, m) of the model, whose m parameters come first in the solution.
    """
    m = basis.shape[1]
    local = basis @ solution.params[:m]
    onto = _off_diagonal(-1.0) / float((_DIAGONAL @ local).mean())
    reduced = onto @ basis
    return onto @ local, reduced @ solution.covariance[:m, :m] @ reduced.T
