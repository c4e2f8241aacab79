"""Rao's score test: its level under noise with memory, the size it tells, the move it predicts."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from agonic.maths.estimation.inference.linearised import (
    Linearised,
    batches_of,
    find_batches_beside,
    with_columns,
)
from agonic.maths.estimation.inference.score_test import Score, Terms, score_tests
from agonic.maths.estimation.noise.residuals import correlation_length


def score_one(fit: Linearised, *terms: np.ndarray) -> Score | None:
    return score_tests(fit, [Terms(*terms)])[0]


def line(n: int, seed: int, memory: float = 0.0, bend: float = 0.0, tails: bool = False):
    """Residuals of a straight line through readings that may bend, and the column of the bend."""
    rng = np.random.default_rng(seed)
    t = np.linspace(-1, 1, n)
    noise = rng.standard_t(4, n) / np.sqrt(2) if tails else rng.normal(size=n)
    if memory:
        noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise)
    jacobian = np.stack([np.ones(n), t], axis=1)
    readings = 3.0 + 2.0 * t + bend * t**3 + noise
    found = np.linalg.lstsq(jacobian, readings, rcond=None)[0]
    correlation = (1 + memory) / (1 - memory)
    residuals = readings - jacobian @ found
    weights, prior = np.ones(n), np.zeros((2, 2))
    return (
        Linearised(residuals, -jacobian, weights, prior, batches_of(n, correlation)),
        t[:, None] ** 3,
        found,
    )


@pytest.mark.parametrize(("memory", "tails"), [(0.0, False), (0.0, True), (0.8, False)])
def test_p_values_are_uniform_without_an_effect(memory: float, tails: bool) -> None:
    scores = (score_one(*line(1500, seed, memory, tails=tails)[:2]) for seed in range(300))
    assert kstest([score.p_value for score in scores if score], "uniform").pvalue > 0.003


def test_size_and_move_are_those_of_a_fit_with_the_term() -> None:
    fit, column, found = line(2000, 1, bend=2.0)
    score = score_one(fit, column)
    assert score is not None
    whole = np.hstack([-fit.jacobian, column])
    readings = fit.residuals - fit.jacobian @ found
    wider = np.linalg.lstsq(whole, readings, rcond=None)[0]
    assert score.p_value < 1e-6
    np.testing.assert_allclose(score.size, wider[2:], rtol=1e-9)
    np.testing.assert_allclose(found + score.move, wider[:2], rtol=1e-9)


@pytest.mark.parametrize("n", [300, 100_000])
def test_several_terms_are_tested_as_each_by_itself(n: int) -> None:
    """Few readings together, many one by one."""
    fit, column, _ = line(n, 4, bend=0.5)
    rng = np.random.default_rng(0)
    wide = np.hstack([column, column**2, np.cos(9 * column)])
    terms = [
        Terms(wide, noise=0.01 * rng.normal(size=wide.shape)),
        Terms(column, surely=True),
        Terms(column**2, shared=0.01 * rng.normal(size=column.shape), likely=0.1),
        Terms(fit.jacobian[:, 1:]),
    ]
    for found, one in zip(score_tests(fit, terms), terms, strict=True):
        (alone,) = score_tests(fit, [one])
        assert (found is None) == (alone is None)
        if found is not None and alone is not None:
            for ours, theirs in zip(found, alone, strict=True):
                np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-12)
    assert score_tests(fit, []) == []


def test_a_term_that_the_fit_holds_already_is_no_term() -> None:
    fit, _, _ = line(500, 2)
    assert score_one(fit, fit.jacobian[:, 1:]) is None


def test_beside_a_term_that_explains_all_nothing_is_left() -> None:
    fit, column, _ = line(2000, 3, bend=2.0)
    fifth = np.sign(column) * np.abs(column) ** (5 / 3)
    alone, beside = score_one(fit, fifth), score_one(with_columns(fit, column), fifth)
    assert alone is not None
    assert beside is not None
    assert alone.p_value < 1e-4 < beside.p_value


def test_columns_made_of_noise_are_not_tested() -> None:
    fit, _, _ = line(500, 4)
    noise = np.random.default_rng(0).normal(size=(500, 1))
    assert score_one(fit, noise, noise) is None


def test_no_size_is_made_of_what_is_not_significant_enough() -> None:
    fit, column, _ = line(300, 4, bend=0.5)
    (score,) = score_tests(fit, [Terms(column)])
    assert score is not None
    at, below = (
        score_tests(fit, [Terms(column)], p)[0] for p in (score.p_value, score.p_value / 2)
    )
    assert at is not None
    assert at.size == score.size
    assert below is None


def test_batches_beside_a_term_are_those_of_a_fit_with_it() -> None:
    fit, column, _ = line(3000, 5, memory=0.8, bend=5.0)
    wider = np.hstack([fit.jacobian, column])
    left = fit.residuals - wider @ np.linalg.lstsq(wider, fit.residuals, rcond=None)[0]
    expected = batches_of(3000, correlation_length(left, fit.weights))
    assert np.array_equal(find_batches_beside(fit, column).of, expected)
