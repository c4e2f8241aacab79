"""Drift, random walk and scatter from one measurement to the next, by restricted likelihood.

Values y of a number at times t, each with its formal standard error s, are

    y = X β + w(t) + e,   X = (1, t, steps …),   E[w(t) w(t')] = q² min(t, t'),   var e = s² + σ²

with a straight line, a random walk of size q and a scatter σ beyond the formal errors. Nobody knows
q and σ: they are averaged over, on a grid of both, with the restricted likelihood (Patterson &
Thompson 1971) that each node leaves. Of white scatter alone that gives Student's t: few values say
little, as they should. Before anything is seen every power of ten of σ over the formal error, and
of the walk across the span over the white part, is as likely as any other, from a tenth upwards.

The walk is a filter of one state, so that a long series costs as its length. Leading axes are
series of the same length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from agonic.arrays import Array

GRID_NODES = 11
"""Nodes along each of the two sizes."""
_ZOOMS = 2
_ROWS_TOGETHER = 16  # whose white rows are kept together, for few large products
_MIN_LOG_RATIO, _MAX_LOG_RATIO = np.log(0.1), np.log(1e3)
"""Of σ over the errors, and over the values' spread; of the walk across the span over the white."""


class Series(NamedTuple):
    """Times (…, n) from 0 on in units of the span, values (…, n), formal variances (…, n), and the
    design (…, p, n), its first two rows 1 and t.
    """

    time: Array
    value: Array
    variance: Array
    design: Array


class Posterior(NamedTuple):
    """Nodes of (σ, q), their weights (…, m), and β (…, m, p) with its covariance (…, m, p, p)."""

    scatter: Array
    walk: Array
    weight: Array
    beta: Array
    covariance: Array

    def mean(self, k: int) -> Array:
        """The expected β_k (…,)."""
        return np.asarray(np.sum(self.weight * self.beta[..., k], axis=-1))

    def sd(self, k: int) -> Array:
        """Its standard deviation (…,), with what is not known of the sizes."""
        return mix_normals(self.weight, self.beta[..., k], self.covariance[..., k, k])[1]

    def p_value(self, k: int) -> Array:
        """Twice the probability (…,) that β_k has the other sign."""
        over = self.beta[..., k] / np.sqrt(self.covariance[..., k, k])
        sides = [np.sum(self.weight * ndtr(side), axis=-1) for side in (over, -over)]
        return np.asarray(2 * np.minimum(*sides))

    def size(self, of: str) -> Array:
        """The expected root mean square (…,) of the scatter or of the walk across the span."""
        return np.asarray(np.sqrt(np.sum(self.weight * getattr(self, of) ** 2, axis=-1)))


