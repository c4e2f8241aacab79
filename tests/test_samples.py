"""`Samples`: validated once, read-only, bad rows counted."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import agonic as ag
from agonic.samples import COLUMNS
from agonic.usable_rows import VECTORS

ROWS = np.arange(12.0).reshape(4, 3)


def every_column(n: int = 4) -> dict[str, np.ndarray]:
    """All columns, each with values of its own."""
    return {
        name: k + (np.arange(3.0 * n).reshape(n, 3) if name in VECTORS else np.arange(float(n)))
        for k, name in enumerate(COLUMNS)
    }


@pytest.mark.parametrize(
    ("unit", "factor"), [("nT", 1), ("uT", 1e3), ("mG", 100), ("Gauss", 1e5), ("counts", 1)]
)
def test_field_is_kept_in_nanotesla_or_raw(unit: str, factor: float) -> None:
    samples = ag.Samples(field=ROWS, unit=unit)
    assert samples.field == pytest.approx(ROWS * factor)
    assert samples.unit == ("raw" if unit == "counts" else "nT")


def test_other_columns_keep_their_own_units() -> None:
    samples = ag.Samples(**every_column(), unit="uT")
    for name, values in every_column().items():
        scale = 1e3 if name in ("field", "second") else 1.0
        assert getattr(samples, name) == pytest.approx(values * scale)


def test_rows_with_nan_in_any_column_are_left_out_and_counted() -> None:
    columns = every_column()
    columns["field"][0, 1] = np.nan
    columns["temperature"][2] = np.inf
    samples = ag.Samples(**columns)
    assert len(samples) == 2
    assert samples.time.tolist() == columns["time"][[1, 3]].tolist()
    assert dict(samples.rejected) == {
        "NaN or infinite field": 1,
        "NaN or infinite temperature": 1,
    }


def test_a_row_is_counted_once() -> None:
    columns = every_column()
    columns["field"][1] = np.nan
    columns["temperature"][1] = np.nan
    assert sum(ag.Samples(**columns).rejected.values()) == 1


def test_times_that_do_not_increase_are_left_out() -> None:
    samples = ag.Samples(field=np.zeros((6, 3)), time=[0.0, 1.0, 1.0, 0.5, 2.0, 1.9])
    assert samples.time.tolist() == [0.0, 1.0, 2.0]
    assert dict(samples.rejected) == {"time does not increase": 3}


def test_a_bad_row_does_not_spoil_the_times_after_it() -> None:
    field = np.zeros((4, 3))
    field[1] = np.nan
    samples = ag.Samples(field=field, time=[0.0, 100.0, 1.0, 2.0])
    assert samples.time.tolist() == [0.0, 1.0, 2.0]


@given(st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=1, max_size=30))
def test_whatever_the_clock_does_times_increase_and_all_rows_are_accounted_for(
    times: list[float],
) -> None:
    if not np.isfinite(times).any():
        times = [*times, 0.0]
    samples = ag.Samples(field=np.zeros((len(times), 3)), time=times)
    assert (np.diff(samples.time) > 0).all()
    assert len(samples) + sum(samples.rejected.values()) == len(times)


def test_nothing_usable_says_why() -> None:
    with pytest.raises(ag.LogError, match=r"no usable readings \(2 rows: NaN or infinite field\)"):
        ag.Samples(field=np.full((2, 3), np.nan))
    with pytest.raises(ag.LogError, match=r"no usable readings \(no rows at all\)"):
        ag.Samples(field=np.empty((0, 3)))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"field": [1.0, 2.0, 3.0]}, r"field has shape \(3,\); it needs \(n, 3\), a row a sample"),
        ({"field": np.zeros((3, 4))}, r"field has shape \(3, 4\)"),
        ({"field": ROWS, "time": np.zeros((4, 1))}, r"time has shape \(4, 1\); it needs \(n,\)"),
        ({"field": ROWS, "acceleration": np.zeros(4)}, r"acceleration has shape \(4,\)"),
        ({"field": ROWS, "time": [0.0, 1.0]}, r"columns differ in length: .*'field': 4"),
        ({"field": [["a", "b", "c"]]}, r"field does not hold numbers"),
        ({"field": [[1.0, 2.0, 3.0], [1.0, 2.0]]}, r"field does not hold numbers"),
    ],
)
def test_wrong_shapes_say_what_is_needed(wrong: dict, said: str) -> None:
    with pytest.raises(ag.LogError, match=said):
        ag.Samples(**wrong)


def test_an_unknown_unit_is_refused() -> None:
    with pytest.raises(ag.UnitError, match="'furlong' is not known"):
        ag.Samples(field=ROWS, unit="furlong")


def test_samples_cannot_be_changed_nor_share_memory_with_what_was_given() -> None:
    given = ROWS.copy()
    samples = ag.Samples(field=given, time=np.arange(4.0))
    given[0, 0] = 99.0
    assert samples.field[0, 0] == 0.0
    for column in samples.columns().values():
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        samples.name = "other"  # type: ignore[misc]
    with pytest.raises(TypeError):
        samples.rejected["x"] = 1  # type: ignore[index]


def test_columns_are_those_that_are_there_in_writing_order() -> None:
    assert list(ag.Samples(field=ROWS, current_A=np.ones(4)).columns()) == ["field", "current_A"]
    assert list(ag.Samples(**every_column()).columns()) == list(COLUMNS)


def test_a_disturber_is_a_column_under_its_own_name() -> None:
    heater = np.array([0.0, 2.0, np.nan, 1.0])
    samples = ag.Samples(field=ROWS, disturbers={"heater_A": heater})
    assert list(samples.columns()) == ["field", "heater_A"]
    assert samples.columns()["heater_A"].tolist() == [0.0, 2.0, 1.0]
    assert samples.rejected == {"NaN or infinite heater_A": 1}
    assert samples.select([2, 0]).disturbers["heater_A"].tolist() == [1.0, 0.0]
    doubled = samples.with_columns(heater_A=2 * samples.disturbers["heater_A"])
    assert doubled.disturbers["heater_A"].tolist() == [0.0, 4.0, 2.0]
    for name in ("heater current", "field", "2_A"):
        with pytest.raises(ag.LogError, match="cannot name a disturber"):
            ag.Samples(field=ROWS, disturbers={name: heater})
    with pytest.raises(ag.LogError, match="a new disturber is given with disturbers="):
        samples.with_columns(torquer_x_Am2=heater)


@pytest.mark.parametrize("rows", [[3, 1], np.array([False, True, False, True])])
def test_select_takes_the_rows_of_every_column(rows: list[int] | np.ndarray) -> None:
    columns = every_column()
    columns.pop("time")
    part = ag.Samples(**columns, unit="uT", name="MAG2").select(rows)
    assert part.name == "MAG2"
    for name, values in columns.items():
        scale = 1e3 if name in ("field", "second") else 1.0
        assert getattr(part, name) == pytest.approx(values[rows] * scale)


def test_select_and_with_columns_remember_what_was_rejected() -> None:
    field = ROWS.copy()
    field[0] = np.nan
    samples = ag.Samples(field=field, unit="uT")
    assert dict(samples.select([0, 1]).rejected) == {"NaN or infinite field": 1}
    again = samples.with_columns(temperature=[20.0, np.nan, 20.0])
    assert dict(again.rejected) == {"NaN or infinite field": 1, "NaN or infinite temperature": 1}
    assert again.field == pytest.approx(field[[1, 3]] * 1e3)


def test_with_columns_knows_its_names() -> None:
    with pytest.raises(ag.LogError, match="no such column: temperature_C"):
        ag.Samples(field=ROWS).with_columns(temperature_C=np.zeros(4))


def test_duration() -> None:
    assert ag.Samples(field=ROWS).duration_s is None
    assert ag.Samples(field=ROWS, time=[1.0, 2.0, 3.5, 6.0]).duration_s == 5.0


def test_what_may_still_change_is_copied():
    """Only an array that is read-only, and no view of another, is taken as it is."""
    own = np.random.default_rng(2).normal(0.0, 30.0, (5, 3))
    view = own.view()
    view.flags.writeable = False
    constant = own.copy()
    constant.flags.writeable = False
    one, other, third = (ag.Samples(field=f, unit="nT") for f in (own, view, constant))
    kept = own.copy()
    own[:] = 0.0
    for samples in (one, other, third):
        np.testing.assert_array_equal(samples.field, kept)
        assert not samples.field.flags.writeable
    assert np.shares_memory(third.field, constant)
    assert np.shares_memory(third.with_columns(name="left").field, third.field)
