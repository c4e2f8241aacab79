"""A network of one hidden layer, its Jacobian, and the sums of normal equations.

    y = V [tanh(U [x, 1]), 1]

with U (h, i+1) and V (o, h+1): each row holds the weights of a node and, last, its constant. The
vector of all weights is U row by row, then V row by row. Inputs and targets are scaled to −1…1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array

_ROWS = 4096  # a block whose temporaries stay in the cache


class Shape(NamedTuple):
    """How many inputs, hidden nodes and outputs."""

    inputs: int
    hidden: int
    outputs: int

    @property
    def size(self) -> int:
        """How many weights, constants included.

        >>> Shape(3, 3, 3).size
        24
        """
        return self.hidden * (self.inputs + 1) + self.outputs * (self.hidden + 1)


class Sums(NamedTuple):
    """What a pass over the rows adds up: Σ w e², Jᵀ w e (m,), Jᵀ w J (m, m), Σ w."""

    square: float
    gradient: Array
    information: Array
    weight: float


def split(weights: Array, shape: Shape) -> tuple[Array, Array]:
    """U (h, i+1) and V (o, h+1) of the vector of all weights."""
    cut = shape.hidden * (shape.inputs + 1)
    return weights[:cut].reshape(shape.hidden, -1), weights[cut:].reshape(shape.outputs, -1)


def join(hidden: Array, output: Array) -> Array:
    """The vector of all weights of U and V.

    >>> u, v = split(np.arange(7.0), Shape(1, 2, 1))
    >>> join(u, v).tolist() == list(range(7))
    True
    """
    return np.concatenate([hidden.ravel(), output.ravel()])


def shape_of(hidden: Array, output: Array) -> Shape:
    """The shape that two matrices of weights have."""
    return Shape(hidden.shape[1] - 1, hidden.shape[0], output.shape[0])


def forward(hidden: Array, output: Array, x: Array) -> Array:
    """The outputs (…, o) of inputs (…, i)."""
    return np.asarray(activity(hidden, x) @ output[:, :-1].T + output[:, -1])


def activity(hidden: Array, x: Array) -> Array:
    """What the hidden nodes give, tanh(U [x, 1]), (…, h)."""
    return np.tanh(x @ hidden[:, :-1].T + hidden[:, -1])


def jacobian(hidden: Array, output: Array, x: Array) -> Array:
    """∂y/∂weights (n, o, m) of inputs (n, i).

    ∂y_k/∂U_jl = V_kj (1 − a_j²) [x, 1]_l,   ∂y_k/∂V_kj = [a, 1]_j
    """
    n, shape = len(x), shape_of(hidden, output)
    cut = shape.hidden * (shape.inputs + 1)
    z = _columns(hidden, x).T
    steep, active = z[:, :cut], z[:, cut:]
    rows = np.zeros((n, shape.outputs, shape.size))
    inner = np.repeat(output[:, :-1], shape.inputs + 1, axis=1)
    rows[:, :, :cut] = steep[:, None, :] * inner
    width = shape.hidden + 1
    for k in range(shape.outputs):
        rows[:, k, cut + k * width : cut + (k + 1) * width] = active
    return rows


def sum_normal_equations(
    hidden: Array, output: Array, x: Array, target: Array, weight: Array | None = None
) -> Sums:
    """Square error, gradient and JᵀJ of e = y − target, without ever forming J.

    With Z = [(1 − a_j²) [x, 1]_l, [a, 1]_j] (n, q), one product ZᵀZ holds all of it:

        JᵀJ(U, U) = (VᵀV)_jj' ∘ ZᵀZ,   JᵀJ(U, V_k) = V_kj ∘ ZᵀZ,   JᵀJ(V_k, V_k) = ZᵀZ

    which is o times less work than the rows of J. `weight` (n,) counts rows for less.
    """
    shape = shape_of(hidden, output)
    cut = shape.hidden * (shape.inputs + 1)
    q = cut + shape.hidden + 1
    gram, square, total = np.zeros((q, q)), 0.0, 0.0
    inner, outer = np.zeros(hidden.shape), np.zeros(output.shape)
    for start in range(0, len(x), _ROWS):
        rows = slice(start, start + _ROWS)
        z = _columns(hidden, x[rows])
        error = output @ z[cut:] - target[rows].T
        weighted = error if weight is None else error * weight[rows]
        square += float(np.vdot(weighted, error))
        total += float(error.shape[1] if weight is None else weight[rows].sum())
        gram += z @ (z if weight is None else z * weight[rows]).T
        back = output[:, :-1].T @ weighted
        by = z[:cut].reshape(*hidden.shape, -1)
        inner += np.matmul(by, back[:, :, None])[:, :, 0]
        outer += weighted @ z[cut:].T
    return Sums(square, join(inner, outer), _information(gram, output[:, :-1], shape), total)


def square_error(
    hidden: Array, output: Array, x: Array, target: Array, weight: Array | None = None
) -> float:
    """Σ w e² alone, for a step that may be rejected."""
    error = forward(hidden, output, x) - target
    return float((error**2 if weight is None else error**2 * weight[:, None]).sum())


def _columns(hidden: Array, x: Array) -> Array:
    """Z as (q, n): (1 − a_j²) [x, 1]_l, then [a, 1]; rows side by side, for long inner loops."""
    n, (h, each) = len(x), hidden.shape
    z = np.empty((h * each + h + 1, n))
    whole = np.ones((each, n))
    whole[:-1] = x.T
    active = np.tanh(hidden @ whole, out=z[h * each : -1])
    z[-1] = 1.0
    np.multiply((1.0 - active**2)[:, None], whole, out=z[: h * each].reshape(h, each, n))
    return z


def _information(gram: Array, outer: Array, shape: Shape) -> Array:
    """JᵀJ (m, m) from the one product, and V without its constants (o, h)."""
    each, width = shape.inputs + 1, shape.hidden + 1
    cut = shape.hidden * each
    whole = np.zeros((shape.size, shape.size))
    spread = np.repeat(outer, each, axis=1)
    whole[:cut, :cut] = gram[:cut, :cut] * (spread.T @ spread)
    for k in range(shape.outputs):
        own = slice(cut + k * width, cut + (k + 1) * width)
        whole[own, own] = gram[cut:, cut:]
        whole[:cut, own] = gram[:cut, cut:] * spread[k][:, None]
        whole[own, :cut] = whole[:cut, own].T
    return whole


def draw_weights(rng: np.random.Generator, shape: Shape, *, output_sd: float = 0.5) -> Array:
    """Weights to start from, after Nguyen and Widrow (1990): each node bends somewhere in −1…1.

    Rows of U have the length 0.7 h^(1/i) in random directions, constants spread evenly.
    """
    length = 0.7 * shape.hidden ** (1.0 / shape.inputs)
    hidden = rng.standard_normal((shape.hidden, shape.inputs + 1))
    hidden[:, :-1] *= length / np.linalg.norm(hidden[:, :-1], axis=1, keepdims=True)
    hidden[:, -1] = length * np.linspace(-1.0, 1.0, shape.hidden) if shape.hidden > 1 else 0.0
    output = output_sd * rng.uniform(-1.0, 1.0, (shape.outputs, shape.hidden + 1))
    return join(hidden, output)
