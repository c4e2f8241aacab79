"""Times as files write them."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.logs.clocks.clock import read_clock, spread_ties
from agonic.logs.read import open_log

START = datetime(2026, 3, 1, 12, 0, 0, tzinfo=UTC)
OFFSETS = np.array([0.25, 0.5, 1.75])


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("unit_s", [1, 1e-3, 1e-6, 1e-9])
def test_unix_times_in_any_unit(named, unit_s):
    values = (START.timestamp() + OFFSETS) / unit_s
    time, epoch, _ = read_clock(values, unit_s if named else None)
    assert epoch == START
    np.testing.assert_allclose(time, OFFSETS, atol=1e-6)


@pytest.mark.parametrize(
    "form",
    [
        "2026-03-01T12:00:0{}Z",
        "2026-03-01 12:00:0{}",
        "2026/03/01 12:00:0{}",
        "2026-03-01T14:00:0{}+02:00",
        '"2026-03-01T12:00:0{}"',
    ],
)
def test_date_times(form):
    texts = np.array([form.format(t) for t in OFFSETS] + ["?"], dtype=object)
    time, epoch, notes = read_clock(texts, None)
    assert epoch == START
    np.testing.assert_allclose(time, [*OFFSETS, np.nan], atol=1e-9)
    assert ("zone" in " ".join(notes)) == ("Z" not in form and "+" not in form)


def test_moments_of_a_table_with_types():
    values = np.array(["2026-03-01T12:00:00.25", "NaT"], dtype="datetime64[ns]")
    time, epoch, _ = read_clock(values, None)
    assert epoch == START
    np.testing.assert_allclose(time, [0.25, np.nan])


def test_times_of_day_go_on_after_midnight():
    time, epoch, _ = read_clock(np.array(["23:59:59.5", "23:59:59.9", "00:00:00.3"]), None)
    assert epoch is None
    np.testing.assert_allclose(np.diff(time), [0.4, 0.4], atol=1e-9)


def test_seconds_since_power_on_stay_as_they_are():
    time, epoch, notes = read_clock(np.array([3.0, 3.02, 3.04]), 1)
    assert time.tolist() == [3.0, 3.02, 3.04]
    assert (epoch, notes) == (None, ())


def test_a_clock_without_unit_is_not_guessed():
    microseconds = 1.2e9 + 20_000.0 * np.arange(5)  # as large as Unix seconds, but in huge steps
    time, epoch, notes = read_clock(microseconds, None)
    assert (time, epoch) == (None, None)
    assert "time_us" in notes[0]


def test_unreadable_times_are_left_out_with_an_example():
    time, _, notes = read_clock(np.array(["yesterday", "today"]), None)
    assert time is None
    assert "'yesterday'" in notes[0]


def test_a_coarse_clock_is_spread_to_the_true_rate():
    rng = np.random.default_rng(1)
    true = 100 + np.arange(500) / 50
    time, notes = spread_ties(np.floor(true), rng.normal(size=(500, 3)))
    np.testing.assert_allclose(time, true, atol=1e-9)
    assert "50 rows" in notes[0]


def test_a_pause_is_not_filled_with_times():
    coarse = np.repeat([0.0, 1.0, 2.0, 600.0, 601.0], 10)
    time, _ = spread_ties(coarse, np.arange(150.0).reshape(50, 3))
    assert time[29] < 3.0
    assert time[30] == 600.0


def test_repeated_rows_and_single_ties_are_left_alone():
    field = np.repeat(np.arange(300.0).reshape(100, 3), 2, axis=0)
    repeated = np.repeat(np.arange(100.0), 2)
    assert spread_ties(repeated, field)[0] is repeated
    single = np.append(np.arange(1000.0), 999.0)
    assert spread_ties(single, np.arange(3003.0).reshape(-1, 3))[0] is single


def test_letters_of_a_zone_cost_no_time():
    """CET is one zone; CST is that of America and that of China."""
    said = "times name the zone CST, which stands for several: taken as UTC"
    for zone, hour, told in (("CET", 11, ()), ("(EST)", 17, ()), ("CST", 12, (said,))):
        texts = np.array([f"2026-03-01 12:00:0{k}.5 {zone}" for k in range(5)], dtype=object)
        time, epoch, notes = read_clock(texts, None)
        np.testing.assert_allclose(time, np.arange(5) + 0.5)
        assert epoch == datetime(2026, 3, 1, hour, tzinfo=UTC)
        assert notes == told


@pytest.mark.parametrize(
    ("begins", "believed"),
    [
        ("0", False),
        ("315964800.0", False),
        ("1740988800", True),
        ("9e11", False),
    ],
)
def test_date_of_a_clock_that_was_never_set_is_left_out(tmp_path, begins, believed):
    path = tmp_path / "log.csv"
    rows = "".join(f"{k},{k},2,3,{begins}\n" for k in range(3))
    path.write_text("time_s,mag_x_nT,mag_y_nT,mag_z_nT,epoch_unix_s\n" + rows)
    [samples] = open_log(path).sensors
    assert (samples.epoch is not None) == believed
    assert any("no date" in note for note in samples.notes) != believed
    assert samples.time.tolist() == [0.0, 1.0, 2.0]
