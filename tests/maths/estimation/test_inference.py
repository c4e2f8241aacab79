"""Wald's test: the p-value is uniform where the numbers are zero, from few readings and many."""

import numpy as np
import pytest
from scipy.stats import kstest

from agonic.maths.estimation.inference import wald


@pytest.mark.parametrize("independent", [6, 30, 3000])
def test_chance_is_uniform_where_nothing_is_there(independent: int) -> None:
    """Means of three numbers over n readings, their covariance from the residuals' own scatter."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(3, 3))
    chances = []
    for _ in range(400):
        noise = rng.standard_normal((3, independent - 3))
        scale = np.mean(noise**2)  # 3 (n − 3) readings of one unknown variance
        found = root @ rng.standard_normal(3)
        chances.append(wald(found, root @ root.T * scale, 3 * (independent - 3) + 3).p_value)
    assert kstest(chances, "uniform").pvalue > 1e-3


def test_something_there_is_seen() -> None:
    found, covariance = np.array([4.0, 0.0, 0.0]), np.diag([1.0, 9.0, 4.0])
    assert wald(found, covariance, 1e5).statistic == pytest.approx(16.0)
    assert wald(found, covariance, 1e5).p_value == pytest.approx(1.13e-3, rel=0.02)  # χ², 3 numbers
