"""Rows that are looked at instead of all: even in time, by no pattern, as often as they weigh."""

import numpy as np
import pytest

from agonic.maths.equation.crowding import choose_by_weight, choose_evenly


@pytest.mark.parametrize("n", [25_000, 40_000, 60_000, 1_000_000])
def test_chosen_rows_are_even_in_time_and_keep_no_step_with_a_pattern(n) -> None:
    rows = choose_evenly(n, 20_000)
    assert abs(len(rows) - 20_000) <= 1
    assert np.all(np.diff(rows) > 0)
    by_time = np.bincount(rows * 50 // n, minlength=50) / len(rows)
    np.testing.assert_allclose(by_time, 1 / 50, rtol=0.05)
    for period in (2, 3, 4, 10):
        by_phase = np.bincount(rows % period, minlength=period) / len(rows)
        np.testing.assert_allclose(by_phase, 1 / period, rtol=0.03)


def test_rows_are_chosen_as_often_as_they_weigh() -> None:
    weights = np.repeat([0.02, 0.5, 1.0], [50_000, 4000, 1000])
    rows = choose_by_weight(weights)
    chosen = np.bincount(np.searchsorted([50_000, 54_000], rows, side="right"))
    np.testing.assert_allclose(chosen, [1000, 2000, 1000], rtol=0.02)
