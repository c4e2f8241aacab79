"""The monitor of two whole compasses: what it finds, what it names, and that it stays quiet."""

import csv

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.monitoring import (
    BLOCK_S,
    MonitorParams,
    derive_monitor_params,
    find_threshold,
)
from agonic.calibration.setup import Compass, Setup
from agonic.errors import AgonicError
from agonic.headings.monitor.baseline import Block, start
from agonic.headings.monitor.detect import advance
from agonic.headings.monitor.watch import CompassReadings, watch_compasses
from tests.command_line import answer
from tests.headings.two_compasses import DIP, FIELD, Fault, average, make_drive

LEVEL, BELOW = FIELD * np.cos(DIP), FIELD * np.sin(DIP)
UNITS = ("magnetometer", "inclinometer")
SIZE = {"magnetometer": 1000.0, "inclinometer": 1.0}


def make_setup(covariance=True) -> Setup:
    spread = np.diag([100.0**2] * 3 + [0.002**2] * 9) if covariance else None
    compasses = tuple(
        Compass(
            calibration=Affine(
                bias=np.zeros(3),
                matrix=np.eye(3),
                noise=50.0,
                sensor=name,
                covariance=spread,
                gauge="free",
                frame_in="m",
                frame_out="b",
            )
        )
        for name in ("mag1", "mag2")
    )
    return Setup(
        compasses=compasses,
        declination_deg=0.0,
        horizontal=LEVEL,
        vertical=BELOW,
        tilt="log",
        tilt_sd_deg=0.3,
    )


PARAMS = derive_monitor_params(make_setup(), FIELD, LEVEL)


def follow(drive):
    """Blocks since a fault (b, v, 2), the compass named (b, v, 2), and what was seen, by block."""
    state = start(PARAMS, drive.field.shape[1:2])
    since, named, seen = [], [], []
    for block in zip(*average(drive, BLOCK_S), strict=True):
        state, told = advance(PARAMS, state, Block(*block))
        since.append(state.since)
        named.append(state.named)
        seen.append(told)
    return np.array(since), np.array(named), seen


def count_named(unit, compass, vehicles, seed, before_s=1500.0):
    """Vehicles whose fault was named right within 60 s, and those with any word that is wrong."""
    fault = Fault(unit, compass, SIZE[unit], before_s)
    drive = make_drive(seed, before_s + 60.0, vehicles, rate_hz=5.0, fault=fault)
    since, named, _ = follow(drive)
    group = UNITS.index(unit)
    first = int(before_s / BLOCK_S)
    early = (since[:first] > 0).any(axis=(0, 2))
    other = (since[:, :, 1 - group] > 0).any(axis=0)
    wrong = (named[:, :, group] == 2 - compass).any(axis=0)
    right = (named[-1, :, group] == compass + 1) & ~early
    return int(right.sum()), int((early | other | wrong).sum())


@pytest.mark.parametrize("compass", [0, 1])
@pytest.mark.parametrize("unit", UNITS)
def test_a_fault_is_named_within_a_minute(unit, compass):
    right, wrong = count_named(unit, compass, 20, seed=20 + compass)
    assert right >= 18
    assert wrong == 0


@pytest.mark.slow
@pytest.mark.parametrize("compass", [0, 1])
@pytest.mark.parametrize("unit", UNITS)
def test_99_of_100_faults_are_named_within_a_minute(unit, compass):
    right, wrong = count_named(unit, compass, 200, seed=40 + compass)
    assert right >= 198
    assert wrong <= 1


def count_false(seed, vehicles, hours):
    since, _, _ = follow(make_drive(seed, hours * 3600.0, vehicles, rate_hz=2.0))
    return int((since > 0).any(axis=0).sum())


def test_manoeuvres_and_iron_that_is_passed_do_not_alarm():
    """20 hours with iron of up to 20 µT, three tenths more at one compass, every ten minutes."""
    assert count_false(1, vehicles=20, hours=1.0) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_1000_hours_are_without_a_false_alarm(seed):
    assert count_false(seed, vehicles=100, hours=2.0) == 0


@pytest.mark.parametrize(("dimensions", "length"), [(3, 8), (2, 16)])
def test_the_threshold_is_crossed_as_rarely_as_it_says(dimensions, length):
    """χ² of moving means of white numbers, against the formula."""
    rate, n, runs = 1e-4, 20_000, 100
    level = find_threshold(dimensions, length, rate)
    white = np.random.default_rng(3).normal(size=(runs, n, dimensions))
    sums = np.cumsum(white, axis=1)
    moving = (sums[:, length:] - sums[:, :-length]) / np.sqrt(length)
    above = (moving**2).sum(axis=-1) > level
    # a crossing is counted once: none in the window before
    crossed = sum(
        len(np.flatnonzero(np.diff(np.flatnonzero(row), prepend=-n) > length)) for row in above
    )
    assert crossed == pytest.approx(rate * n * runs, rel=0.25)


