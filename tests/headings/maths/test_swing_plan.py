"""What headings leave open, and which to add."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agonic.headings.maths import swing_plan
from agonic.maths.rotations.deviation import ROSE_DEG, basis

ALL = np.ones(5, dtype=bool)


@pytest.mark.parametrize("n", [6, 8, 12, 36])
def test_headings_evenly_spread_are_the_best(n: int) -> None:
    headings = 360.0 / n * np.arange(n)
    assert swing_plan.compute_amplification(headings, ALL) == pytest.approx(1.0)
    assert swing_plan.compute_unit_sd(headings, ALL) == pytest.approx(np.sqrt(5 / n))


def test_unit_sd_is_what_the_inverse_of_the_normal_matrix_says() -> None:
    headings = np.array([3.0, 40, 77, 130, 201, 244, 290])
    rows, at = basis(headings)[:, :5], basis(np.array([15.0, 333.0]))[:, :5]
    expected = np.sqrt(np.diag(at @ np.linalg.inv(rows.T @ rows) @ at.T))
    assert swing_plan.compute_unit_sd(headings, ALL, np.array([15.0, 333.0])) == pytest.approx(
        expected
    )


def test_cardinal_headings_leave_open_d_alone() -> None:
    cardinal = np.array([0.0, 90.0, 180.0, 270.0])
    assert np.isinf(swing_plan.compute_amplification(cardinal, ALL))
    assert np.isfinite(
        swing_plan.compute_amplification(cardinal, np.array([1, 1, 1, 0, 1], dtype=bool))
    )
    known = swing_plan.compute_unit_sd(cardinal, ALL, cardinal)  # sin 2ψ is 0 there, whatever D is
    assert known == pytest.approx(1.0)


@given(st.lists(st.floats(0, 360, exclude_max=True), min_size=1, max_size=20))
@settings(max_examples=60)
def test_the_headings_to_add_determine_the_curve(headings: list[float]) -> None:
    seen = swing_plan.find_visited(np.array(headings))
    added = swing_plan.find_missing_deg(seen, ALL, 2.0)
    together = np.append(seen, added)
    assert swing_plan.compute_amplification(together, ALL) <= 2.0
    assert swing_plan.compute_largest_gap_deg(together) <= 90.0
    assert not len(added) or np.abs((added[:, None] - seen + 180) % 360 - 180).min() > 11.0


def test_nothing_is_missing_from_eight_headings() -> None:
    assert len(swing_plan.find_missing_deg(ROSE_DEG, ALL, 2.0)) == 0


def test_visited_counts_a_heading_once_however_often_it_was_read() -> None:
    assert swing_plan.find_visited(np.array([12.0, 12.5, 13.0, 359.9, -0.1])) == pytest.approx(
        [12.5, 359.9]
    )
