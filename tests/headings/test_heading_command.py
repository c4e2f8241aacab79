"""`agonic heading` as a person or a script would run it, from an empty folder."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.cli import run
from agonic.ellipsoid import fit_ellipsoid
from agonic.exports.csv import write_csv
from agonic.field import wmm
from agonic.files.calibration import load, save
from agonic.files.setup import save_setup
from agonic.logs.read import sensors
from agonic.reference import Reference
from agonic.simulation import magnet_attached, simulate

WHERE = {"latitude_deg": 52.0, "longitude_deg": 5.0, "altitude_m": 100.0}
WHEN = "2026-03-01"
HERE = wmm().at(*WHERE.values(), WHEN)
FIELD = {
    "magnitude": float(HERE.magnitude),
    "inclination_deg": float(HERE.inclination_deg),
    "declination_deg": float(HERE.declination_deg),
}


@pytest.fixture(autouse=True)
def folder(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A calibrated vehicle and another flight of it, without a date."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(recorded, tmp_path, dirs_exist_ok=True))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same, made once."""
    there = tmp_path_factory.mktemp("recorded")
    made = simulate("tumble", n=1500, seed=1, noise=100.0, **FIELD)
    fit = fit_ellipsoid(made.samples, Reference.constant(FIELD["magnitude"]))
    save(fit.calibration, there / "mag.json")
    flight = simulate(
        "flight",
        n=1500,
        seed=2,
        noise=100.0,
        calibration=made.truth,
        stray_nT_A=(0.0, 0.0, 0.0),
        **FIELD,
        **WHERE,
    )
    write_csv(flight.samples, there / "flight.csv")
    save_setup(
        Setup(
            compasses=(Compass(calibration=fit.calibration),),
            declination_deg=2.69,
            declination_sd_deg=0.1,
        ),
        there / "setup.toml",
    )
    lost = dict.fromkeys(WHERE)
    write_csv(flight.samples.with_columns(**lost), there / "placeless.csv")
    bare = flight.samples.with_columns(roll_deg=None, pitch_deg=None, acceleration=None)
    write_csv(bare, there / "bare.csv")
    return there


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict]:
    capsys.readouterr()
    status = run(["heading", *arguments, "-o", "out.csv", "--json"])
    return status, json.loads(capsys.readouterr().out)


def rows() -> list[dict[str, str]]:
    with Path("out.csv").open() as stream:
        return list(csv.DictReader(stream))


def test_a_calibration_alone_gives_true_headings_by_the_world_model(capsys) -> None:
    status, said = answer(capsys, "mag.json", "flight.csv", "--date", WHEN)
    assert (status, said["schema"], said["n"], said["trusted"]) == (
        0,
        "agonic/heading@1",
        1500,
        1500,
    )
    assert said["declination_deg"] == pytest.approx(FIELD["declination_deg"], abs=0.01)
    against = said["against_log"]
    assert abs(against["mean_deg"]) < 3 * said["sd_deg"]
    assert against["rms_deg"] < 1.0
    table = rows()
    names = "time_s compass_deg magnetic_deg true_deg sd_deg tilt_sd_deg disagreement_deg"
    assert list(table[0]) == [*names.split(), "sensor", "flags"]
    assert len(table) == 1500
    logged = np.genfromtxt("flight.csv", delimiter=",", names=True)["heading_deg"]
    found = np.array([float(row["true_deg"]) for row in table])
    assert np.abs((found - logged + 180) % 360 - 180).max() < 3.0
    assert float(table[7]["time_s"]) == pytest.approx(0.14)
    # roll and pitch of the simulation are exact and the dip shows it: less than the 0.5° assumed
    assert 0.1 <= float(table[7]["tilt_sd_deg"]) < 0.2
    assert {(row["sensor"], row["flags"], row["disagreement_deg"]) for row in table} == {
        ("mag", "", "")
    }


