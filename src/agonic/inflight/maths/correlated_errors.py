"""Correlated errors: what they add to the scatter of a fit, from its own residuals.

A residual is white noise and slowly moving errors e(t) seen along a direction that turns
(Gauss–Markov processes, one for each correlation time τ):

    r_i = ε_i + Σ_g e_g(t_i)·d_gi,   E[e_g(t) e_g(t + Δ)ᵀ] = 1 Σ_τ a_gτ exp(−Δ/τ)

A field from outside the Earth stands in Earth-fixed axes and d is the direction of the field there;
a bias that drifts stands in the axes of the sensor; anything else is a number and d = 1. The a ≥ 0
are those that give the products of residuals at all lags best. The gradient Σ w r J/σ² of the fit
then scatters by that of white noise and

    Σ_g Σ_τ a_gτ/σ⁴ Σ_ij exp(−|t_i − t_j|/τ) (w_i J_i)(w_j J_j)ᵀ (d_i·d_j),

whatever turns with the readings averaged as it does in the fit itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index

STRETCHES = 20_000
"""Stretches of time that a record is summed up in; within one nothing turns much."""
_GROUPS = 40


class Sums(NamedTuple):
    """Sums over each of k stretches: w, w², w r, w J (k, m), and w d of each geometry."""

    weight: Array
    square: Array
    residual: Array
    jacobian: Array
    directions: tuple[Array, ...]

    @classmethod
    def empty(cls, stretches: int, parameters: int, widths: Sequence[int]) -> Sums:
        """Nothing summed up yet."""
        return cls(
            np.zeros(stretches),
            np.zeros(stretches),
            np.zeros(stretches),
            np.zeros((stretches, parameters)),
            tuple(np.zeros((stretches, width)) for width in widths),
        )

    def add(
        self,
        stretch: Index,
        weights: Array,
        residuals: Array,
        jacobian: Array,
        directions: Sequence[Array],
        onto: Array | None = None,
    ) -> None:
        """Add readings; `stretch` (n,) in order of time says where each belongs; `onto` makes the
        columns of `jacobian` those of the parameters."""
        starts = np.flatnonzero(np.diff(stretch, prepend=-1))
        here = stretch[starts]
        for into, values in (
            (self.weight, weights),
            (self.square, weights**2),
            (self.residual, weights * residuals),
            *(
                (into, weights[:, None] * d)
                for into, d in zip(self.directions, directions, strict=True)
            ),
        ):
            into[here] += np.add.reduceat(values, starts, axis=0)
        columns = np.add.reduceat(weights[:, None] * jacobian, starts, axis=0)
        self.jacobian[here] += columns if onto is None else columns @ onto


class CorrelatedError(NamedTuple):
    """One correlated error: its variance, correlation time in s, and the number of its geometry."""

    variance: float
    time_s: float
    geometry: int


def join_errors(errors: Sequence[CorrelatedError]) -> tuple[float, float]:
    """The variance of all together, and their mean correlation time, s; 0 and 0 of none."""
    variance = sum(error.variance for error in errors)
    time = sum(error.variance * error.time_s for error in errors)
    return float(variance), float(time / variance) if variance else 0.0


def find_correlated_errors(
    sums: Sums, white: float, step_s: float, absorbed: Sequence[int] = ()
) -> tuple[CorrelatedError, ...]:
    """The correlated errors that the products of residuals show; none where chance would do.

    Parameters: `white`, variance of one residual; `step_s`, seconds of a stretch; `absorbed`,
    geometries whose mean over the record the fit has taken up, so that residuals lack it.
    """
    from scipy.optimize import nnls  # slow to load

    k = len(sums.weight)
    longest = max(k // 3, 1)
    if k < 3 * _GROUPS:
        return ()
    lags = np.arange(1, longest)
    edges = np.unique(np.geomspace(1, longest, _GROUPS).astype(int))
    starts = edges[:-1] - 1
    taus = np.geomspace(1.0, longest, max(int(np.log2(longest)), 2))

    def group(products: Array) -> Array:
        return np.asarray(np.add.reduceat(products, starts))

    seen = group(_products(sums.residual, longest)[1:])
    sd = white * np.sqrt(np.maximum(group(_products(sums.square, longest)[1:]), 1e-300))
    shapes = [
        sum(_products(column, longest)[1:] for column in directions.T)
        for directions in sums.directions
    ]
    columns = [
        (
            CorrelatedError(1.0, float(tau) * step_s, g),
            group(
                shape * (np.exp(-lags / tau) - (_mean_variance(tau / k) if g in absorbed else 0.0))
            ),
        )
        for g, shape in enumerate(shapes)
        for tau in taus
    ]
    design = np.stack([column for _, column in columns], axis=1) / sd[:, None]
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    amplitude, left = nnls(design / size, seen / sd)
    # χ² by which correlated errors must explain the products better than none
    if float((seen / sd) @ (seen / sd)) - left**2 < 16.0:
        return ()
    return tuple(
        of._replace(variance=float(a / s))
        for (of, _), a, s in zip(columns, amplitude, size, strict=True)
        if a > 0
    )


def compute_scatter(sums: Sums, errors: Sequence[CorrelatedError], step_s: float) -> Array:
    """What they add to the scatter of Σ w r J, (m, m)."""
    once = np.zeros((sums.jacobian.shape[1],) * 2)
    weight = np.maximum(sums.weight, 1e-300)
    places = np.arange(1024, len(weight), 1024)  # results are the same with any
    pieces = np.split(sums.jacobian, places)
    columns = [np.flatnonzero(piece.any(axis=0)) for piece in pieces]  # far splines are zero
    pieces = [piece[:, own] for piece, own in zip(pieces, columns, strict=True)]
    for geometry, directions in enumerate(sums.directions):
        own = [error for error in errors if error.geometry == geometry]
        kept = np.exp(-step_s / np.array([error.time_s for error in own]))
        variance = np.array([error.variance for error in own])
        for axis in directions.T if own else ():
            along = np.split((axis / weight)[:, None], places)
            scores = [piece * own for piece, own in zip(pieces, along, strict=True)]
            _follow(scores, columns, variance, kept, once)
    return once + once.T


def _follow(
    scores: Sequence[Array],
    columns: Sequence[Index],
    variance: Array,
    kept: Array,
    once: Array,
    length: int = 64,
) -> None:
    """Add Σ_{i ≥ j} Σ_q v_q κ_q^(i−j) s_i s_jᵀ to `once` (m, m), i = j by half.

    Within blocks of rows of a `length` by the matrix of all products; from block to block by what
    each error has kept, c = κ^L c + Σ_j κ^(L−1−j) s_j. The scores s come in pieces (l, c), each
    some of the `columns`.
    """
    lags = np.arange(length)
    power = kept[:, None] ** lags
    apart = np.subtract.outer(lags, lags)
    within = np.where(apart >= 0, (variance @ power)[np.abs(apart)], 0.0)
    within[lags, lags] /= 2.0
    carried, fade = np.zeros((len(kept), len(once))), (kept**length)[:, None]
    for piece, own in zip(scores, columns, strict=True):
        blocks = np.zeros((-(-len(piece) // length), length, len(own)))
        blocks.reshape(-1, len(own))[: len(piece)] = piece
        told, ahead = power[:, ::-1] @ blocks, (variance * kept)[:, None] * power @ blocks
        before = np.zeros_like(told)
        for j in range(1, len(told)):
            before[j] = fade * before[j - 1] + told[j - 1]
        here = np.tensordot(blocks, within @ blocks, ((0, 1), (0, 1)))
        once[np.ix_(own, own)] += here + np.tensordot(ahead, before, ((0, 1), (0, 1)))
        decay = fade ** np.arange(len(told))
        once[own] += np.einsum("qj,jqa->aq", decay, ahead) @ carried
        carried *= fade ** len(told)
        carried[:, own] += fade * before[-1] + told[-1]


def _mean_variance(share: float) -> float:
    """Of the mean of e(t) over a record, τ being a share of it, over the variance of e."""
    return float(2 * share * (1 + share * np.expm1(-1 / share)))


def _products(values: Array, lags: int) -> Array:
    """Σ_i v_i v_{i+l} for lags 0 … `lags` − 1."""
    size = 1 << (len(values) + lags).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(spectrum * spectrum.conj(), size)[:lags])
