"""Positions from two-line elements: against published vectors, and against a logged track."""

from __future__ import annotations

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from agonic.errors import AgonicWarning, LogError, MissingExtraError
from agonic.logs.read import read
from agonic.logs.space.positions import positions_from_tle
from agonic.maths.earth.geodesy import directions, earth_fixed_position, from_geocentric

pytest.importorskip("sgp4")

STATION = """ISS (ZARYA)
1 25544U 98067A   21107.58244333  .00000946  00000-0  25412-4 0  9990
2 25544  51.6445 282.4828 0002680 236.8482 199.8666 15.48892929279202"""
VANGUARD = """1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667"""
"""The first verification case of Vallado et al., AIAA 2006-6753."""
NEAR = datetime(2021, 4, 17, 14, tzinfo=UTC)


def earth_fixed(place: dict[str, np.ndarray]) -> np.ndarray:
    where = directions(place["latitude_deg"], place["longitude_deg"])
    return earth_fixed_position(where, place["altitude_m"])


def test_published_distances_come_out() -> None:
    """Positions of the verification case after 0, 360 and 720 minutes, TEME, km."""
    published = np.array(
        [
            [7022.46529266, -1400.08296755, 0.03995155],
            [-7154.03120202, -3783.17682504, -3536.19412294],
            [-7134.59340119, 6531.68641334, 3260.27186483],
        ]
    )
    epoch = datetime(2000, 1, 1, tzinfo=UTC) + timedelta(days=178.78495062)
    place = positions_from_tle(VANGUARD, [0.0, 21_600.0, 43_200.0], epoch)
    ours = earth_fixed(place).T / 1e3
    np.testing.assert_allclose(
        np.linalg.norm(ours, axis=1), np.linalg.norm(published, axis=1), atol=1e-3
    )  # km; the epoch is good to a microsecond
    np.testing.assert_allclose(ours[:, 2], published[:, 2], atol=1e-3)


def test_the_nearest_elements_are_taken_for_each_row() -> None:
    """The same elements a day later, under another epoch, hold where the first do not."""
    later = STATION.replace("21107.58244333", "21110.58244333").replace("9990", "9994")
    both = f"{STATION}\n{later}"
    hours = np.array([0.0, 72.0]) * 3600.0
    first = positions_from_tle(STATION, hours, NEAR)
    mixed = positions_from_tle(both, hours, NEAR)
    assert mixed["latitude_deg"][0] == first["latitude_deg"][0]
    own = positions_from_tle(later, hours, NEAR)
    assert mixed["latitude_deg"][1] == own["latitude_deg"][1]
    assert abs(own["latitude_deg"][1] - first["latitude_deg"][1]) > 1.0


def test_a_file_of_elements(tmp_path: Path) -> None:
    path = tmp_path / "station.tle"
    path.write_text(STATION)
    place = positions_from_tle(path, [0.0], NEAR)
    assert place["altitude_m"][0] == positions_from_tle(STATION, [0.0], NEAR)["altitude_m"][0]
    with pytest.raises(LogError, match=r"none\.tle: there is no such file"):
        positions_from_tle(tmp_path / "none.tle", [0.0], NEAR)


def test_several_satellites_need_a_choice() -> None:
    both = f"{STATION}\n{VANGUARD}"
    with pytest.raises(LogError, match="elements of the satellites 25544, 5; choose one"):
        positions_from_tle(both, [0.0], NEAR)
    chosen = positions_from_tle(both, [0.0], NEAR, satellite=25544)
    assert chosen["altitude_m"][0] == pytest.approx(428e3, abs=1e3)


def test_wrong_lines_are_refused() -> None:
    with pytest.raises(LogError, match="no two-line elements found"):
        positions_from_tle("one\ntwo\n", [0.0], NEAR)
    with pytest.raises(LogError, match=r"the checksum of .* is wrong"):
        positions_from_tle(STATION.replace("51.6445", "51.6446"), [0.0], NEAR)


def test_old_elements_are_warned_of() -> None:
    with pytest.warns(AgonicWarning, match="30 days off"):
        positions_from_tle(STATION, [0.0], NEAR + timedelta(days=30))


def test_a_satellite_that_fell_down_is_nowhere() -> None:
    with (
        pytest.warns(AgonicWarning, match="days off"),
        pytest.raises(LogError, match="do not hold at 1 of 1 times"),
    ):
        positions_from_tle(
            STATION.replace(" .00000946  00000-0  25412-4", " .00000946  00000-0  25412-1").replace(
                "9990", "9997"
            ),
            [0.0],
            NEAR + timedelta(days=3000),
        )


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sgp4.api", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[space\]"):
        positions_from_tle(STATION, [0.0], NEAR)


@pytest.mark.recordings
def test_the_space_station_was_where_its_log_says(recordings: Path) -> None:
    """Elements made 12 to 15 hours later; the log gives geocentric latitudes, as PyEphem does."""
    samples = read(recordings / "orbit/iss_2021-04-16_all_photos_classified.csv", unit="uT")
    place = positions_from_tle(STATION, samples.time, samples.epoch)
    ours = earth_fixed(place)
    radius = np.linalg.norm(ours, axis=0)
    logged = from_geocentric(samples.latitude_deg, samples.longitude_deg, radius)
    apart = np.linalg.norm(ours - earth_fixed_position(directions(*logged[:2]), logged[2]), axis=0)
    assert np.median(apart) < 10e3  # m, of which 1.2 s along the track
    assert apart.max() < 15e3
    as_geodetic = earth_fixed_position(
        directions(samples.latitude_deg, samples.longitude_deg), place["altitude_m"]
    )
    assert np.median(np.linalg.norm(ours - as_geodetic, axis=0)) > 15e3
    assert 415e3 < place["altitude_m"].min() < place["altitude_m"].max() < 440e3


@pytest.mark.parametrize("letter", ["x", "\0", "é"])
@pytest.mark.parametrize("at", [20, 97])
def test_a_bad_letter_is_told_and_no_position_is_made(letter, at):
    """A letter counts nothing in the checksum where a zero or a blank stood before."""
    lines = (
        "1 25544U 98067A   21107.58244333  .00000946  00000-0  25412-4 0  9990\n"
        "2 25544  51.6445 282.4828 0002680 236.8482 199.8666 15.48892929279202"
    )
    first = next(k for k in range(at, len(lines)) if lines[k] in "0 ")
    spoilt = lines[:first] + letter + lines[first + 1 :]
    with pytest.raises(LogError):
        positions_from_tle(spoilt, [0.0], datetime(2021, 4, 17, 14, 0, tzinfo=UTC))
