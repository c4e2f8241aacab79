"""Polynomials in scaled temperature: values, derivatives, weighted fits, the choice of order."""

import numpy as np
import pytest

from agonic.maths.equation import polynomial as kernel


def test_scaled_powers_are_those_of_numpy() -> None:
    rng = np.random.default_rng(0)
    t, k = rng.uniform(-10, 50, 20), rng.normal(size=4)
    x = kernel.scale(t, 20.0, 30.0)
    assert kernel.powers(x, 3) @ k == pytest.approx(np.polyval(k[::-1], (t - 20.0) / 30.0))


@pytest.mark.parametrize("times", [1, 2])
def test_derivatives_are_those_of_numpy(times: int) -> None:
    x, k = np.linspace(-1, 1, 7), np.array([1.0, -2.0, 3.0, 0.5, -0.2])
    expected = np.polynomial.Polynomial(k).deriv(times)(x)
    assert kernel.derivative(x, 4, times) @ k == pytest.approx(expected)


def test_the_mean_over_a_bin_is_not_the_value_at_its_mean() -> None:
    """A bias of 20 µT curved over 60 °C, readings evenly over a bin of 2 °C."""
    k = np.array([0.0, 0.0, 20_000.0, -9000.0])
    t = 40.0 + np.linspace(-1.0, 1.0, 2001)
    x = kernel.scale(t, 20.0, 30.0)
    mean = float((kernel.powers(x, 3) @ k).mean())
    at_mean = float(kernel.powers(x.mean(), 3) @ k)
    to_second_order = float(kernel.mean_powers(x.mean(), x.var(), 3) @ k)
    assert abs(mean - at_mean) > 0.5
    assert to_second_order == pytest.approx(mean, abs=1e-4)


def test_a_weighted_fit_is_that_of_numpy_with_its_covariance() -> None:
    rng = np.random.default_rng(1)
    x, sd = np.linspace(-1, 1, 40), rng.uniform(0.5, 3.0, 40)
    y = 5 - 2 * x + 7 * x**3 + sd * rng.normal(size=40)
    k, covariance = np.polyfit(x, y, 3, w=1 / sd, cov="unscaled")
    found = kernel.fit_polynomial(x, y, sd, 3)
    assert found.coefficients == pytest.approx(k[::-1], rel=1e-9)
    assert found.covariance == pytest.approx(covariance[::-1, ::-1], rel=1e-8)
    assert found.variance == pytest.approx(1.0, abs=4 * np.sqrt(2 / 36))


def test_its_band_holds_the_truth() -> None:
    rng = np.random.default_rng(2)
    x, at = np.linspace(-1, 1, 30), np.linspace(-1, 1, 11)
    truth = 1 + x - x**2
    z = []
    for _ in range(300):
        found = kernel.fit_polynomial(x, truth + 0.1 * rng.normal(size=30), np.full(30, 0.1), 2)
        z.append((found.at(at) - (1 + at - at**2)) / found.sd_at(at))
    assert np.sqrt(np.mean(np.square(z), axis=0)) == pytest.approx(np.ones(11), abs=0.15)


@pytest.mark.parametrize("order", [0, 1, 3])
def test_the_order_that_made_the_values_is_chosen(order: int) -> None:
    chosen = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = np.linspace(-1, 1, 120)
        curves = 20 * x[:, None] ** order * np.ones(9)
        noisy = curves + rng.normal(size=(120, 9))
        chosen.append(
            kernel.choose_order(kernel.compute_variances(x, noisy, np.ones((120, 9)), 5), 120)
        )
    assert chosen.count(order) >= 18


def test_too_few_values_leave_nothing_to_judge_by() -> None:
    x = np.linspace(-1, 1, 4)
    assert np.isnan(kernel.fit_polynomial(x, x, np.ones(4), 3).variance)
    assert kernel.choose_order(kernel.compute_variances(x, x[:, None], np.ones((4, 1)), 5), 4) <= 1
