"""Tables of places: what is understood, and which row an error names."""

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.space.positions import read_points


@pytest.fixture
def table(tmp_path: Path):
    def write(text: str, encoding: str = "utf-8") -> Path:
        path = tmp_path / "points.csv"
        path.write_text(text, encoding=encoding)
        return path

    return write


def test_places_and_dates_come_in_the_units_that_headers_name(table) -> None:
    points = read_points(
        table(
            "site,Latitude (deg),lon,alt_km,time,remark\n"
            "A, 52.5 ,-96,48,2025-01-01,x\n"
            '\n"B, the 2nd",-90,360,0,2026-07-02T12:00:00Z,\n'
            "C,0,-180,0.25,2026.5,\n",
            "utf-8-sig",
        )
    )
    assert points.latitude_deg.tolist() == [52.5, -90.0, 0.0]
    assert points.longitude_deg.tolist() == [-96.0, 360.0, -180.0]
    assert points.altitude_m.tolist() == [48_000.0, 0.0, 250.0]
    np.testing.assert_allclose(points.years, [2025.0, 2026.5, 2026.5])
    assert points.dates == ("2025-01-01", "2026-07-02T12:00:00Z", "2026.5")
    assert points.rows.tolist() == [2, 4, 5]


def test_a_date_for_all_and_no_height(table) -> None:
    points = read_points(table("latitude_deg,longitude_deg\n1,2\n3,4\n"), "2026-01-01")
    assert points.years.tolist() == [2026.0, 2026.0]
    assert points.altitude_m.tolist() == [0.0, 0.0]
    own = read_points(table("lat,lon,date\n1,2,2027-01-01\n"), "2026-01-01")
    assert own.years.tolist() == [2027.0]


def test_seconds_of_a_log_are_no_date(table) -> None:
    log = table("time_s,latitude_deg,longitude_deg\n0.0,1,2\n0.5,3,4\n")
    assert read_points(log, "2026-01-01").years.tolist() == [2026.0, 2026.0]
    with pytest.raises(LogError, match="give --date for all"):
        read_points(log)
    with pytest.raises(LogError, match=r"gone\.csv: there is no such file"):
        read_points("gone.csv")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lat,lon,date\n1,2,2026-01-01\n91,2,2026-01-01\n", r"row 3: lat is '91'; .* -90 to 90"),
        ("lat,lon,date\n1,x,2026-01-01\n", r"row 2: lon is 'x'"),
        ("lat,lon,date\n1,nan,2026-01-01\n", r"row 2: lon is 'nan'"),
        ("lat,lon,date\n1,2,2026-01-01\n\n1,2,yesterday\n", r"row 4: .*yesterday"),
        ("lat,lon,date\n1,2,1.7e9\n", r"row 2: 1.7e9 is not a year"),
        ("lat,lon,date\n1,2,\n", r"row 2"),
        ("lat,lon,date\n1,2\n", r"row 2: there is no date"),
        ("lat,lon,height_m,date\n1,2,-2e5,2026\n", r"row 2: height_m is '-2e5'"),
        ("lat,lon\n1,2\n", r"no column date; add one, or give --date"),
        ("lat,date\n1,2026\n", r"no column longitude_deg among 'lat', 'date'"),
        ("52,5,2026\n53,5,2026\n", r"no column latitude_deg or longitude_deg"),
        ("lat,latitude,lon,date\n1,1,2,2026\n", r"'lat' and 'latitude' could both be"),
        ("lat,lon,date\n", r"no row of a place"),
        ("", r"no row of a place"),
    ],
)
def test_what_is_wrong_is_named_with_its_row(table, text: str, said: str) -> None:
    path = table(text)
    with pytest.raises(LogError, match=said) as error:
        read_points(path)
    assert "points.csv" in str(error.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_bytes(b"\xff\xfe\x00\x81\x8d")
    with pytest.raises(LogError, match="not text"):
        read_points(tmp_path / "x.csv")
