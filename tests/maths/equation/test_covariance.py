"""What residuals say of a fit, against refits that leave blocks out."""

import numpy as np
import pytest

import agonic as ag
from agonic.maths.equation.channels import Problem, compute_residuals
from agonic.maths.equation.covariance import BLOCKS, add_up, predict_unseen
from agonic.maths.equation.maximum_likelihood import estimate
from agonic.simulation import simulate


def posed(model: str, n: int = 1600) -> Problem:
    samples = simulate("hand", n=n, noise=300.0, seed=1).samples
    return Problem((samples.field - samples.field.mean(axis=0)) / 50_000, np.ones(1), model, 0.1)


@pytest.mark.parametrize("model", ["sphere", "full"])
def test_blocks_are_predicted_as_by_a_fit_without_them(model: str) -> None:
    problem = posed(model)
    found = estimate(problem)
    predicted = predict_unseen(problem, found, add_up(problem, found))
    number = np.arange(len(problem.points)) * BLOCKS // len(problem.points)
    for block in range(BLOCKS):
        rest = estimate(problem.subset(np.flatnonzero(number != block)))
        part = problem.subset(np.flatnonzero(number == block))
        left = compute_residuals(part, "magnitude", rest.solution.params)
        assert predicted[block] == pytest.approx(np.mean(left**2), rel=0.1)


def test_sums_are_the_same_however_many_rows_a_pass_takes_at_once(monkeypatch) -> None:
    problem = posed("full", 3000)
    found = estimate(problem)
    at_once = add_up(problem, found)
    monkeypatch.setattr("agonic.maths.equation.covariance._BLOCK", 200)
    in_parts = add_up(problem, found)
    for one, other in zip(at_once, in_parts, strict=True):
        if isinstance(one, np.ndarray):
            assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(one).max())


@pytest.mark.slow
def test_a_larger_model_is_taken_where_unseen_readings_ask_for_it() -> None:
    """Slow errors hide soft iron from the test; what it predicts shows it all the same."""
    taken = []
    for seed in range(6):
        made = simulate("tumble", n=3000, rate_Hz=50, noise=30.0, seed=seed)
        rng = np.random.default_rng(seed)
        slow = np.repeat(rng.normal(size=(12, 3)), 250, axis=0) * 300.0
        samples = made.samples.with_columns(field=made.samples.field + slow)
        taken.append(ag.fit_ellipsoid(samples).calibration.model)
    assert taken.count("full") >= 5


def test_a_start_without_numbers_is_given_up() -> None:
    problem = posed("full")
    found = estimate(problem)
    lost = np.full(len(found.solution.params), 1e200)
    with np.errstate(all="ignore"):
        again = estimate(problem, start=lost)
    np.testing.assert_allclose(again.solution.params, found.solution.params, rtol=1e-6)