def mix_normals(weight: Array, mean: Array, variance: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (…,) of a mixture of normals (…, m)."""
    centre = np.sum(weight * mean, axis=-1)
    apart = np.sum(weight * (variance + (mean - centre[..., None]) ** 2), axis=-1)
    return centre, np.sqrt(apart)


def compute_posterior(of: Series) -> Posterior:
    """What a series says of β and of the sizes."""
    low, high = _whole(of)
    for zoom in range(_ZOOMS + 1):
        nodes = _grid(low, high)
        scatter, walk = _sizes(of, nodes)
        log, beta, covariance = _fits(compute_products(of, scatter, walk))
        log = log - log.max(axis=-1, keepdims=True)
        if zoom < _ZOOMS:
            low, high = _box(nodes, log, low, high)
    weight = np.exp(log)
    weight /= weight.sum(axis=-1, keepdims=True)
    return Posterior(scatter, walk, weight, beta, covariance)


def typical_error(of: Series) -> Array:
    """The usual formal error (…,); where there is none, a small part of the spread."""
    usual = np.sqrt(np.median(of.variance, axis=-1))
    return np.asarray(np.maximum(usual, 1e-4 * _spread(of)))


def _spread(of: Series) -> Array:
    return np.asarray(np.maximum(np.std(of.value, axis=-1), 1e-300))


def _whole(of: Series) -> tuple[Array, Array]:
    """The corners (…, 2) of all that is looked at: ln σ, and ln of the walk over the white part."""
    errors = typical_error(of)
    most = _MAX_LOG_RATIO + np.log(np.maximum(_spread(of), errors))
    return (
        np.stack([_MIN_LOG_RATIO + np.log(errors), np.full_like(errors, _MIN_LOG_RATIO)], axis=-1),
        np.stack([most, np.full_like(errors, _MAX_LOG_RATIO)], axis=-1),
    )


def _grid(low: Array, high: Array) -> Array:
    """Nodes (…, m, 2) between corners (…, 2)."""
    share = np.linspace(0.0, 1.0, GRID_NODES)
    unit = np.stack([np.repeat(share, GRID_NODES), np.tile(share, GRID_NODES)], axis=-1)
    return np.asarray(low[..., None, :] + unit * (high - low)[..., None, :])


def _sizes(of: Series, nodes: Array) -> tuple[Array, Array]:
    """σ, and q across the span, each (…, m)."""
    scatter = np.exp(nodes[..., 0])
    return scatter, np.exp(nodes[..., 1]) * np.hypot(scatter, typical_error(of)[..., None])


def _box(nodes: Array, log: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """The corners around the nodes that count, a step of the grid wider."""
    counts = (log > -15.0)[..., None]  # of the logarithm of the likelihood, below the best
    step = (high - low) / (GRID_NODES - 1)
    least = np.where(counts, nodes, np.inf).min(axis=-2) - step
    most = np.where(counts, nodes, -np.inf).max(axis=-2) + step
    return np.maximum(least, low), np.minimum(most, high)


class Products(NamedTuple):
    """Products of whitened rows: `logs` Σ ln F (…, m), `base` (…, m, 1+p, 1+p) of value and design;
    of candidates `cross` (…, m, c, 1+p) with these and `own` (…, m, c) with themselves.
    """

    logs: Array
    base: Array
    cross: Array
    own: Array


def compute_products(
    of: Series, scatter: Array, walk: Array, candidates: Array | None = None
) -> Products:
    """Products under each node (…, m) of the value, the design, and candidates (c, n)."""
    n, many = of.time.shape[-1], 1 + of.design.shape[-2]
    columns = np.concatenate([of.value[..., None, :], of.design], axis=-2)
    if candidates is not None:
        shape = (*columns.shape[:-2], *candidates.shape[-2:])
        columns = np.concatenate([columns, np.broadcast_to(candidates, shape)], axis=-2)
    mean = np.zeros((*scatter.shape, columns.shape[-2]))
    variance = np.zeros_like(scatter)
    logs = np.zeros_like(scatter)
    base = np.zeros((*scatter.shape, many, many))
    cross = np.zeros((*scatter.shape, columns.shape[-2] - many, many))
    own = np.zeros(cross.shape[:-1])
    steps = np.diff(of.time, prepend=of.time[..., :1], axis=-1)
    white = np.empty((*scatter.shape, min(n, _ROWS_TOGETHER), columns.shape[-2]))
    for k in range(n):
        variance = variance + walk**2 * steps[..., k, None]
        total = variance + of.variance[..., k, None] + scatter**2
        gain = variance / total
        ahead = columns[..., None, :, k] - mean
        mean = mean + gain[..., None] * ahead
        variance = variance * (1 - gain)
        logs += np.log(total)
        np.divide(ahead, np.sqrt(total)[..., None], out=white[..., k % _ROWS_TOGETHER, :])
        if k % _ROWS_TOGETHER == _ROWS_TOGETHER - 1 or k == n - 1:
            rows = white[..., : k % _ROWS_TOGETHER + 1, :]
            known, others = rows[..., :many], rows[..., many:]
            base += np.swapaxes(known, -1, -2) @ known
            if candidates is not None:
                own += np.einsum("...kc,...kc->...c", others, others)
                cross += np.swapaxes(others, -1, -2) @ known
    return Products(logs, base, cross, own)


def _fits(seen: Products) -> tuple[Array, Array, Array]:
    """The restricted log likelihood (…, m), β (…, m, p) and its covariance (…, m, p, p)."""
    design, towards = seen.base[..., 1:, 1:], seen.base[..., 1:, 0]
    covariance, logs = _inverse(design)
    beta = np.einsum("...ij,...j->...i", covariance, towards)
    left = seen.base[..., 0, 0] - np.sum(beta * towards, axis=-1)
    return -0.5 * (seen.logs + logs + np.maximum(left, 0.0)), beta, covariance


def _inverse(design: Array) -> tuple[Array, Array]:
    """The inverse of normal equations (…, p, p), and the logarithm of their determinant."""
    scale = np.sqrt(np.maximum(np.einsum("...ii->...i", design), 1e-300))
    scaled = design / (scale[..., :, None] * scale[..., None, :])
    scaled = scaled + 1e-12 * np.eye(design.shape[-1])
    logs = np.linalg.slogdet(scaled)[1] + 2 * np.log(scale).sum(axis=-1)
    return np.linalg.inv(scaled) / (scale[..., :, None] * scale[..., None, :]), logs


def compute_tail_probabilities(of: Series, candidates: Array) -> Array:
    """How often chance makes a candidate's coefficient as large (…, c), on a grid of all sizes."""
    nodes = _grid(*_whole(of))
    scatter, walk = _sizes(of, nodes)
    seen = compute_products(of, scatter, walk, candidates)
    log, beta, covariance = _fits(seen)
    towards = seen.cross[..., 1:] @ covariance
    own = seen.own - np.sum(towards * seen.cross[..., 1:], axis=-1)
    free = own > 1e-9 * seen.own
    own = np.where(free, own, 1.0)
    gap = seen.cross[..., 0] - np.einsum("...cp,...p->...c", seen.cross[..., 1:], beta)
    each = log[..., None] + 0.5 * (gap**2 / own - np.log(own))
    weight = np.exp(each - each.max(axis=-2, keepdims=True))
    weight /= weight.sum(axis=-2, keepdims=True)
    tail = np.sum(weight * 2 * ndtr(-np.abs(gap) / np.sqrt(own)), axis=-2)
    return np.where(free.all(axis=-2), tail, 1.0)


def predict(of: Series, posterior: Posterior, at: Array, design: Array) -> tuple[Array, Array]:
    """Mean and variance (m, k) of X β + w at times `at` (k,), by node, for one series."""
    rows = np.concatenate([of.value[None], of.design]).T
    shared, apart = np.minimum.outer(of.time, of.time), np.minimum.outer(at, of.time)
    mean, variance = np.empty((2, len(posterior.walk), len(at)))
    for node, (walk, scatter) in enumerate(zip(posterior.walk, posterior.scatter, strict=True)):
        across = walk**2 * apart
        whole = walk**2 * shared + np.diag(of.variance + scatter**2)
        solved = np.linalg.solve(whole, np.column_stack([rows, across.T]))
        left, reduced = across @ solved[:, : rows.shape[1]], across @ solved[:, rows.shape[1] :]
        lean = design.T - left[:, 1:]
        mean[node] = left[:, 0] + lean @ posterior.beta[node]
        spread = walk**2 * at - np.diag(reduced)
        variance[node] = spread + np.einsum("kp,pq,kq->k", lean, posterior.covariance[node], lean)
    return mean, np.maximum(variance, 0.0)
