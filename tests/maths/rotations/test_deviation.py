"""The deviation curve, its inverse and the eight-heading formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.maths.rotations import deviation as kernel

HANDBOOK = np.array([10.5, 20.0, 11.5, -1.2, -5.5, -8.0, -12.5, -6.8])
"""Deviations at the eight headings, Handbook of Magnetic Compass Adjustment, figure 501."""

CIRCLE = np.arange(0.0, 360.0, 7.0)
angles = st.floats(-720, 720)


def test_handbook_by_the_eight_heading_formulas() -> None:
    assert kernel.solve_eight_headings(HANDBOOK) == pytest.approx(
        [1.0, 12.0, 8.0, 5.0, 1.5], abs=1e-12
    )


def test_handbook_by_least_squares() -> None:
    rows = kernel.basis(kernel.ROSE_DEG)[:, :5]
    solved = kernel.solve(rows, HANDBOOK, robust=False)
    assert solved.params == pytest.approx([1.000, 11.9397, 7.9598, 5.000, 1.500], abs=1e-4)
    assert np.sqrt(np.mean(solved.residuals**2)) == pytest.approx(0.051, abs=5e-4)
    # eight equal steps are orthogonal: s²/8 for A and s²/4 for the others, s² with 8 − 5 freedoms
    s = np.sqrt(solved.residuals @ solved.residuals / 3)
    assert solved.noise == pytest.approx(s, rel=1e-6)
    expected = s * np.sqrt([1 / 8, 1 / 4, 1 / 4, 1 / 4, 1 / 4])
    assert np.sqrt(np.diag(solved.covariance)) == pytest.approx(expected, rel=1e-4)


def test_least_squares_is_that_of_numpy_on_uneven_headings() -> None:
    rng = np.random.default_rng(0)
    rows = kernel.basis(rng.uniform(0, 360, 40), rng.uniform(-20, 20, 40))[:, :7]
    difference = rng.normal(scale=5, size=40)
    expected = np.linalg.lstsq(rows, difference, rcond=None)[0]
    # the prior of a full turn pulls by less than a ten-thousandth of a degree
    assert kernel.solve(rows, difference, robust=False).params == pytest.approx(expected, abs=1e-4)


def test_differences_that_straddle_half_a_turn_are_one_difference() -> None:
    rows = kernel.basis(kernel.ROSE_DEG)[:, :5]
    solved = kernel.solve(rows, kernel.wrap_deg(HANDBOOK + 177.0), robust=False)
    assert solved.params[0] == pytest.approx(178.0, abs=1e-4)
    assert solved.params[1:] == pytest.approx([11.9397, 7.9598, 5.0, 1.5], abs=1e-4)


def test_slope_is_the_derivative_of_the_curve() -> None:
    coefficients = np.array([3.0, -20.0, 11.0, 4.0, -6.0, -0.3, 0.2, 0.1, 0.4])
    step, roll, pitch = 1e-4, 12.0, -7.0
    after, before = (kernel.basis(CIRCLE + d, roll, pitch) @ coefficients for d in (step, -step))
    assert kernel.slope(coefficients, CIRCLE, roll, pitch) == pytest.approx(
        (after - before) / (2 * step), abs=1e-7
    )


@given(st.lists(st.floats(-12, 12), min_size=5, max_size=5), angles, st.floats(-30, 30))
def test_steering_the_compass_heading_makes_good_the_magnetic_one(level, magnetic, roll) -> None:
    coefficients = np.array([*level, -0.08, 0.03, 0.01, -0.02])
    compass = kernel.steer(coefficients, magnetic, roll, 5.0)
    made_good = compass + kernel.basis(compass, roll, 5.0) @ coefficients
    assert 0 <= compass < 360
    assert float(kernel.wrap_deg(made_good - magnetic)) == pytest.approx(0.0, abs=1e-9)


def test_a_compass_that_turns_back_still_gives_a_heading_that_fits() -> None:
    coefficients = np.array([0.0, 80.0, 0, 0, 0, 0, 0, 0, 0])  # dδ/dψ = −1.4 at south
    compass = kernel.steer(coefficients, CIRCLE, 0.0, 0.0)
    made_good = compass + kernel.basis(compass) @ coefficients
    assert np.abs(kernel.wrap_deg(made_good - CIRCLE)).max() < 1e-9


def test_a_heading_is_on_the_rose_only_where_all_eight_were_steered() -> None:
    near = kernel.ROSE_DEG + 1.5
    assert kernel.average_on_rose(near, HANDBOOK) == pytest.approx(HANDBOOK)
    assert kernel.average_on_rose(near[:7], HANDBOOK[:7]) is None
    assert kernel.average_on_rose(kernel.ROSE_DEG + np.array([5.0, *7 * [0.0]]), HANDBOOK) is None


@given(angles)
def test_wrapped_angles_are_the_same_angle(angle: float) -> None:
    wrapped = float(kernel.wrap_deg(angle))
    assert -180 <= wrapped < 180
    assert np.cos(np.radians(wrapped - angle)) == pytest.approx(1.0, abs=1e-12)
