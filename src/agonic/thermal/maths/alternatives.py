"""What a model lacks in a known field: would hysteresis or a network foretell unseen readings?

Columns stand beside the design of the fit, so that every alternative is algebra on cross-products
by blocks, and no fit. Hysteresis is the play operator (backlash) of the temperature, or of the
field's components: it follows its input at a distance, and its distance tells from which side the
input came. The network has one hidden layer of fixed random weights (Huang, Zhu & Siew 2006), of
which only the output is fitted.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.thermal.maths.known_field import KnownFieldProblem, Linearised, predict_unseen

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


def compare_alternatives(
    problem: KnownFieldProblem, fitted: Linearised, weights: Array, x: Array
) -> dict[str, float]:
    """Hysteresis and a network, each with its rms on the blocks that it has not seen over that of
    the fit without it; empty where the readings are too few, or too many.

    Parameters: readings in the order in which they were taken, about the solution, the weight (n,)
    of each, the temperatures (n,) as −1…1.
    """
    n, m = fitted.design.shape
    if n > MOST or 3 * n < _FEWEST * 3 * (m + UNITS):
        return {}
    footpoints = fitted.design[:, 1:4]
    features = {
        TEMPERATURE: [play(x[:, None], width) for width in WIDTHS],
        FIELD: [play(footpoints, width) for width in WIDTHS],
        NETWORK: [_respond(footpoints, x)],
    }
    plain = _measure(problem, fitted, weights, np.zeros((n, 0)))
    return {
        name: float(np.sqrt(min(_measure(problem, fitted, weights, of) for of in tried) / plain))
        for name, tried in features.items()
    }


def play(values: Array, width: float) -> Array:
    """How far the play operator of each column stands from it, −1…1.

    Every input clips where the operator stands, and clips joined are a clip: so that it follows a
    record in log₂ n steps.

    >>> play(np.array([[-1.0], [0.0], [1.0], [0.9], [0.0]]), 0.5).ravel().tolist()
    [0.0, -1.0, -1.0, -0.8, 1.0]
    """
    reach = width * np.maximum(np.ptp(values, axis=0) / 2, 1e-300)
    low, high = values - reach, values + reach
    low[0] = high[0] = values[0]
    step = 1
    while step < len(values):
        after = low[step:], high[step:]
        low[step:], high[step:] = (np.clip(of[:-step], *after) for of in (low, high))
        step *= 2
    return np.asarray((low - values) / reach)


def _respond(field: Array, x: Array) -> Array:
    """What hidden units with random weights make of field and temperature, (n, UNITS)."""
    drawn = np.random.default_rng(20).standard_normal((5, UNITS))
    return np.asarray(np.tanh(np.column_stack([field, x, np.ones(len(x))]) @ drawn))


def _measure(
    problem: KnownFieldProblem, fitted: Linearised, weights: Array, features: Array
) -> float:
    """The squares that fits leave of blocks that they have not seen, with features (n, k) on every
    axis."""
    sums = fitted.sum_up(weights, problem.blocks(), features)
    m, k = fitted.design.shape[1], features.shape[1]
    own = np.diag(sums.sum(axis=0))[m : m + k]
    columns = np.arange(m + k)
    ridges = [np.concatenate([np.zeros(m), ridge * own]) for ridge in _RIDGES]
    return min(float(predict_unseen(sums, columns, ridge)[1].sum()) for ridge in ridges)
