"""Which rows had which bias: the edges of a change, from a rough guess of them."""

import numpy as np
import pytest

from agonic.maths.equation.bias_states import NEITHER, find_bias_states
from agonic.maths.estimation.changes.hidden_states import find_path

NOISE = 0.004
SHAPE = np.array([[1.05, 0.02, 0.0], [0.02, 0.98, -0.03], [0.0, -0.03, 0.97]])
CENTRE = np.array([0.3, -0.2, 0.5])


def turned(n: int, shift: np.ndarray, seed: int = 0) -> np.ndarray:
    """Readings of a sensor that turns smoothly, with soft iron, and shifts (n, 3) of its bias."""
    rng = np.random.default_rng(seed)
    angles = np.cumsum(rng.normal(size=(n, 3)), axis=0) / np.sqrt(n) * 6 * np.pi
    a, b = angles[:, 0], angles[:, 1]
    field = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
    noise = NOISE * rng.normal(size=(n, 3))
    return field @ np.linalg.inv(SHAPE) + CENTRE + shift + noise


def switched(n: int, *stretches: tuple[int, int], size: float) -> np.ndarray:
    shift = np.zeros((n, 3))
    for start, stop in stretches:
        shift[start:stop] = size * np.array([2.0, -1.0, 2.0]) / 3
    return shift


@pytest.mark.parametrize("size", [0.05, 0.3, 1.4])
def test_the_edges_are_found_from_a_guess_that_is_far_off(size: float) -> None:
    n, start, stop = 3000, 700, 1900
    points = turned(n, switched(n, (start, stop), size=size))
    rows = np.arange(n)
    found = find_bias_states(points, (rows >= 1100) & (rows < 1500))
    assert found is not None
    edges = np.flatnonzero(np.diff(found.changed.astype(int))) + 1
    assert len(edges) == 2
    assert edges == pytest.approx([start, stop], abs=25)
    assert found.shift == pytest.approx(size, rel=0.05)
    assert found.noise == pytest.approx(NOISE, rel=0.25)


def test_two_stretches_with_one_bias_are_told_apart_from_a_guess_of_one() -> None:
    n = 3000
    points = turned(n, switched(n, (500, 900), (1600, 2300), size=0.3), seed=3)
    rows = np.arange(n)
    found = find_bias_states(points, (rows >= 1700) & (rows < 2300))
    assert found is not None
    edges = np.flatnonzero(np.diff(found.changed.astype(int))) + 1
    assert edges == pytest.approx([500, 900, 1600, 2300], abs=25)


def test_rows_that_have_neither_bias_are_told() -> None:
    """Something strong comes closer and goes again while the other bias is there."""
    n = 3000
    shift = switched(n, (1000, 2500), size=0.3)
    passing = np.maximum(0.0, 1 - np.abs(np.arange(n) - 400) / 100)
    shift += 2.0 * passing[:, None] * [0.0, 0.0, 1.0]
    found = find_bias_states(turned(n, shift, seed=1), np.arange(n) >= 1500)
    assert found is not None
    neither = np.flatnonzero(found.state == NEITHER)
    assert len(neither) > 100
    assert np.abs(neither - 400).max() < 120


def test_a_path_is_the_cheapest_of_all() -> None:
    """Against every path through two states of eight rows."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        cost, price = rng.uniform(0, 2, (2, 8)), 0.7
        paths = (np.arange(256)[:, None] >> np.arange(8)) & 1
        sums = cost[paths, np.arange(8)].sum(axis=1) + price * np.abs(np.diff(paths)).sum(axis=1)
        found = find_path(cost, price)
        assert sums.min() == pytest.approx(sums[(paths == found).all(axis=1)][0])


def test_too_few_readings_of_either_tell_nothing() -> None:
    points = turned(300, np.zeros((300, 3)))
    assert find_bias_states(points, np.zeros(300, dtype=bool)) is None
