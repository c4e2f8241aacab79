"""session.toml and its tables: what is written is read, and what is wrong is said."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment.files.sessions import read_session, write_session
from agonic.alignment.files.tables import read_stars
from agonic.alignment.simulation.session import SimulatedSession, simulate_session
from agonic.alignment.star_sensor.fit import fit_alignment
from agonic.calibration.affine import Affine
from agonic.errors import AgonicError, LogError
from agonic.files.calibration import save
from agonic.maths.rotations.frames import ARCSEC_RAD


@pytest.fixture
def made() -> SimulatedSession:
    return simulate_session(orientations=5, readings=4, seed=1, pier=(3.0, -2.0, 1.0))


@pytest.fixture
def folder(made: SimulatedSession, tmp_path: Path) -> Path:
    write_session(made.session, tmp_path)
    return tmp_path


def edit(folder: Path, old: str, new: str) -> Path:
    """Change session.toml."""
    file = folder / "session.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    return file


def rewrite(file: Path, change) -> None:
    """Change the columns of a table."""
    with file.open() as stream:
        rows = list(csv.DictReader(stream))
    table = change({name: [row[name] for row in rows] for name in rows[0]})
    with file.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(table)
        writer.writerows(zip(*table.values(), strict=True))


def test_what_is_written_is_read(made, folder) -> None:
    read, session = read_session(folder), made.session
    np.testing.assert_allclose(read.star.rot_ci, session.star.rot_ci, atol=1e-6 * ARCSEC_RAD)
    np.testing.assert_allclose(read.star.time, session.star.time, atol=1e-6)
    np.testing.assert_allclose(read.star.covariance, session.star.covariance, rtol=1e-10)
    np.testing.assert_array_equal(read.magnetometer.field, session.magnetometer.field)
    np.testing.assert_array_equal(read.magnetometer.station, session.magnetometer.station)
    np.testing.assert_array_equal(read.pier.difference, session.pier.difference)
    assert (read.site, read.mounting, read.noise) == (session.site, session.mounting, 0.5)
    assert (read.star.refraction, read.star.aberration) == ("present", "present")
    assert [source.name for source in read.sources] == [
        "star.csv",
        "magnetometer.csv",
        "reference.csv",
    ]
    np.testing.assert_allclose(
        fit_alignment(read).rot_mc, fit_alignment(session).rot_mc, atol=1e-4 * ARCSEC_RAD
    )


@pytest.mark.parametrize(("scale", "ahead"), [("TAI", 37.0), ("GPS", 18.0), ("TT", 69.184)])
def test_time_scales_come_to_utc(made, folder, scale: str, ahead: float) -> None:
    """The tables of an observatory whose clocks run in that scale."""

    def later(table):
        name = "unix_s" if "unix_s" in table else "epoch_unix_s"
        table[name] = [f"{float(value) + ahead:.6f}" for value in table[name]]
        return table

    for name in ("star.csv", "magnetometer.csv", "reference.csv"):
        rewrite(folder / name, later)
    read = read_session(edit(folder, '"UTC"', f'"{scale}"'))
    np.testing.assert_allclose(read.star.time, made.session.star.time, atol=1e-5)
    assert abs((read.magnetometer.epoch - made.session.magnetometer.epoch).total_seconds()) < 1e-5


def quaternions(made: SimulatedSession, conjugate: bool):
    """A change of the star table from angles to quaternions."""
    turned = Rotation.from_matrix(made.session.star.rot_ci)
    x, y, z, w = (turned.inv() if conjugate else turned).as_quat().T

    def change(table):
        kept = {name: table[name] for name in ("unix_s", "orientation")}
        return kept | dict(zip(("quat_w", "quat_x", "quat_y", "quat_z"), (w, x, y, z), strict=True))

    return change


@pytest.mark.parametrize("turns", ["ci", "ic"])
def test_quaternions_in_either_sense(made, folder, turns: str) -> None:
    rewrite(folder / "star.csv", quaternions(made, conjugate=turns == "ic"))
    stated = f'turns = "{turns}"\nacross_sd_arcsec = 3\nabout_sd_arcsec = 20\n'
    read = read_session(edit(folder, "[star]\n", f"[star]\n{stated}"))
    np.testing.assert_allclose(read.star.rot_ci, made.session.star.rot_ci, atol=1e-12)
    np.testing.assert_allclose(read.star.covariance, made.session.star.covariance, rtol=1e-12)


def test_a_quarter_turn_of_the_quaternion(tmp_path: Path) -> None:
    """(√½, 0, 0, √½) takes components x → y; the star sensor's z stays on the pole."""
    half = np.sqrt(0.5)
    table = "utc,orientation,quat_w,quat_x,quat_y,quat_z\n2024-03-12T20:00:00Z,1,{0},0,0,{0}\n"
    file = tmp_path / "star.csv"
    file.write_text(table.format(half) + f"2024-03-12T20:00:01Z,1,{half},0,0,{half}\n")
    np.testing.assert_allclose(read_stars(file, "ci").rot_ci[0] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(read_stars(file, "ic").rot_ci[0] @ [1, 0, 0], [0, -1, 0], atol=1e-15)
    assert read_stars(file).time.tolist() == [1710273600.0, 1710273601.0]


@pytest.mark.parametrize(
    ("axes", "turn"),
    [("ENU", lambda f: f[:, [1, 0, 2]] * [1, 1, -1]), ("NWU", lambda f: f * [1, -1, -1])],
)
def test_axes_of_the_reference(made, folder, axes: str, turn) -> None:
    names = ("mag_x_nT", "mag_y_nT", "mag_z_nT")

    def change(table):
        field = np.array([table[name] for name in names], dtype=float).T
        return table | dict(zip(names, turn(field).T, strict=True))

    rewrite(folder / "reference.csv", change)
    read = read_session(edit(folder, '"NED"', f'"{axes}"'))
    np.testing.assert_allclose(read.reference.field, made.session.reference.field, atol=1e-9)


def test_orientations_by_the_star_sensors_times(made, folder) -> None:
    """The magnetometer ran on while the platform was turned, and its table has no numbers."""

    def without(table):
        return {name: values for name, values in table.items() if name != "station"}

    rewrite(folder / "magnetometer.csv", without)
    read = read_session(folder)
    np.testing.assert_array_equal(read.magnetometer.station, made.session.magnetometer.station)


def test_a_calibration_of_the_magnetometer_is_applied(made, folder) -> None:
    bias = np.array([100.0, -50.0, 20.0])
    save(Affine(bias=bias, matrix=np.eye(3) * 1.0), folder / "mag.json")
    read = read_session(
        edit(folder, "[magnetometer]\n", '[magnetometer]\ncalibration="mag.json"\n')
    )
    np.testing.assert_allclose(read.corrected, made.session.magnetometer.field - bias)
    assert fit_alignment(read).calibration.kind == "chain"


def test_every_mistake_of_the_description_is_said_at_once(folder) -> None:
    edit(folder, "latitude_deg = 52.0725", "latitude = 52.0725")
    edit(folder, 'refraction = "present"\n', "")
    edit(folder, "noise_nT = 0.3", "noise_nT = -1")
    with pytest.raises(LogError) as caught:
        read_session(edit(folder, '"star.csv"', '"stars.csv"'))
    said = str(caught.value)
    for words in (
        "[site] has no key `latitude`",
        "[site] needs `latitude_deg`",
        "[star] needs `refraction`",
        "[reference] noise_nT is -1; it must be above 0",
    ):
        assert words in said


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"UTC"', '"EST"', "`time_scale`"),
        ('"NED"', '"ESD"', "[reference] `axes`"),
        ("latitude_deg = 52.0725", "latitude_deg = 152.0", "is not a place"),
        ('"reference.csv"', '"none.csv"', "there is no file none.csv"),
        ("[site]", "[place]", "there is no section [site]"),
        ("noise_nT = 0.5", 'unit = "furlong"', "furlong"),
    ],
)
def test_a_mistake_of_the_description_is_said(folder, old: str, new: str, words: str) -> None:
    edit(folder, old, new)
    with pytest.raises(AgonicError) as caught:
        read_session(folder)
    assert words in str(caught.value)


