"""Plain backpropagation: gradient descent with momentum, for comparison.

    v ← momentum v − rate ∇E,   ω ← ω + v,   E the mean square error of the scaled outputs

as Rumelhart, Hinton & Williams (1986) have it; or with a rate that adapts (Vogl et al. 1988): 5 %
more after each step that helped; after one that made E larger by more than 4 % the step is undone,
v forgotten and the rate 30 % less.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import network
from agonic.network.maths.levenberg_marquardt import Problem

RATE = 0.1
MOMENTUM = 0.9
_MORE, _LESS, _WORSE = 1.05, 0.7, 1.04
_DIVERGED = 1e6  # times what it was at the start


class Descent(NamedTuple):
    """The last weights (m,), and the mean square error after every epoch (k,)."""

    weights: Array
    mean_square: Array


def descend(
    problem: Problem,
    start: Array,
    *,
    epochs: int,
    adaptive: bool = False,
    rate: float = RATE,
    momentum: float = MOMENTUM,
) -> Descent:
    """The weights after so many epochs from a start (m,), each of which sees all rows.

    It ends early where the error grows without limit.
    """
    count = problem.target.size
    weights, velocity = np.array(start, dtype=np.float64), np.zeros(len(start))
    square, gradient = _evaluate(problem, weights)
    worst, found = _DIVERGED * square, np.empty(epochs)
    for epoch in range(epochs):
        step = momentum * velocity - rate * 2.0 / count * gradient
        now, fresh = _evaluate(problem, weights + step)
        if adaptive and not now <= _WORSE * square:
            rate, velocity = _LESS * rate, np.zeros(len(start))
        else:
            rate *= _MORE if adaptive and now < square else 1.0
            weights, velocity, square, gradient = weights + step, step, now, fresh
        found[epoch] = square / count
        if not square <= worst:
            return Descent(weights, found[: epoch + 1])
    return Descent(weights, found)


def _evaluate(problem: Problem, weights: Array) -> tuple[float, Array]:
    layers = network.split(weights, problem.shape)
    return network.sum_gradient(layers, problem.x, problem.target)
