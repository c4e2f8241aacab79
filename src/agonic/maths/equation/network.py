"""A network of one or two hidden layers, its Jacobian, and the sums of normal equations.

    y = V [tanh(U [x, 1]), 1],   or   y = V [tanh(W [tanh(U [x, 1]), 1]), 1]

with U (h, i+1), W (k, h+1) and V (o, h+1) or (o, k+1): each row holds the weights of a node and,
last, its constant. The layers of a network are these matrices in order; the vector of all weights
is the first row by row, then the next. Inputs and targets are scaled to −1…1.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array

Nodes = int | tuple[int, int]
"""Nodes of the hidden layer, or of the first and the second."""
Layers = tuple[Array, ...]
"""U and V, or U, W and V."""

_ROWS = 4096  # a block whose temporaries stay in the cache
_FEWER_ROWS = 1024  # the same with the rows of J


class Shape(NamedTuple):
    """How many inputs, hidden nodes and outputs."""

    inputs: int
    hidden: Nodes
    outputs: int

    @property
    def widths(self) -> tuple[int, ...]:
        """Inputs, nodes of each hidden layer, outputs."""
        hidden = (self.hidden,) if isinstance(self.hidden, int) else self.hidden
        return (self.inputs, *hidden, self.outputs)

    @property
    def nodes(self) -> int:
        """How many hidden nodes in all."""
        return sum(self.widths[1:-1])

    @property
    def said(self) -> str:
        """The nodes in words."""
        return f"{' and '.join(str(width) for width in self.widths[1:-1])} nodes"

    @property
    def size(self) -> int:
        """How many weights, constants included."""
        return sum((before + 1) * after for before, after in pairwise(self.widths))


class Sums(NamedTuple):
    """What a pass over the rows adds up: Σ w e², Jᵀ w e (m,), Jᵀ w J (m, m), Σ w."""

    square: float
    gradient: Array
    information: Array
    weight: float


def split(weights: Array, shape: Shape) -> Layers:
    """The layers of the vector of all weights."""
    layers, at = [], 0
    for before, after in pairwise(shape.widths):
        layers.append(weights[at : at + (before + 1) * after].reshape(after, -1))
        at += (before + 1) * after
    return tuple(layers)


def join(*layers: Array) -> Array:
    """The vector of all weights of layers."""
    return np.concatenate([layer.ravel() for layer in layers])


def shape_of(layers: Layers) -> Shape:
    """The shape that matrices of weights have."""
    hidden = [len(layer) for layer in layers[:-1]]
    nodes = hidden[0] if len(hidden) == 1 else (hidden[0], hidden[1])
    return Shape(layers[0].shape[1] - 1, nodes, len(layers[-1]))


def forward(layers: Layers, x: Array) -> Array:
    """The outputs (…, o) of inputs (…, i)."""
    return np.asarray(activity(layers, x) @ layers[-1][:, :-1].T + layers[-1][:, -1])


def activity(layers: Layers, x: Array) -> Array:
    """What the nodes of the last hidden layer give, (…, h)."""
    for layer in layers[:-1]:
        x = np.tanh(x @ layer[:, :-1].T + layer[:, -1])
    return x


def jacobian(layers: Layers, x: Array) -> Array:
    """∂y/∂weights (n, o, m) of inputs (n, i)."""
    into, outer = _pass_through(layers, x), len(layers[-1])
    m, width = shape_of(layers).size, len(into[-1])
    rows = np.zeros((outer, m, len(x)))
    for k in range(outer):
        rows[k, : m - outer * width] = _go_back(layers, into, k)
        at = m - (outer - k) * width
        rows[k, at : at + width] = into[-1]
    return np.moveaxis(rows, 2, 0)


def _pass_through(layers: Layers, x: Array) -> list[Array]:
    """What goes into each layer, [a, 1] as (width + 1, n): rows side by side, for long loops."""
    into = [np.vstack([x.T, np.ones(len(x))])]
    for layer in layers[:-1]:
        into.append(np.vstack([np.tanh(layer @ into[-1]), np.ones(len(x))]))
    return into


def _go_back(layers: Layers, into: list[Array], k: int) -> Array:
    """∂y_k/∂weights of the hidden layers, (m', n), from the last to the first.

    With [a, 1] what goes into a layer L and a' what comes out of it:

        D = ∂y_k/∂(L [a, 1]) = ∂y_k/∂a' ∘ (1 − a'²),   ∂y_k/∂L = D [a, 1]ᵀ,   ∂y_k/∂a = Lᵀ D
    """
    back, parts = layers[-1][k, :-1, None], []
    for layer, given, got in zip(layers[-2::-1], into[-2::-1], into[:0:-1], strict=True):
        back = back * (1.0 - got[:-1] ** 2)
        parts.append((back[:, None] * given).reshape(layer.size, -1))
        back = layer[:, :-1].T @ back
    return np.concatenate(parts[::-1])


def sum_normal_equations(
    layers: Layers, x: Array, target: Array, weight: Array | None = None
) -> Sums:
    """Square error, gradient and JᵀJ of e = y − target; `weight` (n,) counts rows for less."""
    if len(layers) == 2:
        return _sum_without_rows(layers[0], layers[1], x, target, weight)
    m, width = shape_of(layers).size, layers[-1].shape[1]
    square, gradient, information, total = 0.0, np.zeros(m), np.zeros((m, m)), 0.0
    inner = slice(0, m - layers[-1].size)
    for start in range(0, len(x), _FEWER_ROWS):
        rows = slice(start, start + _FEWER_ROWS)
        into = _pass_through(layers, x[rows])
        error = layers[-1] @ into[-1] - target[rows].T
        share = np.ones(error.shape[1]) if weight is None else weight[rows]
        total += float(share.sum())
        square += float((share * error**2).sum())
        gram = into[-1] @ (into[-1] * share).T
        for k in range(len(error)):
            own = slice(inner.stop + k * width, inner.stop + (k + 1) * width)
            by = _go_back(layers, into, k)
            weighted = by * share
            gradient[inner] += weighted @ error[k]
            gradient[own] += into[-1] @ (share * error[k])
            information[inner, inner] += weighted @ by.T
            information[inner, own] += weighted @ into[-1].T
            information[own, own] += gram
    information[inner.stop :, inner] = information[inner, inner.stop :].T
    return Sums(square, gradient, information, total)


def _sum_without_rows(
    hidden: Array, output: Array, x: Array, target: Array, weight: Array | None
) -> Sums:
    """The sums of one hidden layer, without ever forming J.

    With Z = [(1 − a_j²) [x, 1]_l, [a, 1]_j] (n, q), one product ZᵀZ holds all of it:

        JᵀJ(U, U) = (VᵀV)_jj' ∘ ZᵀZ,   JᵀJ(U, V_k) = V_kj ∘ ZᵀZ,   JᵀJ(V_k, V_k) = ZᵀZ

    which is o times less work than the rows of J.
    """
    cut = hidden.size
    q = cut + len(hidden) + 1
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
    return Sums(square, join(inner, outer), _information(gram, hidden, output), total)


def sum_gradient(layers: Layers, x: Array, target: Array) -> tuple[float, Array]:
    """Σ e² and its half gradient Jᵀ e (m,) of e = y − target, by backpropagation.

    With [a, 1] what goes into a layer L: ∂/∂L = D [a, 1]ᵀ, D = e of the last, and of the one before

        D ← Lᵀ D ∘ (1 − a²)
    """
    into = _pass_through(layers, x)
    back = layers[-1] @ into[-1] - target.T
    square, parts = float(np.vdot(back, back)), []
    for layer, given in zip(layers[::-1], into[::-1], strict=True):
        parts.append(back @ given.T)
        back = layer[:, :-1].T @ back * (1.0 - given[:-1] ** 2)  # of no use before the first
    return square, join(*parts[::-1])


def square_error(layers: Layers, x: Array, target: Array, weight: Array | None = None) -> float:
    """Σ w e² alone, for a step that may be rejected."""
    error = forward(layers, x) - target
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


def _information(gram: Array, hidden: Array, output: Array) -> Array:
    """JᵀJ (m, m) from the one product."""
    cut, width = hidden.size, output.shape[1]
    whole = np.zeros((cut + output.size, cut + output.size))
    spread = np.repeat(output[:, :-1], hidden.shape[1], axis=1)
    whole[:cut, :cut] = gram[:cut, :cut] * (spread.T @ spread)
    for k in range(len(output)):
        own = slice(cut + k * width, cut + (k + 1) * width)
        whole[own, own] = gram[cut:, cut:]
        whole[:cut, own] = gram[:cut, cut:] * spread[k][:, None]
        whole[own, :cut] = whole[:cut, own].T
    return whole


def draw_weights(rng: np.random.Generator, shape: Shape, *, output_sd: float = 0.5) -> Array:
    """Weights to start from, after Nguyen and Widrow (1990): each node bends somewhere in −1…1.

    Rows of a hidden layer have the length 0.7 h^(1/i) in random directions, for h nodes and i that
    go in, constants spread evenly.
    """
    layers = [_draw_nodes(rng, into, nodes) for into, nodes in pairwise(shape.widths[:-1])]
    last = (shape.outputs, shape.widths[-2] + 1)
    return join(*layers, output_sd * rng.uniform(-1.0, 1.0, last))


def _draw_nodes(rng: np.random.Generator, inputs: int, nodes: int) -> Array:
    length = 0.7 * nodes ** (1.0 / inputs)
    drawn = rng.standard_normal((nodes, inputs + 1))
    drawn[:, :-1] *= length / np.linalg.norm(drawn[:, :-1], axis=1, keepdims=True)
    drawn[:, -1] = length * np.linspace(-1.0, 1.0, nodes) if nodes > 1 else 0.0
    return drawn