def dropped(name: str):
    return lambda table: {key: cells for key, cells in table.items() if key != name}


def replaced(name: str, row: int, cell: str):
    def change(table):
        cells = list(table[name])
        cells[row] = cell
        return table | {name: cells}

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dropped("orientation"), "no column with the orientation's number"),
        (dropped("rot_deg"), "no attitudes: there is no rot_deg"),
        (dropped("unix_s"), "no column with times"),
        (replaced("ra_deg", 2, "north"), "row 4: ra_deg is 'north', not a number"),
        (replaced("dec_deg", 3, "97"), "row 5: dec_deg is 97: a declination lies between"),
        (replaced("orientation", 0, "1.5"), "whole numbers"),
        (replaced("cov_xy_arcsec2", 1, "50"), "correlations below 1"),
    ],
)
def test_what_is_wrong_with_a_star_table(folder, change, words: str) -> None:
    rewrite(folder / "star.csv", change)
    with pytest.raises(AgonicError) as caught:
        read_session(folder)
    assert words in str(caught.value)


def test_a_quaternion_that_is_none(made, folder) -> None:
    rewrite(folder / "star.csv", quaternions(made, conjugate=False))
    rewrite(folder / "star.csv", replaced("quat_w", 0, "3"))
    with pytest.raises(LogError, match=r"row 2: the quaternion has the length 3\.\d+, not 1"):
        read_session(folder)


def test_times_that_do_not_meet(folder) -> None:
    def later(table):
        table["unix_s"] = [f"{float(value) + 7200:.3f}" for value in table["unix_s"]]
        return table

    rewrite(folder / "star.csv", later)
    with pytest.raises(AgonicError, match=r"never read at the same time: they are 1\.9\d h apart"):
        read_session(folder)


def test_a_reference_that_stops_too_early(folder) -> None:
    rewrite(folder / "reference.csv", lambda t: {name: cells[:100] for name, cells in t.items()})
    with pytest.raises(AgonicError, match="the reference does not cover"):
        read_session(folder)


def test_a_folder_without_a_session(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"does not hold session\.toml"):
        read_session(tmp_path)
    (tmp_path / "session.toml").write_text("name = ")
    with pytest.raises(LogError, match="this is not TOML"):
        read_session(tmp_path)
