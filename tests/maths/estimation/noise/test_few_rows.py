"""Noise with memory in few rows: errors of a fit over what is stated, against known noise."""

import numpy as np
import pytest
from scipy.signal import lfilter

from agonic.maths.estimation.noise.few_rows import scatter_of_few


@pytest.mark.slow
@pytest.mark.parametrize(("memory", "least", "most"), [(0.9, 0.6, 1.6), (0.0, 0.6, 1.05)])
def test_few_rows_state_what_noise_with_memory_may_have_done(memory, least, most) -> None:
    n, over, white = 40, [], []
    t = np.linspace(0, 2 * np.pi, n)
    jacobian = np.stack([np.ones(n), *(f(k * t) for k in (1, 2) for f in (np.sin, np.cos))], axis=1)
    information = jacobian.T @ jacobian
    for seed in range(300):
        noise = np.random.default_rng(seed).normal(size=n + 200)
        noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise)[200:]
        error = np.linalg.solve(information, jacobian.T @ noise)
        residuals = noise - jacobian @ error
        scatter = scatter_of_few(residuals, jacobian)
        stated = np.diag(np.linalg.solve(information, np.linalg.solve(information, scatter).T))
        over.append(error[1:] / np.sqrt(stated[1:]))
        plain = np.diag(np.linalg.inv(information)) * (residuals @ residuals) / (n - 5)
        white.append(error[1:] / np.sqrt(plain[1:]))
    assert least < np.std(over) < most
    if memory:
        assert np.std(white) > 1.4 * np.std(over)


def test_the_scatter_of_long_white_noise_is_the_information() -> None:
    rng = np.random.default_rng(1)
    jacobian = rng.normal(size=(150, 3))
    noise = rng.normal(size=150)
    residuals = noise - jacobian @ np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    square = residuals @ residuals / (150 - 3)
    scatter = scatter_of_few(residuals, jacobian)
    np.testing.assert_allclose(scatter, square * jacobian.T @ jacobian, rtol=0.3, atol=15)


def test_residuals_of_nothing_have_no_scatter() -> None:
    assert not scatter_of_few(np.zeros(30), np.ones((30, 1))).any()