def test_a_setup_needs_neither_place_nor_date(capsys) -> None:
    status, said = answer(capsys, "setup.toml", "placeless.csv")
    assert (status, said["declination_deg"]) == (0, 2.69)
    assert abs(said["against_log"]["mean_deg"]) < 1.0


@pytest.mark.slow
def test_the_place_may_be_given(capsys) -> None:
    _, given = answer(capsys, "mag.json", "placeless.csv", "--at", "52,5,100", "--date", WHEN)
    _, logged = answer(capsys, "mag.json", "flight.csv", "--date", WHEN)
    assert given["declination_deg"] == pytest.approx(logged["declination_deg"], abs=0.01)
    status, today = answer(capsys, "mag.json", "placeless.csv", "--at", "52,5")
    assert status == 0
    assert today["notes"][-1:] == [
        "the log has no date: the declination is today's; --date gives another"
    ]


def test_a_log_in_which_nothing_can_be_trusted_is_exit_status_1(capsys) -> None:
    log = simulate(
        "flight",
        n=200,
        seed=2,
        **FIELD,
        **WHERE,
        defects=[magnet_attached(0.0, [60_000.0, 60_000.0, 60_000.0])],
    )
    write_csv(log.samples, "magnet.csv")
    status, said = answer(capsys, "mag.json", "magnet.csv", "--date", WHEN)
    assert (status, said["trusted"], said["flagged"]["disturbed"]) == (1, 0, 200)
    assert said["sd_deg"] is None
    assert rows()[0]["flags"] == "disturbed"


def test_two_sensors_are_compared(capsys) -> None:
    log = simulate("flight", n=300, seed=3, noise=0.0, **FIELD, **WHERE)
    header = "time_s,roll_deg,pitch_deg,heading_deg,mag1_x_nT,mag1_y_nT,mag1_z_nT," + (
        "mag2_x_nT,mag2_y_nT,mag2_z_nT"
    )
    s = log.samples
    turned = log.field_b @ np.array([[1, 0.02, 0], [-0.02, 1, 0], [0, 0, 1.0]]).T
    values = [s.time, s.roll_deg, s.pitch_deg, s.heading_deg, *log.field_b.T, *turned.T]
    np.savetxt("two.csv", np.stack(values, axis=1), delimiter=",", header=header, comments="")
    names = sensors("two.csv")
    compasses = tuple(
        Compass(calibration=Affine(bias=np.zeros(3), matrix=np.eye(3), sensor=n)) for n in names
    )
    save_setup(Setup(compasses=compasses, declination_deg=0.0), "two.toml")
    status, said = answer(capsys, "two.toml", "two.csv")
    assert (status, said["sensors"]) == (0, list(names))
    assert said["disagreement_deg"] == pytest.approx(np.degrees(0.02), rel=0.2)
    assert said["used"] == {names[0]: 300, names[1]: 0}
    save(compasses[0].calibration, "first.json")
    assert run(["heading", "first.json", "two.csv", "-o", "x.csv", "-s", names[1]]) == 2
    heard = capsys.readouterr().err
    assert f"the calibration is of {names[0]}, which two.csv holds too" in heard
    status, alone = answer(capsys, "two.toml", "two.csv", "--sensor", names[1])
    assert (status, alone["sensors"], alone["disagreement_deg"]) == (0, [names[1]], None)


