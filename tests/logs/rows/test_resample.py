"""Bringing columns onto the rows of the magnetometer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.logs.log import compute_rate_Hz
from agonic.logs.rows.auxiliary import find_misplaced, resample

TIMES = np.linspace(0.0, 10.0, 101)


def test_a_straight_line_is_kept_and_the_ends_hold() -> None:
    wanted = np.array([-5.0, 0.03, 7.77, 20.0])
    got = resample(TIMES, 3.0 * TIMES - 1.0, wanted)
    np.testing.assert_allclose(got, 3.0 * np.clip(wanted, 0.0, 10.0) - 1.0)


def test_each_component_of_a_vector_is_interpolated() -> None:
    wanted = np.array([1.05, 9.99])
    got = resample(TIMES, np.stack([TIMES, -TIMES, 2 * TIMES], axis=1), wanted)
    np.testing.assert_allclose(got, np.stack([wanted, -wanted, 2 * wanted], axis=1))


@given(rate=st.floats(-150.0, 150.0), start=st.floats(0.0, 359.9))
def test_a_steady_turn_is_followed_through_north(rate: float, start: float) -> None:
    """At 1 Hz any turn below 180 deg a second has one shortest way."""
    t = np.arange(0.0, 20.0)
    wanted = np.linspace(0.0, 19.0, 77)
    got = resample(t, (start + rate * t) % 360.0, wanted, period=360.0)
    assert got is not None
    error = (got - (start + rate * wanted) + 180.0) % 360.0 - 180.0
    assert np.abs(error).max() < 1e-9
    assert (got >= 0.0).all()
    assert (got <= 360.0).all()


def test_angles_keep_the_range_they_came_in() -> None:
    rolled = resample([0.0, 1.0], [175.0, -175.0], [0.25, 0.75], period=360.0)
    np.testing.assert_allclose(rolled, [177.5, -177.5])
    turned = resample([0.0, 1.0], [350.0, 20.0], [0.25, 0.75], period=360.0)
    np.testing.assert_allclose(turned, [357.5, 12.5])


def test_rows_that_are_not_finite_or_out_of_order_do_no_harm() -> None:
    t = np.array([0.0, 2.0, 1.0, np.nan, 3.0, 4.0])
    got = resample(t, [0.0, 20.0, 10.0, 99.0, np.nan, 40.0], [0.5, 1.5, 3.0])
    np.testing.assert_allclose(got, [5.0, 15.0, 30.0])
    assert resample([0.0, 1.0], [np.nan, np.inf], [0.5]) is None


@given(st.lists(st.floats(0.0, 1e6), min_size=3, max_size=40))
def test_times_in_order_are_never_misplaced(steps: list[float]) -> None:
    assert not find_misplaced(np.cumsum(steps)).any()


@given(
    row=st.integers(1, 48),
    wrong=st.one_of(st.floats(-1e12, -1.0), st.floats(60.0, 1e12)),
)
def test_one_damaged_time_is_found_and_no_other(row: int, wrong: float) -> None:
    t = np.arange(50.0)
    t[row] = wrong
    assert np.flatnonzero(find_misplaced(t)).tolist() == [row]


@pytest.mark.parametrize("row", [0, 20, 49])
def test_a_time_centuries_away_is_damage_on_any_row(row: int) -> None:
    t = np.arange(50.0)
    t[row] = 1e308
    assert np.flatnonzero(find_misplaced(t)).tolist() == [row]


def test_a_first_time_from_before_the_clock_was_set_costs_one_row() -> None:
    t = np.arange(50.0)
    t[0] = 1e9
    assert np.flatnonzero(find_misplaced(t)).tolist() == [0]


def test_a_jump_of_the_clock_is_no_damage() -> None:
    assert not find_misplaced([0.0, 1.0, 2.0, 1000.0, 1001.0]).any()


@pytest.mark.parametrize(
    ("time", "rate"), [(np.arange(101) / 50.0, 50.0), ([3.0], None), ([2.0, 2.0], None)]
)
def test_rate(time: list[float], rate: float | None) -> None:
    assert compute_rate_Hz(time) == (None if rate is None else pytest.approx(rate))
