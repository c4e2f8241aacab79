"""Errors that last: found where they are, none where they are not, and what they add."""

import numpy as np
import pytest
from scipy.signal import lfilter

from agonic.inflight.maths.correlated_errors import (
    CorrelatedError,
    Sums,
    compute_scatter,
    find_correlated_errors,
)


def wandering(rng: np.random.Generator, n: int, time: float, columns: int) -> np.ndarray:
    """Gauss–Markov noise of unit variance, (n, columns)."""
    kept = np.exp(-1 / time)
    white = rng.normal(size=(n, columns))
    white[1:] *= np.sqrt(1 - kept**2)
    return lfilter([1.0], [1.0, -kept], white, axis=0)


def turning(n: int) -> np.ndarray:
    """A direction that turns in 700 readings and slowly nods."""
    along = 2 * np.pi * np.arange(n) / 700.0
    nod = 0.6 * np.sin(along / 7.3)
    return np.stack([np.cos(along) * np.cos(nod), np.sin(along) * np.cos(nod), np.sin(nod)], axis=1)


def summed(residuals: np.ndarray, jacobian: np.ndarray, *directions: np.ndarray, per: int = 1):
    n = len(residuals)
    sums = Sums.empty(n // per, jacobian.shape[1], [d.shape[1] for d in directions])
    sums.add(np.arange(n) // per, np.ones(n), residuals, jacobian, directions)
    return sums


def test_columns_that_are_zero_for_long_and_several_times_scatter_as_the_double_sum() -> None:
    """Three thousand stretches, more than are worked on at once; splines that end and begin."""
    rng = np.random.default_rng(3)
    n, d = 3000, turning(3000)
    jacobian = rng.normal(size=(n, 5))
    jacobian[1200:, 3] = jacobian[:1900, 4] = 0.0
    errors = [CorrelatedError(2.0, 40.0, 1), CorrelatedError(0.5, 900.0, 1)]
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    kernel = sum(e.variance * np.exp(-lag / e.time_s) for e in errors) * (d @ d.T)
    found = compute_scatter(summed(np.zeros(n), jacobian, np.ones((n, 1)), d), errors, 1.0)
    assert found == pytest.approx(jacobian.T @ kernel @ jacobian, rel=1e-9)


def test_the_scatter_is_the_double_sum() -> None:
    rng = np.random.default_rng(0)
    n, jacobian, d = 50, rng.normal(size=(50, 4)), turning(50)
    sums = summed(np.zeros(n), jacobian, np.ones((n, 1)), d)
    errors = [CorrelatedError(2.0, 7.0, 1), CorrelatedError(0.5, 20.0, 0)]
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * 3.0
    covariance = 2.0 * np.exp(-apart / 7.0) * (d @ d.T) + 0.5 * np.exp(-apart / 20.0)
    np.testing.assert_allclose(
        compute_scatter(sums, errors, 3.0), jacobian.T @ covariance @ jacobian, rtol=1e-10
    )


@pytest.mark.parametrize("per", [1, 5])
def test_what_lasts_is_found_with_its_size_and_time(per: int) -> None:
    """A field that stands while the direction it is seen along turns: size, time, and scatter."""
    n, d = 20_000, turning(20_000)
    ones, sizes, times, ratios = np.ones((n, 1)), [], [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        slow = 0.5 * wandering(rng, n, 400.0, 3)
        r = rng.normal(size=n) + (slow * d).sum(axis=1)
        sums = summed(r, d, ones, d, per=per)
        errors = find_correlated_errors(sums, r.var(), float(per))
        sizes.append(sum(e.variance for e in errors))
        times.append(sum(e.variance * e.time_s for e in errors) / sizes[-1])
        ratios.append(np.trace(compute_scatter(sums, errors, float(per))))
    kept = np.exp(-np.abs(np.subtract.outer(np.arange(0, n, 10), np.arange(0, n, 10))) / 400.0)
    few = d[::10]
    truth = 100 * 0.25 * np.trace(few.T @ (kept * (few @ few.T)) @ few)
    assert np.median(sizes) == pytest.approx(0.25, rel=0.25)
    assert np.median(times) == pytest.approx(400.0, rel=0.5)
    assert np.median(ratios) == pytest.approx(truth, rel=0.3)


def test_white_noise_is_left_alone() -> None:
    n, d = 5000, turning(5000)
    found = [
        find_correlated_errors(
            summed(np.random.default_rng(k).normal(size=n), d, np.ones((n, 1)), d), 1.0, 1.0
        )
        for k in range(40)
    ]
    assert sum(len(errors) > 0 for errors in found) <= 2
    short = summed(np.ones(50), d[:50], np.ones((50, 1)))
    assert find_correlated_errors(short, 1.0, 1.0) == ()
