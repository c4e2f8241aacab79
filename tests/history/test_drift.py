"""What a sensor's history tells: drift with bands, steps, a last one that does not belong."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from agonic.errors import AgonicError
from agonic.history.departure import find_drifting
from agonic.history.document import describe_drift
from agonic.history.fit import drift
from agonic.history.result import YEAR_S
from agonic.population import Population, Row
from agonic.population.store import History
from agonic.population.store_schema import UNDATED

START = datetime(2024, 1, 1, tzinfo=UTC)


def rows_of(
    n: int = 20,
    seed: int = 0,
    *,
    sensor: str = "7",
    slope: float = 0.0,
    scatter: float = 20.0,
    moved: np.ndarray | None = None,
    **more: object,
) -> list[Row]:
    """A calibration a month with a formal error of 5 nT; `slope` of bias z in nT a year."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(n):
        start = START + timedelta(days=30.4375 * k + float(rng.uniform(-5, 5)))
        years = (start - START).total_seconds() / YEAR_S
        bias = np.array([100.0, -200.0, 300.0 + slope * years])
        bias += rng.normal(0, np.hypot(5.0, scatter), 3) + (0 if moved is None else moved[k])
        gain = 1.0 + rng.normal(0, 1e-3, 3)
        made.append(
            Row(
                sensor=sensor,
                source=f"{sensor}-{k:02d}.csv",
                sha256=f"{sensor}{k}",
                verdict="good",
                status="",
                start=start,
                rows=300,
                unit_in="nT",
                unit_out="nT",
                gauge="symmetric",
                model="diagonal",
                bias_x=bias[0],
                bias_y=bias[1],
                bias_z=bias[2],
                bias_x_sd=5.0,
                bias_y_sd=5.0,
                bias_z_sd=5.0,
                matrix_xx=gain[0],
                matrix_yy=gain[1],
                matrix_zz=gain[2],
                matrix_xx_sd=1e-3,
                matrix_yy_sd=1e-3,
                matrix_zz_sd=1e-3,
                matrix_xy=0.0,
                matrix_xz=0.0,
                matrix_yz=0.0,
                matrix_yx=0.0,
                matrix_zx=0.0,
                matrix_zy=0.0,
            )
        )
    return [replace(row, **more) for row in made]


def in_order(rows: list[Row]) -> Population:
    """As `History.of` gives them: of one name their sources are in order of time here."""
    return Population.of(rows)


AT = START + timedelta(days=700)


def names(found) -> list[str]:
    return [finding.name for finding in found.findings]


def test_drift_is_found_with_its_error_and_its_band() -> None:
    found = drift(in_order(rows_of(slope=-300.0)), AT)
    assert (found.verdict, names(found)) == ("good", ["drifting"])
    assert "bias z by -" in found.findings[0].what
    one = found.trend("bias z")
    assert abs(one.slope + 300.0) < 3 * one.slope_sd < 150.0
    assert found.trend("bias x").p_value > 0.01
    assert 8.0 < one.scatter < 40.0
    expected = 300.0 - 300.0 * 700 / 365.25
    band = one.at(np.array([AT.timestamp()]))
    assert abs(band.mean[0] - expected) < 3 * band.sd[0] < 150.0
    later = one.at(np.array([AT.timestamp() + YEAR_S]))
    assert later.sd[0] > 2 * band.sd[0]
    assert band.calibration_sd[0] > np.hypot(band.sd[0], 5.0)


@pytest.mark.slow
def test_next_calibration_falls_into_its_band_as_often_as_it_says() -> None:
    z = []
    for seed in range(40):
        rows = rows_of(13, seed, slope=200.0)
        known, new = drift(in_order(rows[:-1]), AT), rows[-1]
        assert new.start is not None
        for axis in "xyz":
            band = known.trend(f"bias {axis}").at(np.array([new.start.timestamp()]))
            z.append((getattr(new, f"bias_{axis}") - band.mean[0]) / band.calibration_sd[0])
    assert abs(np.mean(z)) < 0.2
    assert 0.7 < np.std(z) < 1.15
    assert np.mean(np.abs(z) < 2) > 0.92


def test_step_is_told_with_its_dates_and_sizes() -> None:
    moved = np.outer(np.arange(20) >= 11, [400.0, 0.0, -250.0])
    found = drift(in_order(rows_of(seed=3, moved=moved)), AT)
    assert (found.verdict, names(found)) == ("good", ["step"])
    [event] = found.events
    assert (event.kind, event.place) == ("step", 11)
    assert event.after < START + timedelta(days=11 * 30.4375) < event.before + timedelta(days=10)
    sizes = {one.name: one for one in event.parameters}
    assert set(sizes) == {"bias x", "bias z"}
    assert abs(sizes["bias x"].size - 400.0) < 4 * sizes["bias x"].sd < 200.0
    assert abs(sizes["bias z"].size + 250.0) < 4 * sizes["bias z"].sd < 200.0
    # the drift has the step taken out, and knows where the sensor is now
    assert abs(found.trend("bias x").slope) < 3 * found.trend("bias x").slope_sd
    assert found.trend("bias x").at(np.array([AT.timestamp()])).mean[0] == pytest.approx(
        500, abs=60
    )


