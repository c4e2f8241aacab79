"""`compare_methods`: Levenberg–Marquardt beside gradient descent, from the same start."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import network
from agonic.network.fit.problem import Settings, pose_problem
from agonic.network.fit.solve import scale_problem
from agonic.network.maths import levenberg_marquardt
from agonic.readable import Shown
from agonic.reference import Reference
from agonic.samples import Samples

_MORE, _LESS, _WORSE = 1.05, 0.7, 1.04


class Descent(NamedTuple):
    """The last weights (m,), and the mean square error after every epoch (k,)."""

    weights: Array
    mean_square: Array


def descend(
    problem: levenberg_marquardt.Problem,
    start: Array,
    *,
    epochs: int,
    adaptive: bool = False,
    rate: float = 0.1,
    momentum: float = 0.9,
) -> Descent:
    """The weights after so many epochs of plain backpropagation from a start (m,), on all rows.

        v ← momentum v − rate ∇E,   ω ← ω + v,   E the mean square error of the scaled outputs

    (Rumelhart, Hinton & Williams 1986); or with a rate that adapts (Vogl et al. 1988): 5 % more
    after a step that helped, 30 % less after one that is undone, for it made E 4 % larger.
    """
    count = problem.target.size
    weights, velocity = np.array(start, dtype=np.float64), np.zeros(len(start))
    square, gradient = _evaluate(problem, weights)
    worst, found = 1e6 * square, np.empty(epochs)
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


def _evaluate(problem: levenberg_marquardt.Problem, weights: Array) -> tuple[float, Array]:
    layers = network.split(weights, problem.shape)
    return network.sum_gradient(layers, problem.x, problem.target)


GOAL = 1e-3
"""Mean square error, scaled, that the paper counts epochs to."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """How one method trained a network.

    `mean_square` (k,) the scaled error after every epoch, `least` at the end; `seconds` what all
    of the `epochs` took; `rms` and `maximum` nT, what is left at the end; `epochs_to_goal` until
    the mean square error was below 0.001, `epochs_to_least` until it was within 5 % of the least
    that any method reached; None where it never was.
    """

    name: Annotated[str, Shown("Trained by")]
    epochs_to_goal: Annotated[int | None, Shown("epochs to 0.001")]
    epochs_to_least: Annotated[int | None, Shown("to 5 % of the least")]
    epochs: Annotated[int, Shown("in all")]
    seconds: Annotated[float, Shown("time", write="{:.2f} s".format)]
    least: Annotated[float, Shown("mean square, scaled", write="{:.2g}".format, key="mean_square")]
    rms: Annotated[float, Shown("rms", "nT", key="rms_nT")]
    maximum: Annotated[float, Shown("largest", "nT", key="maximum_nT")]
    mean_square: Array


def compare_methods(
    samples: Samples, reference: Reference, *, epochs: int = 5000, **settings: Any
) -> tuple[Method, ...]:
    """The same network trained by Levenberg–Marquardt and by gradient descent with momentum.

    All start from the same random weights on the same readings, nothing restrains the weights, and
    an epoch is one step that all readings were asked for.

    Parameters: `samples`, `reference` and settings as in `fit_network`; `epochs` how long gradient
    descent goes on.

    Returns a `Method` for each. Raises as `fit_network`.

    Source: Wang, Sheng, He & Cheng (2020), doi:10.4236/jcc.2020.86004; Rumelhart, Hinton & Williams
    (1986); Vogl, Mangis, Rigler, Zink & Alkon (1988).

    Examples
    --------
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(15.0)
    >>> found = compare_methods(made.samples, made.reference, base=None, epochs=500)
    >>> [method.epochs_to_goal for method in found]
    [6, 313, 101]
    """
    problem = pose_problem(samples, reference, Settings(**settings))
    scaled = scale_problem(problem, np.flatnonzero(problem.rows))
    rows = scaled.between
    if rows.weight is not None:
        rows = rows.subset(rows.weight > 0)._replace(weight=None)
    start = network.draw_weights(np.random.default_rng(problem.settings.seed), rows.shape)
    half, ran = scaled.scale.output_half, {}
    for name, train in _list_trainers(epochs).items():
        began = time.perf_counter()
        weights, curve = train(rows, start)
        seconds = time.perf_counter() - began
        left = half * (network.forward(network.split(weights, rows.shape), rows.x) - rows.target)
        ran[name] = curve, seconds, left
    least = min(float(curve[-1]) for curve, *_ in ran.values())
    return tuple(
        Method(
            name=name,
            mean_square=curve,
            epochs=len(curve),
            least=float(curve[-1]),
            seconds=seconds,
            rms=float(np.sqrt(np.mean(left**2))),
            maximum=float(np.abs(left).max()),
            epochs_to_goal=_find_first_below(curve, GOAL),
            epochs_to_least=_find_first_below(curve, 1.05 * least),
        )
        for name, (curve, seconds, left) in ran.items()
    )


Trainer = Callable[[levenberg_marquardt.Problem, Array], Descent]


def _list_trainers(epochs: int) -> dict[str, Trainer]:
    def marquardt(rows: levenberg_marquardt.Problem, start: Array) -> Descent:
        found = levenberg_marquardt.train(rows, start, stopping="plain")
        return Descent(found.weights, np.array([epoch.mean_square for epoch in found.epochs]))

    return {
        "Levenberg–Marquardt": marquardt,
        "gradient descent with momentum": partial(descend, epochs=epochs),
        "the same, adaptive rate": partial(descend, epochs=epochs, adaptive=True),
    }


def _find_first_below(curve: Array, level: float) -> int | None:
    below = np.flatnonzero(curve < level)
    return int(below[0]) + 1 if len(below) else None