def test_a_change_is_as_large_as_it_says_and_as_old():
    """Error over standard error, of the change and of its beginning."""
    z, began = [], []
    for k, unit in enumerate(UNITS):
        fault = Fault(unit, 0, SIZE[unit], 1200.0 - 45.0)
        seen = follow(make_drive(70 + k, 1200.0, 60, rate_hz=2.0, fault=fault))[2][-1]
        group = UNITS.index(unit)
        planted = SIZE[unit] if group == 0 else np.tan(np.radians(1.0))
        change = seen.change[:, group, : 3 - group]
        # by how much the length differs from what was planted
        off = np.linalg.norm(change, axis=1) - planted
        z.append(off / seen.sd[:, group])
        began.append((seen.began[:, group] - 15.0) / seen.began_sd[:, group])
    for values in z:
        assert abs(np.mean(values)) < 0.5
        assert 0.4 < np.std(values) < 1.5
    assert abs(np.median(np.concatenate(began))) < 1.0


def make_rows(drive) -> CompassReadings:
    return CompassReadings(drive.time, drive.field[:, 0], drive.down[:, 0], FIELD, BELOW)


def test_pieces_tell_what_the_whole_tells():
    rows = make_rows(make_drive(5, 1000.0, fault=Fault("magnetometer", 1, 1000.0, 900.0)))
    whole = watch_compasses(rows, PARAMS, names=("mag1", "mag2"))
    piecewise = None
    for part in np.array_split(np.arange(len(rows.time)), 37):
        some = CompassReadings(rows.time[part], rows.field[part], rows.down[part], FIELD, BELOW)
        piecewise = watch_compasses(some, PARAMS, piecewise, names=("mag1", "mag2"))
    for a, b in zip(whole.state, piecewise.state, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)
    assert [f.sentence for f in whole.faults] == [f.sentence for f in piecewise.faults]
    assert [f.sensor for f in whole.faults] == ["mag2"]


def test_on_one_course_two_disagree_and_none_is_named_without_reason():
    """A change across the field and across down moves neither magnitude nor dip."""
    drive = make_drive(8, 1021.0, straight=True, iron=False)
    heading = np.radians(drive.heading_deg[-1, 0])
    east = 1000.0 * np.array([np.sin(heading), np.cos(heading), 0.0])
    drive.field[drive.time > 1000.0, :, 0] += east
    (fault,) = watch_compasses(make_rows(drive), PARAMS, names=("mag1", "mag2")).faults
    assert fault.unit == "magnetometer"
    assert fault.sensor is None
    assert "other courses" in fault.sentence
    assert fault.size == pytest.approx(1000.0, abs=4 * fault.sd)


def test_a_fault_that_goes_is_over():
    drive = make_drive(9, 1500.0, iron=False)
    during = (drive.time > 1000.0) & (drive.time < 1200.0)
    drive.field[during, :, 1, 2] += 2000.0
    (fault,) = watch_compasses(make_rows(drive), PARAMS, names=("mag1", "mag2")).faults
    assert fault.sensor == "mag2"
    assert fault.began_s == pytest.approx(1000.0, abs=2 * BLOCK_S)
    assert 1200.0 < fault.ended_s < 1270.0


def test_a_setup_with_one_compass_has_no_monitor():
    one = Setup(compasses=make_setup().compasses[:1], declination_deg=0.0)
    with pytest.raises(AgonicError, match="give a setup with two"):
        derive_monitor_params(one, FIELD, LEVEL)


def write_log(path, drive) -> None:
    columns = {"time_s": drive.time}
    for k, name in enumerate(("mag1", "mag2")):
        columns |= {f"{name}_{a}_nT": drive.field[:, 0, k, i] for i, a in enumerate("xyz")}
        x, y, z = drive.down[:, 0, k].T
        columns[f"{name}_roll_deg"] = np.degrees(np.arctan2(y, z))
        columns[f"{name}_pitch_deg"] = np.degrees(np.arctan2(-x, np.hypot(y, z)))
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(columns)
        table.writerows(zip(*(c.round(6) for c in columns.values()), strict=True))


def test_the_command_says_which_compass_is_off(tmp_path, capsys):
    drive = make_drive(12, 1100.0, rate_hz=5.0, fault=Fault("inclinometer", 0, 1.0, 1000.0))
    write_log(tmp_path / "log.csv", drive)
    setup = make_setup()
    ag.save_setup(setup, tmp_path / "setup.toml")
    page = tmp_path / "page.html"
    files = (str(tmp_path / name) for name in ("setup.toml", "log.csv"))
    status, said = answer(
        capsys, "heading", *files, "-o", str(tmp_path / "out.csv"), "--report", str(page)
    )
    assert status == 0
    (fault,) = said["faults"]
    assert (fault["unit"], fault["sensor"], fault["use"]) == ("inclinometer", "mag1", "mag2")
    assert fault["began_s"] == pytest.approx(1000.0, abs=6.0)
    assert fault["named_s"] <= 1060.0
    assert np.hypot(*fault["change"][:2]) == pytest.approx(1.0, abs=4 * fault["sd"])
    assert "the inclinometer of mag1 is off since t = " in page.read_text()


def test_a_false_alarm_once_in_ten_years_needs_a_higher_threshold_than_once_a_day():
    rare = MonitorParams(field=FIELD, horizontal=LEVEL).alarm
    often = MonitorParams(field=FIELD, horizontal=LEVEL, false_alarm_h=24.0).alarm
    assert (rare > often + 10).all()
