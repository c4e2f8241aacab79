"""The 35 moments: against direct sums, moved to other centres, and with the noise taken out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.maths.equation import moments

SEEDS = st.integers(0, 2**32 - 1)


def direct(points: np.ndarray, centre: np.ndarray, scale: float) -> np.ndarray:
    """The moments by their definition."""
    u = (points - centre) / scale
    return np.array([np.prod(u ** np.array(e), axis=1).sum() for e in moments.EXPONENTS])


def test_every_moment_up_to_degree_four_is_kept_once() -> None:
    assert len(moments.EXPONENTS) == len(set(moments.EXPONENTS)) == 35
    assert all(sum(e) <= 4 for e in moments.EXPONENTS)


@pytest.mark.parametrize("n", [1, 7, 4096, 10_001])  # blocks have 4096 rows
def test_accumulate_is_the_direct_sum(n: int) -> None:
    points = np.random.default_rng(n).normal([1.0, -2.0, 3.0], 1.0, (n, 3))
    centre = np.array([0.5, -1.0, 2.0])
    found = moments.accumulate(points, centre, 2.0)
    assert found == pytest.approx(direct(points, centre, 2.0), rel=1e-10, abs=1e-9 * n)


@given(SEEDS)
def test_moments_elsewhere_follow_from_those_here(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, here, there = rng.normal(size=(50, 3)), rng.normal(size=3), rng.normal(size=3)
    sums = moments.accumulate(points, here, 0.7)
    moved = moments.rebase(sums, here, 0.7, there, 1.9)
    assert moved == pytest.approx(direct(points, there, 1.9), rel=1e-9, abs=1e-9)
    back = moments.rebase(moved, there, 1.9, here, 0.7)
    assert back == pytest.approx(sums, rel=1e-8, abs=1e-8)


def test_the_gram_matrix_is_made_of_them() -> None:
    points = np.random.default_rng(1).normal(size=(30, 3))
    x, y, z = points.T
    d = np.stack([x * x, y * y, z * z, y * z, x * z, x * y, x, y, z, np.ones(30)])
    sums = moments.accumulate(points, np.zeros(3), 1.0)
    assert sums[moments.GRAM_INDEX] == pytest.approx(d @ d.T)
    assert moments.compute_denoised_gram(sums)[0] == pytest.approx(d @ d.T)


def test_denoised_moments_expect_what_there_is_without_noise() -> None:
    rng = np.random.default_rng(2)
    sd, draws = 0.4, 400
    true = rng.normal(size=(1000, 3))
    wanted = moments.compute_denoised_gram(moments.accumulate(true, np.zeros(3), 1.0))[0]
    found, noisy = [], []
    for _ in range(draws):
        sums = moments.accumulate(true + sd * rng.normal(size=true.shape), np.zeros(3), 1.0)
        first, second, third = moments.compute_denoised_gram(sums)
        found.append(first - sd**2 * second + sd**4 * third)
        noisy.append(first)
    error = (np.mean(found, axis=0) - wanted)[:9, :]
    standard_error = (np.std(found, axis=0) / np.sqrt(draws))[:9, :]
    assert np.abs(error / standard_error).max() < 4
    left_in = (np.mean(noisy, axis=0) - wanted)[:9, :]
    assert np.abs(left_in / standard_error).max() > 100
