"""What trains the networks of `network.py` beside agonic: SciPy, and JAX with optax.

All take the same start. SciPy's least squares takes the same Jacobian; JAX has its own gradient.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from agonic.maths.equation import network
from agonic.network.maths.levenberg_marquardt import Problem
from benchmarks import tables

Array = NDArray[np.float64]
Trainer = Callable[[Problem, Array], Array]


def residuals(problem: Problem, weights: Array) -> Array:
    """What the network leaves of its targets, row by row."""
    u, v = network.split(weights, problem.shape)
    return (network.forward((u, v), problem.x) - problem.target).ravel()


def train_by_scipy(method: Any, problem: Problem, start: Array) -> Array:
    """Least squares of SciPy by one of its methods."""

    def rows(weights: Array) -> Array:
        u, v = network.split(weights, problem.shape)
        return network.jacobian((u, v), problem.x).reshape(-1, len(weights))

    found = least_squares(
        partial(residuals, problem), start, jac=rows, method=method, max_nfev=300, ftol=1e-6
    )
    return np.asarray(found.x)


def by_jax(name: str, steps: int) -> Trainer | None:
    """L-BFGS or Adam in double precision, compiled; None where JAX or optax is not installed."""
    try:
        import jax
        import optax
    except ImportError:
        return None
    jax.config.update("jax_enable_x64", True)
    optimiser = optax.lbfgs() if name == "L-BFGS" else optax.adam(0.01)

    @jax.jit
    def train(x: Any, target: Any, layers: Any) -> Any:
        def loss(layers: Any) -> Any:
            u, v = layers
            active = jax.numpy.tanh(x @ u[:, :-1].T + u[:, -1])
            return ((active @ v[:, :-1].T + v[:, -1] - target) ** 2).mean()

        valued = optax.value_and_grad_from_state(loss) if name == "L-BFGS" else None

        def step(_: int, carried: Any) -> Any:
            layers, state = carried
            if valued is None:
                value, slope = jax.value_and_grad(loss)(layers)
                change, state = optimiser.update(slope, state, layers)
            else:
                value, slope = valued(layers, state=state)
                change, state = optimiser.update(
                    slope, state, layers, value=value, grad=slope, value_fn=loss
                )
            return optax.apply_updates(layers, change), state

        return jax.lax.fori_loop(0, steps, step, (layers, optimiser.init(layers)))[0]

    def run(problem: Problem, start: Array) -> Array:
        u, v = train(problem.x, problem.target, network.split(start, problem.shape))
        return network.join(np.asarray(u), np.asarray(v))

    return run


def describe_jax() -> str:
    """Which JAX it was, and how."""
    try:
        jax, optax = version("jax"), version("optax")
    except PackageNotFoundError:
        return f"JAX is {tables.NOT_INSTALLED}."
    return f"JAX {jax} with optax {optax}: double precision, one thread, its compiling not counted."


TRAINERS: dict[str, Trainer | None] = {
    "SciPy `lm` (MINPACK)": partial(train_by_scipy, "lm"),
    "SciPy `trf`": partial(train_by_scipy, "trf"),
    "JAX L-BFGS, 1000 steps": by_jax("L-BFGS", 1000),
    "JAX Adam, 3000 steps": by_jax("Adam", 3000),
}
