"""What simulations draw at random."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from agonic.arrays import Array
from agonic.calibration.affine import Affine, Model


def random_calibration(
    rng: np.random.Generator,
    *,
    soft_iron: float = 0.1,
    cross: float = 0.05,
    bias: float = 55_000.0,
    model: Model = "full",
) -> Affine:
    """A calibration to find: a symmetric matrix near identity, a bias in a random direction."""
    gains = rng.uniform(1 - soft_iron, 1 + soft_iron, 1 if model == "sphere" else 3)
    matrix = np.diag(np.broadcast_to(gains, 3))
    if model == "full":
        upper = np.zeros((3, 3))
        upper[np.triu_indices(3, 1)] = rng.uniform(-cross, cross, 3)
        matrix = matrix + upper + upper.T
    return Affine(bias=bias * draw_directions(rng, 1)[0], matrix=matrix, model=model)


def draw_directions(rng: np.random.Generator, n: int, dimensions: int = 3) -> Array:
    """Unit vectors (n, dimensions) uniform over the sphere; with 4, attitudes as quaternions."""
    vectors = rng.standard_normal((n, dimensions))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def draw_smooth(
    rng: np.random.Generator, duration_s: float, *, sd: float, pace_s: float
) -> Callable[[Array], Array]:
    """A smooth random function of time about zero, independent after some `pace_s` seconds."""
    knots = make_knots(duration_s, pace_s)
    return CubicSpline(knots, sd * rng.standard_normal(len(knots)))


def make_knots(duration_s: float, pace_s: float) -> Array:
    """Times `pace_s` apart from before 0 to after `duration_s`, at least four."""
    return np.arange(-1, np.ceil(duration_s / pace_s) + 3) * pace_s


def draw_motors(count: int, seed: int) -> Array:
    """The field of each motor at full duty, (count, 3), nT, as leads near a compass make it."""
    return 4000.0 * np.random.default_rng((seed, count)).standard_normal((count, 3))
