"""What a model lacks in a known field: would hysteresis or a network foretell unseen readings?

Columns are added to the Jacobian at the estimate, so that every alternative costs one linear step
for each block that is left out, and no fit. Hysteresis is the play operator (backlash) of the
temperature, or of the field's components: it follows its input at a distance, and its distance
tells from which side the input came. The network has one hidden layer of fixed random weights
(Huang, Zhu & Siew 2006), of which only the output is fitted.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from agonic.arrays import Array, Mask
from agonic.thermal.maths.known_field import BLOCKS, KnownFieldProblem, make_pieces

WIDTHS = (0.05, 0.15, 0.4)
"""Distances of the play operator that are tried, of half the range of its input."""
UNITS = 64
TEMPERATURE, FIELD = "thermal hysteresis", "magnetic hysteresis"
NETWORK = "a network"
MOST = 100_000
"""Readings above which nothing is compared."""
_FEWEST = 8.0
"""Residuals for every number that is fitted."""
_RIDGES = (1e-5, 1e-3)
"""What is added to the information of each feature, as a share of it: against overfitting."""
_LEAST = 1e-12


class Alternative(NamedTuple):
    """What would be added, and its rms on unseen blocks over that of the fit without it."""

    name: str
    ratio: float


def compare_alternatives(
    problem: KnownFieldProblem, params: Array, weights: Array, x: Array, prior: Array
) -> list[Alternative]:
    """Hysteresis and a network, each with how it foretells the blocks that it has not seen.

    Parameters: the problem in the order in which the readings were taken, its solution (a,), the
    weight (n,) of each reading, the temperatures (n,) as −1…1, and the information (a, a) of the
    prior in units of the residuals. Empty where the readings are too few, or too many.
    """
    n, kept = len(problem.points), weights > 0
    sizes = [3, 9, 3 * UNITS]
    if n > MOST or 3 * n < _FEWEST * (len(params) + max(sizes)):
        return []
    r, jacobian = (np.concatenate(part) for part in zip(*make_pieces(problem)(params), strict=True))
    rows = r.reshape(n, 3), jacobian.reshape(n, 3, -1)
    plain = _measure(*rows, np.zeros((n, 0)), weights, kept, prior)
    candidates = {
        TEMPERATURE: [_play(x[:, None], width) for width in WIDTHS],
        FIELD: [_play(problem.field, width) for width in WIDTHS],
        NETWORK: [_respond(problem.field, x)],
    }
    return [
        Alternative(
            name, min(_measure(*rows, features, weights, kept, prior) for features in tried) / plain
        )
        for name, tried in candidates.items()
    ]


def _play(values: Array, width: float) -> Array:
    """How far the play operator of each column stands from it, −1…1.

    >>> _play(np.array([[-1.0], [0.0], [1.0], [0.9], [0.0]]), 0.5).ravel().tolist()
    [0.0, -1.0, -1.0, -0.8, 1.0]
    """
    reach = width * np.maximum(np.ptp(values, axis=0) / 2, 1e-300)
    made = np.empty_like(values)
    for column in range(values.shape[1]):
        w, at = float(reach[column]), float(values[0, column])
        followed = []
        for value in values[:, column].tolist():
            at = min(max(at, value - w), value + w)
            followed.append(at - value)
        made[:, column] = np.array(followed) / w
    return made


def _respond(field: Array, x: Array) -> Array:
    """What hidden units with random weights make of field and temperature, (n, UNITS)."""
    drawn = np.random.default_rng(20).standard_normal((5, UNITS))
    return np.asarray(np.tanh(np.column_stack([field, x, np.ones(len(x))]) @ drawn))


class _Sums(NamedTuple):
    """Of some readings: information (a, a) of the fit, (3, a, k) shared with features on each axis,
    (k, k) of the features, and the gradients (a,) and (3, k)."""

    fit: Array
    shared: Array
    features: Array
    by_fit: Array
    by_features: Array

    def less(self, other: _Sums) -> _Sums:
        """Without those of other readings."""
        return _Sums(*(one - two for one, two in zip(self, other, strict=True)))


def _measure(
    r: Array, jacobian: Array, features: Array, weights: Array, kept: Mask, prior: Array
) -> float:
    """The rms of residuals (n, 3) by fits without the block in which a reading lies.

    The features (n, k) are added on each axis.
    """
    edges = np.linspace(0, len(r), BLOCKS + 1).astype(int).tolist()
    blocks = [slice(a, b) for a, b in pairwise(edges)]
    sums = [_sum_up(r[b], jacobian[b], features[b], weights[b]) for b in blocks]
    whole = _Sums(*(np.sum(parts, axis=0) for parts in zip(*sums, strict=True)))
    whole = whole._replace(fit=whole.fit + prior)
    ridges = _RIDGES if features.shape[1] else (0.0,)
    total = np.zeros(len(ridges))
    for b, own in zip(blocks, sums, strict=True):
        for k, ridge in enumerate(ridges):
            step, more = _solve(whole.less(own), ridge)
            unseen = r[b] + jacobian[b] @ step + features[b] @ more.T
            total[k] += float(np.sum(unseen[kept[b]] ** 2))
    return float(np.sqrt(total.min() / max(3 * int(kept.sum()), 1)))


def _sum_up(r: Array, jacobian: Array, features: Array, weights: Array) -> _Sums:
    weighted = jacobian * weights[:, None, None]
    flat = jacobian.reshape(-1, jacobian.shape[2])
    light = features * weights[:, None]
    return _Sums(
        weighted.reshape(flat.shape).T @ flat,
        np.stack([weighted[:, axis].T @ features for axis in range(3)]),
        light.T @ features,
        r.ravel() @ weighted.reshape(flat.shape),
        r.T @ light,
    )


def _solve(sums: _Sums, ridge: float) -> tuple[Array, Array]:
    """The least-squares step (a,) of the fit, and (3, k) of the features on each axis."""
    a, k = len(sums.by_fit), len(sums.features)
    information = np.zeros((a + 3 * k, a + 3 * k))
    information[:a, :a] = sums.fit
    for axis in range(3):
        own = slice(a + axis * k, a + (axis + 1) * k)
        information[:a, own] = sums.shared[axis]
        information[own, :a] = sums.shared[axis].T
        information[own, own] = sums.features + ridge * np.diag(np.diag(sums.features))
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(size, size)
    scaled[np.diag_indices_from(scaled)] += _LEAST
    gradient = np.concatenate([sums.by_fit, sums.by_features.ravel()])
    step = -solve(scaled, gradient / size, assume_a="pos", check_finite=False) / size
    return step[:a], step[a:].reshape(3, k)