def test_fresh_step_and_last_one_off_its_band_are_checks() -> None:
    two = np.outer(np.arange(20) >= 18, [500.0, 500.0, 500.0])
    assert drift(in_order(rows_of(seed=1, moved=two)), AT).verdict == "check"
    last = np.outer(np.arange(20) >= 19, [0.0, 500.0, 0.0])
    found = drift(in_order(rows_of(seed=1, moved=last)), AT)
    assert (found.verdict, names(found)) == ("check", ["left its band"])
    assert "bias y by +" in found.findings[0].what
    # where the sensor is, is not told by the one that is off
    assert found.trend("bias y").at(np.array([AT.timestamp()])).mean[0] == pytest.approx(
        -200, abs=60
    )


@pytest.mark.parametrize("n", [5, 6, 7])
def test_last_of_few_is_told_where_it_is_far_off(n: int) -> None:
    """Too few for steps, yet the newest is held against those before it."""
    last = np.outer(np.arange(n) == n - 1, [0.0, 0.0, 30_000.0])
    for seed in range(8):
        found = drift(in_order(rows_of(n, seed, moved=last)), AT)
        assert (found.verdict, names(found)) == ("check", ["left its band"])
        assert [one.name for one in found.events[0].parameters] == ["bias z"]
        assert drift(in_order(rows_of(n, seed)), AT).verdict == "good"


def test_bias_without_bounds_takes_no_part_and_dates_are_needed() -> None:
    rows = rows_of(10)
    wild = [*rows[:3], replace(rows[3], bias_x=1e9, bias_x_sd=np.inf), *rows[4:]]
    found = drift(in_order(wild), AT)
    assert found.compared.tolist() == [0, 1, 2, *range(4, 10)]
    assert "not compared" in names(found)
    with pytest.raises(AgonicError, match="no date"):
        drift(in_order([*rows[:3], replace(rows[3], start=None), *rows[4:]]), AT)


def test_stray_is_left_out_and_is_no_step() -> None:
    moved = np.outer(np.arange(20) == 8, [900.0, 900.0, 0.0])
    found = drift(in_order(rows_of(seed=2, moved=moved)), AT)
    assert (found.verdict, names(found)) == ("good", ["outlying calibration"])
    assert found.events[0].place == 8
    assert found.trend("bias x").scatter < 40.0


def test_refused_and_other_units_take_no_part() -> None:
    rows = rows_of(10)
    rows[2] = replace(rows[2], unit_in="raw")
    rows.append(replace(rows[-1], source="8-99.csv", verdict="refused", bias_x=None))
    found = drift(in_order(rows), AT)
    assert found.compared.tolist() == [0, 1, *range(3, 10)]
    assert found.verdict == "check"
    assert names(found)[0] == "last one refused"
    assert "not compared" in names(found)


def test_few_calibrations_are_said_to_be_few() -> None:
    found = drift(in_order(rows_of(3)), AT)
    assert (found.verdict, names(found), found.trends) == ("good", ["few calibrations"], ())
    undated = drift(in_order(rows_of(6, findings=(UNDATED.name,))), AT)
    assert UNDATED.name in names(undated)
    same_day = drift(in_order(rows_of(6, start=START)), AT)
    assert same_day.trends == ()
    with pytest.raises(AgonicError, match="no calibration"):
        drift(Population.of([]))
    with pytest.raises(AgonicError, match="before the first"):
        drift(in_order(rows_of(6)), START - timedelta(days=9))


def test_matrices_that_stand_still_have_no_trend() -> None:
    found = drift(in_order(rows_of(8)), AT)  # a diagonal model knows nothing between the axes
    assert {one.name[:4] for one in found.trends} == {"bias", "gain"}


def test_calibration_without_gains_does_not_hide_a_step_of_the_gain() -> None:
    stepped = [
        replace(row, matrix_xx=row.matrix_xx + (0.01 if k >= 10 else 0.0))
        for k, row in enumerate(rows_of(20, seed=1))
    ]
    bare = {f"matrix_{axis}{end}": None for axis in ("xx", "yy", "zz") for end in ("", "_sd")}
    stepped[3] = replace(stepped[3], model="sphere", **bare)
    found = drift(in_order(stepped[::-1]), AT)
    assert [moved.name for event in found.events for moved in event.parameters] == ["gain x"]
    assert re.search(r"\bnan\b", describe_drift(found).to_html()) is None


@pytest.mark.slow
def test_many_sensors_are_judged_as_one_is(tmp_path) -> None:
    with History.open(tmp_path / "boards.sqlite") as history:
        for number in range(24):
            slope = 3000.0 if number % 10 == 0 else 0.0
            history.add(rows_of(8 + number % 4, number, sensor=f"s{number:02d}", slope=slope))
        history.add(rows_of(2, sensor="short"))
        counted = []
        found = find_drifting(history, lambda done, of: counted.append((done, of)))
        assert counted[-1][0] == counted[-1][1]
        for number in range(24):
            sensor = f"s{number:02d}"
            alone = drift(history.of(sensor), AT)
            least = min(alone.trend(f"bias {axis}").p_value for axis in "xyz")
            assert (sensor in found) == (least * 9 < 0.01), sensor
        assert {"s00", "s10", "s20"} <= found
        assert len(found) <= 4