def test_it_says_in_words_what_it_found(capsys) -> None:
    assert run(["heading", "mag.json", "flight.csv", "-o", "out.csv", "--date", WHEN]) == 0
    said = capsys.readouterr().out
    for part in (
        "1\u202f500 of mag, 1\u202f500 to trust",
        "Tilt         roll and pitch of the log",
        "the logged heading: true − logged",
        "out.csv",
    ):
        assert part in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["mag.json", "flight.csv"], "no date"),
        (["mag.json", "placeless.csv", "--date", WHEN], "no position"),
        (["mag.json", "bare.csv", "--date", WHEN], "neither roll and pitch nor an accelerometer"),
        (["mag.json", "flight.csv", "--date", "1850-01-01"], "holds from 1900.0"),
        (["mag.json", "flight.csv", "--date", "soon"], "is not a date"),
        (["mag.json", "flight.csv", "--at", "91,0"], "not a place on Earth"),
        (["mag.json", "flight.csv", "--sensor", "MAG9"], "no sensor 'MAG9'"),
        (["mag.json", "counts.csv", "--date", WHEN], "readings in nT and these are in raw"),
        (["mag.json", "flight.csv", "--unit", "furlong"], "furlong"),
        (["mag.json", "gone.csv"], "no such file"),
        (["gone.toml", "flight.csv"], "there is no such file"),
        (["flight.csv", "flight.csv"], "a setup (TOML) or a calibration file"),
        (["wrong.toml", "flight.csv"], "has no key `colour`"),
        (["other.toml", "flight.csv"], "a compass for MAG7, MAG8 and flight.csv holds mag"),
        (["other.toml", "flight.csv", "--sensor", "mag"], "none for mag"),
    ],
)
def test_bad_input_is_exit_status_2_and_one_line(arguments, said, capsys) -> None:
    Path("counts.csv").write_text("mag_x,mag_y,mag_z,roll_deg,pitch_deg\n1,2,3,0,0\n2,3,4,0,0\n")
    Path("wrong.toml").write_text('[[compass]]\ncalibration = "mag.json"\ncolour = "red"\n')
    Path("other.toml").write_text(
        '[[compass]]\ncalibration = "mag.json"\nsensor = "MAG7"\n'
        '[[compass]]\ncalibration = "mag.json"\nsensor = "MAG8"\n'
    )
    capsys.readouterr()
    for more in ([], ["--json"]):
        assert run(["heading", *arguments, "-o", "out.csv", *more]) == 2
        heard = capsys.readouterr()
        assert heard.out.startswith('{"schema": "agonic/error@1"') if more else not heard.out
        assert heard.err.startswith("agonic: ")
        assert heard.err.count("\n") == 1
        assert said in heard.err
    assert not Path("out.csv").exists()


def test_a_sensor_that_sits_by_right_angles_is_turned_into_the_vehicle(capsys) -> None:
    """The same flight with x up and y forward: the same headings, and their standard errors."""
    flight = ag.read("flight.csv")
    axes = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x up, y forward
    own = replace(load("mag.json"), covariance=None)
    matrix = axes @ own.matrix @ axes.T
    save(own, "plain.json")
    save(replace(own, bias=axes @ own.bias, matrix=matrix, gauge="free"), "sensor.json")
    write_csv(flight.with_columns(field=flight.field @ axes.T), "turned.csv")
    where = ("--date", WHEN, "-o", "out.csv", "--each-row")
    assert run(["heading", "plain.json", "flight.csv", *where]) == 0
    wanted = np.array([row["true_deg"] for row in rows()], dtype=float)
    asked = ["heading", "sensor.json", "turned.csv", *where]
    assert run([*asked, "--mounting", "x up, y forward"]) == 0
    found = np.array([row["true_deg"] for row in rows()], dtype=float)
    assert np.abs((found - wanted + 180.0) % 360.0 - 180.0).max() < 0.01
    capsys.readouterr()
    assert run([*asked, "--mounting", "x up, y down"]) == 2
    assert "is not a mounting" in capsys.readouterr().err


def test_info_shows_readings_in_the_vehicle_s_axes(capsys) -> None:
    assert run(["info", "flight.csv", "--mounting", "x up, y forward", "--json"]) == 0
    turned = json.loads(capsys.readouterr().out)["sensors"][0]
    assert run(["info", "flight.csv", "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)["sensors"][0]
    assert turned["range"][0][0] == pytest.approx(plain["range"][0][1])  # forward was y
    assert any("x points up, y forward, z left" in note for note in turned["notes"])
