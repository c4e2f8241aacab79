"""`agonic field --points` against the model itself and the official test value."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.field.worldfield import ELEMENTS

TABLE = """site,latitude_deg,longitude_deg,altitude_m,date
A,80,-96,48000,2025-01-01
B,-33.5,151.2,0,2012.5
C,-90,10,0,2026-03-01T12:00:00Z
D,80,-96,0,2029-12-31
"""


@pytest.fixture(autouse=True)
def points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("points.csv").write_text(TABLE)


def test_every_row_has_the_elements_of_the_model_that_holds_then(capsys) -> None:
    assert run(["field", "--points", "points.csv", "-o", "out.csv"]) == 0
    assert capsys.readouterr().out == "4 points: out.csv\n"
    with Path("out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["model"] for row in rows] == ["WMM2025", "IGRF-14", "WMM2025", "WMM2025"]
    assert float(rows[0]["declination_deg"]) == pytest.approx(-29.91, abs=0.005)  # official
    models = (ag.wmm(), ag.igrf(), ag.wmm(), ag.wmm())
    for row, model in zip(rows, models, strict=True):
        when = float(row["date"]) if row["date"] == "2012.5" else row["date"]
        place = (float(row[name]) for name in ("latitude_deg", "longitude_deg", "altitude_m"))
        here = model.at(*place, when)
        for name in ELEMENTS:
            deg = name.endswith("_deg")
            near = {"abs": 1e-6 if deg else 1e-4}
            header = name if deg else f"{name}_nT"
            assert float(row[header]) == pytest.approx(here.elements()[name], **near)
            change = here.elements_per_year()[name]
            assert float(row[f"{header}_per_year"]) == pytest.approx(change, **near)
        assert float(row["declination_sd_deg"]) == pytest.approx(here.declination_sd_deg, abs=1e-6)


def test_without_a_file_the_table_goes_to_stdout(capsys) -> None:
    run(["field", "--points", "points.csv", "-o", "out.csv"])
    capsys.readouterr()
    assert run(["field", "--points", "points.csv"]) == 0
    assert capsys.readouterr().out == Path("out.csv").read_text()


def test_json_is_one_object_of_columns(capsys) -> None:
    assert run(["field", "--points", "points.csv", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "agonic/field-points@1"
    assert (said["n"], said["files"]) == (4, [])
    here = ag.wmm().at(80, -96, 48000, "2025-01-01")
    np.testing.assert_allclose(said["north_nT"][0], here.north, rtol=1e-12)
    lengths = {len(column) for name, column in said.items() if isinstance(column, list)} - {0}
    assert lengths == {4}


def test_a_date_for_all_and_a_model_by_name(capsys) -> None:
    Path("plain.csv").write_text("lat,lon\n52,5\n")
    options = ["--date", "2026-03-01", "--model", "igrf"]
    assert run(["field", "--points", "plain.csv", *options, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["model"] == ["IGRF-14"]
    north = ag.igrf().at(52, 5, 0, "2026-03-01").north
    assert said["north_nT"] == pytest.approx([float(north)])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "a place (--at LAT,LON[,ALT]) or a table of places (--points CSV)"),
        (["--points", "points.csv", "--at", "1,2"], "not both"),
        (["--at", "1,2", "-o", "x.csv"], "-o writes the table of --points"),
        (["--points", "points.csv", "--model", "wmm"], "points.csv, row 3: WMM2025 holds from"),
        (
            ["--points", "points.csv", "--model", "emm"],
            "model 'emm' is not known; use one of igrf, wmm, wmmhr",
        ),
        (["--points", "nowhere.csv"], "nowhere.csv"),
        (["--points", "old.csv"], "old.csv, row 2: IGRF-14 holds from 1900"),
        (["--points", "undated.csv"], "no column date"),
        (["--points", "undated.csv", "--date", "2199-01-01"], "undated.csv, row 2: IGRF-14 holds"),
    ],
)
def test_bad_input_is_one_line_and_exit_two(arguments: list[str], said: str, capsys) -> None:
    Path("old.csv").write_text("lat,lon,date\n52,5,1850-01-01\n")
    Path("undated.csv").write_text("lat,lon\n52,5\n")
    assert run(["field", *arguments]) == 2
    seen = capsys.readouterr()
    assert said in seen.err
    assert seen.err.count("\n") == 1
    assert seen.out == ""
    assert not Path("x.csv").exists()
