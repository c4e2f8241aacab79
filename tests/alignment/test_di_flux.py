"""DI-flux sheets as observatories keep them, and north.toml and coil.toml."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agonic.alignment.document import describe_di_flux
from agonic.alignment.files.read_di_flux import read_di_flux
from agonic.alignment.files.sessions import read_coil, read_north, write_coil, write_north
from agonic.alignment.north.di_flux import fit_di_flux
from agonic.alignment.simulation.laboratory import simulate_coil, simulate_di_flux, simulate_north
from agonic.errors import AgonicError, LogError

HEAD = "# MagPy Absolutes\n# Abs-TheoUnit: gon\n# Abs-AzimuthMark: 200\n"
SHEETS = {
    "2015-02-04_19-02-00_2_NXY.txt": (-48.70, 85.81, 5.0),
    "2017-11-02_08-35-00_A2_NXX.txt": (4.186, 64.32, 10.0),
    "2020-03-03_18-17-00_A_SXY.txt": (15.68, -57.19, 10.0),
    "2022-08-10_07-38-00_A2_WIC.txt": (4.898, 64.464, 4.0),
}
"""Declination and inclination by the mean of four circle readings each, and the noise, ″."""


def reduced_by_hand(sheet) -> tuple[float, float]:
    """The classical reduction: circle readings brought to a zero of the fluxgate, then means."""
    scale = sheet.magnitude or 48_800.0
    level = np.abs(np.sin(np.radians(sheet.zenith_deg))) > 0.99999
    _, first = np.unique(sheet.setting, return_index=True)
    first = first[:8]  # the ninth has a known tilt, for the scale
    sign = np.where(sheet.zenith_deg < 180, 1.0, -1.0)
    dips = []
    for k in first[~level[first]]:
        own = sheet.setting == sheet.setting[k]
        v = sheet.zenith_deg[own].mean()
        # ∂S/∂v is +F with v = I or 180° − I and −F with the telescope turned over
        v -= np.degrees(sheet.reading[own].mean() / scale) * sign[k]
        dips.append((v + 90.0) % 180.0 - 90.0)
    dip = float(np.abs(dips).mean() * np.sign(dips[0]))
    zeros = []
    for k in first[level[first]]:
        own = sheet.setting == sheet.setting[k]
        zeros.append(sheet.horizontal_deg[own].mean() % 180.0)
    zeros = np.array(zeros)
    zeros = zeros[0] + (zeros - zeros[0] + 90.0) % 180.0 - 90.0
    marks = sheet.mark_deg % 180.0
    turned = zeros.mean() - 90.0 + sheet.mark_azimuth_deg - marks.mean()
    return float((turned + 90.0) % 180.0 - 90.0), dip


@pytest.mark.recordings
@pytest.mark.parametrize("name", SHEETS)
def test_recorded_sheets(recordings: Path, name: str) -> None:
    sheet = read_di_flux(recordings / "observatory" / "di_flux" / name)
    declination, inclination, noise = SHEETS[name]
    fit = fit_di_flux(sheet)
    assert fit.verdict == "good"
    assert fit.declination_deg == pytest.approx(declination, abs=0.005)
    assert fit.inclination_deg == pytest.approx(inclination, abs=0.005)
    assert fit.noise_arcsec < noise
    assert fit.estimate.freedom == 3
    by_hand = reduced_by_hand(sheet)
    # the readings left in the level settings, up to 3 nT, are not in the hand reduction
    level = np.abs(np.sin(np.radians(sheet.zenith_deg))) > 0.99999
    horizontal = (sheet.magnitude or 48_800.0) * np.cos(np.radians(inclination))
    left = np.degrees(np.abs(sheet.reading[level]).max() / horizontal) + 5 / 3600
    assert fit.declination_deg == pytest.approx(by_hand[0], abs=left)
    assert fit.inclination_deg == pytest.approx(by_hand[1], abs=4 / 3600 + 5 / 3600)
    assert np.isfinite(fit.collimation_sd_arcsec).all()


@pytest.mark.recordings
def test_units_and_the_head_of_recorded_sheets(recordings: Path) -> None:
    folder = recordings / "observatory" / "di_flux"
    sheet = read_di_flux(folder / "2015-02-04_19-02-00_2_NXY.txt")
    assert sheet.mark_azimuth_deg == pytest.approx(122.3519 * 0.9)
    assert sheet.magnitude == pytest.approx(56_326.9 - 0.8)  # the median of PPM, and DeltaF
    fit = fit_di_flux(sheet)
    assert fit.scale / sheet.magnitude == pytest.approx(1.0, abs=0.02)
    degrees = read_di_flux(folder / "2020-03-03_18-17-00_A_SXY.txt")
    assert degrees.horizontal_deg[0] == pytest.approx(98.26666666666667)
    assert degrees.magnitude is None
    assert len(np.unique(degrees.setting)) == 8
    fit = fit_di_flux(degrees)
    assert {f.name for f in fit.findings} == {"off the meridian", "mark read once"}
    assert not fit.scaled  # every reading is 0: no unit of the fluxgate can be told


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("# MagPy Absolutes\nMiren:\n1 2\n", "lacks Abs-TheoUnit .*, Positions"),
        (
            HEAD + "Miren:\n1 x\nPositions:\n2020-01-01_10:00:00 1 2 3\n",
            "row 5.*'x' is not a number",
        ),
        (HEAD + "Miren:\n1\nPositions:\n2020-01-01_10:00:00 1 2\n", "3 cells where 4"),
        (HEAD + "Miren:\n1\nPositions:\nyesterday 1 2 3\n", "'yesterday' is no time"),
        (HEAD.replace("200", "south") + "Miren:\n1\nPositions:\n2020-01-01 1 2 3\n", "'south'"),
    ],
)
def test_sheets_that_cannot_be_read(tmp_path: Path, text: str, match: str) -> None:
    file = tmp_path / "sheet.txt"
    file.write_text(text)
    with pytest.raises(LogError, match=match):
        read_di_flux(file)


def test_a_north_session_comes_back(tmp_path: Path) -> None:
    session = simulate_north().session
    write_north(session, tmp_path)
    again = read_north(tmp_path)
    np.testing.assert_array_equal(again.turning_deg, session.turning_deg)
    for name in ("setting_deg", "east_s", "west_s", "amplitude_east", "amplitude_west"):
        np.testing.assert_array_equal(
            getattr(again.transits, name), getattr(session.transits, name)
        )
    np.testing.assert_array_equal(again.swing.reading_deg, session.swing.reading_deg)
    np.testing.assert_array_equal(again.platform.roll_deg, session.platform.roll_deg)
    np.testing.assert_array_equal(again.magnetometer.field, session.magnetometer.field)
    assert again.platform.mirror
    assert again.sightings[0].reading_deg.tolist() == session.sightings[0].reading_deg.tolist()
    assert again.constant_arcsec == session.constant_arcsec
    assert len(again.sources) == 6


def test_gon_is_nine_tenths_of_a_degree(tmp_path: Path) -> None:
    (tmp_path / "reversal.csv").write_text("reading_gon\n10\n20\n10\n")
    (tmp_path / "north.toml").write_text(
        '[reversal]\n[[sighting]]\nname = "mark"\nreadings_gon = [100]\n'
    )
    session = read_north(tmp_path / "north.toml")
    assert session.turning_deg.tolist() == [9.0, 18.0, 9.0]
    assert session.sightings[0].reading_deg.tolist() == [90.0]


def test_every_mistake_of_a_description_is_named(tmp_path: Path) -> None:
    (tmp_path / "north.toml").write_text(
        'nam = "a"\n[reversal]\nfile = "none.csv"\n[gyro]\ntime_sd_s = -1\n'
        '[[sighting]]\nname = "mark"\n'
    )
    with pytest.raises(LogError) as caught:
        read_north(tmp_path)
    said = str(caught.value)
    assert all(part in said for part in ("`nam`", "none.csv", "time_sd_s is -1", "readings_deg"))
    (tmp_path / "coil.toml").write_text(
        "[coil]\naxis = [0, 0, 0]\n[attitude]\nroll_deg = 1\nra_deg = 3\n[alignment]\n"
    )
    with pytest.raises(LogError) as caught:
        read_coil(tmp_path)
    said = str(caught.value)
    assert all(
        part in said
        for part in ("no length", "one of the two", "no section [magnetometer]", "needs `file`")
    )


def test_tables_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "north.toml").write_text("[reversal]\n")
    (tmp_path / "reversal.csv").write_text("angle\n1\n")
    with pytest.raises(LogError, match="no column reading_deg among angle"):
        read_north(tmp_path)
    (tmp_path / "reversal.csv").write_text("reading_deg\n1\n2\nx\n")
    with pytest.raises(LogError, match=r"row 4: reading_deg is 'x'"):
        read_north(tmp_path)


def test_a_coil_session_comes_back(tmp_path: Path) -> None:
    session = simulate_coil(reversals=6).session
    write_coil(session, tmp_path)
    again = read_coil(tmp_path)
    np.testing.assert_array_equal(again.magnetometer.current_A, session.magnetometer.current_A)
    np.testing.assert_allclose(again.attitude.rot_pn, session.attitude.rot_pn, atol=1e-12)
    np.testing.assert_allclose(again.attitude.covariance, session.attitude.covariance, rtol=1e-9)
    np.testing.assert_allclose(
        again.alignment.rotation.as_matrix(), session.alignment.rotation.as_matrix(), atol=1e-12
    )
    assert again.site.latitude_deg == session.site.latitude_deg
    (tmp_path / "alignment.json").unlink()
    with pytest.raises(AgonicError, match=r"no file alignment\.json"):
        read_coil(tmp_path)


def test_what_the_sheet_says_of_the_total_field_is_shown(tmp_path: Path) -> None:
    made = simulate_di_flux().sheet
    fit = fit_di_flux(replace(made, notes=("the total field was measured at another time",)))
    assert "The total field was measured at another time." in fit.status
    assert "another time" in describe_di_flux(fit).to_text()


def test_sightings_in_one_section_are_a_mistake_that_is_named(tmp_path: Path) -> None:
    write_north(simulate_north().session, tmp_path)
    file = tmp_path / "north.toml"
    file.write_text(file.read_text().replace("[[sighting]]", "[sighting]"))
    with pytest.raises(LogError, match=r"written \[\[sighting\]\], once for each"):
        read_north(tmp_path)
