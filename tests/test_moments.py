"""`Moments`: the same whatever way the readings came in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import agonic as ag
from agonic.simulation import simulate

READINGS = simulate("tumble", n=1000).samples.field


def fitted(sums: ag.Moments) -> np.ndarray:
    return np.array(
        ag.fit_moments(sums, ag.Reference.constant(50_000), model="full").calibration.bias
    )


@settings(max_examples=20)
@given(st.sets(st.integers(1, 999), max_size=4))
def test_the_whole_is_the_sum_of_its_parts(cuts: set[int]) -> None:
    parts = np.split(READINGS, sorted(cuts))
    each_about_its_own = sum(map(ag.Moments.of, parts[1:]), start=ag.Moments.of(parts[0]))
    assert each_about_its_own.count == 1000
    whole = ag.Moments.of(READINGS)
    moved = each_about_its_own.rebase(whole.centre, whole.scale)
    assert moved.sums == pytest.approx(whole.sums, rel=1e-6, abs=1e-3)


def test_a_fit_does_not_care_how_the_readings_came_in() -> None:
    whole = ag.Moments.of(READINGS)
    added = ag.Moments.of(READINGS[:10]).add(READINGS[10:400]) + ag.Moments.of(READINGS[400:])
    assert added.count == whole.count == 1000
    assert fitted(added) == pytest.approx(fitted(whole), abs=0.01)  # nT
    elsewhere = whole.rebase([1e4, -2e4, 3e4], 1e5)
    assert fitted(elsewhere) == pytest.approx(fitted(whole), abs=0.01)


def test_order_of_the_addends_does_not_matter() -> None:
    one, two = ag.Moments.of(READINGS[:300]), ag.Moments.of(READINGS[300:])
    assert fitted(one + two) == pytest.approx(fitted(two + one), abs=0.01)


def test_bytes_hold_everything() -> None:
    sums = ag.Moments.of(READINGS, unit="raw")
    data = sums.to_bytes()
    again = ag.Moments.from_bytes(data)
    assert len(data) == 324
    assert again.unit == "raw"
    assert again.scale == sums.scale
    assert np.array_equal(again.centre, sums.centre)
    assert np.array_equal(again.sums, sums.sums)
    assert again.to_bytes() == data


@pytest.mark.parametrize(
    "data", [b"", b"AGM1", b"X" * 324, ag.Moments.of(READINGS).to_bytes()[:-1]]
)
def test_other_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(ag.AgonicError, match="are not moments written by to_bytes"):
        ag.Moments.from_bytes(data)


@pytest.mark.parametrize(
    "readings", [[1.0, 2.0, 3.0], np.empty((0, 3)), [[1.0, 2.0, np.nan]], np.zeros((3, 2))]
)
def test_readings_must_be_finite_rows(readings) -> None:
    with pytest.raises(ag.AgonicError, match="moments need"):
        ag.Moments.of(readings)


def test_units_do_not_mix() -> None:
    with pytest.raises(ag.AgonicError, match="moments in nT and raw cannot be added"):
        ag.Moments.of(READINGS) + ag.Moments.of(READINGS, unit="raw")


def test_readings_that_are_all_the_same_have_a_scale_all_the_same() -> None:
    sums = ag.Moments.of(np.ones((5, 3)))
    assert sums.scale == 1.0
    assert sums.centre == pytest.approx([1.0, 1.0, 1.0])
