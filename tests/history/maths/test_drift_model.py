"""Lines, walks and scatter: against the dense equations, and honest whatever the truth is."""

import numpy as np
import pytest
from scipy import stats

from agonic.history.maths.drift_model import (
    Posterior,
    Series,
    compute_posterior,
    compute_products,
    mix_normals,
    predict,
)

# formal error, scatter, walk across the span: what a sensor may be made of
MADE_OF = {
    "formal": (1.0, 0.0, 0.0),
    "scatter": (0.1, 1.0, 0.0),
    "walk": (0.1, 0.0, 3.0),
    "all": (0.3, 1.0, 3.0),
    "even": (1.0, 1.0, 1.0),
}


def drawn(
    many: int, n: int, made: tuple[float, float, float], slope: float = 2.0, seed: int = 0
) -> tuple[Series, np.ndarray]:
    """Series at uneven times, and the level behind them without what scatters."""
    rng = np.random.default_rng(seed)
    formal, scatter, walk = made
    time = np.sort(rng.uniform(0, 1, (many, n)), axis=1)
    time = (time - time[:, :1]) / (time[:, -1:] - time[:, :1])
    steps = rng.normal(size=(many, n)) * np.sqrt(np.diff(time, prepend=0.0, axis=1))
    level = 10.0 + slope * time + walk * np.cumsum(steps, axis=1)
    value = level + np.hypot(formal, scatter) * rng.normal(size=(many, n))
    line = np.stack([np.ones_like(time), time], axis=1)
    return Series(time, value, np.full((many, n), formal**2), line), level


def one_of(series: Series, k: int) -> Series:
    return Series(*(values[k] for values in series))


def test_filter_gives_what_the_dense_equations_give() -> None:
    series, _ = drawn(1, 9, MADE_OF["all"])
    one = one_of(series, 0)
    scatter, walk = np.array([0.7]), np.array([2.0])
    covariance = np.diag(one.variance + 0.49) + 4.0 * np.minimum.outer(one.time, one.time)
    columns = np.vstack([one.value, one.design])
    seen = compute_products(one, scatter, walk)
    np.testing.assert_allclose(
        seen.base[0], columns @ np.linalg.solve(covariance, columns.T), rtol=1e-9, atol=1e-9
    )
    assert seen.logs[0] == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_prediction_is_that_of_the_gaussian_process() -> None:
    series, _ = drawn(1, 9, MADE_OF["all"], seed=3)
    one = one_of(series, 0)
    at = np.array([0.0, 0.31, one.time[4], 1.0, 1.7])
    line = np.stack([np.ones(5), at])
    covariance = np.diag(one.variance + 0.49) + 4.0 * np.minimum.outer(one.time, one.time)
    across = 4.0 * np.minimum.outer(at, one.time)
    normal = one.design @ np.linalg.solve(covariance, one.design.T)
    beta = np.linalg.solve(normal, one.design @ np.linalg.solve(covariance, one.value))
    pull = np.linalg.solve(covariance, across.T).T
    mean = line.T @ beta + pull @ (one.value - one.design.T @ beta)
    lean = line.T - pull @ one.design.T
    own = 4.0 * at - np.einsum("ij,ij->i", pull, across)
    variance = own + np.einsum("ij,jk,ik->i", lean, np.linalg.inv(normal), lean)

    node = Posterior(
        np.array([0.7]), np.array([2.0]), np.ones(1), beta[None], np.linalg.inv(normal)[None]
    )
    got = predict(one, node, at, line)
    np.testing.assert_allclose(got[0][0], mean, rtol=1e-7)
    np.testing.assert_allclose(got[1][0], variance, rtol=1e-6)


def test_slope_of_large_scatter_has_students_t() -> None:
    series, _ = drawn(40, 12, (1e-3, 1.0, 0.0), slope=0.0)
    level = compute_posterior(series)
    line = [stats.linregress(t, y).pvalue for t, y in zip(series.time, series.value, strict=True)]
    got = level.p_value(1)
    # what may be a walk makes a slope less sure than scatter alone would, and never surer
    assert np.all(got > 0.7 * np.array(line))
    assert np.corrcoef(np.log(got), np.log(line))[0, 1] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 12, 30])
def test_slope_is_as_sure_as_it_says_over_all_that_a_sensor_may_be_made_of(n: int) -> None:
    errors, chances = [], []
    for seed, made in enumerate(MADE_OF.values()):
        series, _ = drawn(150, n, made, seed=seed)
        belief = compute_posterior(series)
        errors.append((belief.mean(1) - 2.0) / belief.sd(1))
        flat = compute_posterior(series._replace(value=series.value - 2.0 * series.time))
        chances.append(flat.p_value(1))
    errors = np.array(errors)
    assert abs(errors.mean()) < 0.12
    assert 0.6 < np.sqrt(np.mean(errors**2)) < 1.1
    # of one kind alone it can be half as sure as it could be, or a little surer than it should
    # (few values are too few to know it: Student's tails)
    assert np.all(np.sqrt(np.mean(errors**2, axis=1)) < 1.6 + 2.0 / n)
    assert np.mean(np.array(chances) < 0.01) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 20])
def test_level_is_as_sure_as_it_says(n: int) -> None:
    errors = []
    for seed, made in enumerate(MADE_OF.values()):
        series, level = drawn(80, n, made, seed=10 + seed)
        beliefs = compute_posterior(series)
        of_kind = []
        for k in range(80):
            one, belief = one_of(series, k), Posterior(*(values[k] for values in beliefs))
            at = np.array([n // 2, n - 1])
            mean, variance = predict(one, belief, one.time[at], one.design[:, at])
            centre, sd = mix_normals(belief.weight, mean.T, variance.T)
            of_kind.append((centre - level[k, at]) / sd)
        errors.append(of_kind)
    errors = np.array(errors)
    assert abs(errors.mean()) < 0.12
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.15
    assert np.all(np.sqrt(np.mean(errors**2, axis=(1, 2))) < 1.5)
