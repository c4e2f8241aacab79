"""What a fit finds out about the readings goes with the calibration: which second, how late."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.interference import Interference, mean_of
from agonic.calibration.setup import Compass, Setup
from agonic.cli import run
from agonic.files.setup import load_setup, save_setup

LATE_S = 0.100


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two magnetometers, oppositely disturbed, 100 ms late, and two flights of them."""
    there = tmp_path_factory.mktemp("flown")
    settings = {
        "n": 2500,
        "rate_Hz": 25.0,
        "latency_s": LATE_S,
        "placing": "opposite",
        "attitude_sd_deg": 0.05,
        "heading_sd_deg": 0.05,
    }
    made = ag.simulate_vehicle(seed=4, **settings)
    ag.write_sensors(made.samples, there / "both.csv")
    other = ag.simulate_vehicle(seed=5, calibrations=made.truths, **settings)
    ag.write_sensors(other.samples, there / "again.csv")
    ag.write_csv(other.samples[0], there / "alone.csv")
    return there


@pytest.fixture(scope="module")
def mix(flown: Path) -> Path:
    out = flown / "mix.json"
    asked = ["fit", "interference", str(flown / "both.csv"), "--sensor", "mag1"]
    assert run([*asked, "--with", "second", "--second", "mag2", "-o", str(out)]) in (0, 1)
    return out


@pytest.fixture(scope="module")
def late(flown: Path) -> Path:
    out = flown / "late.json"
    log = str(flown / "both.csv")
    assert run(["fit", "vector", log, "-s", "mag1", "--with", "current_A", "-o", str(out)]) == 0
    return out


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict]:
    capsys.readouterr()
    status = run([*arguments, "--json"])
    return status, json.loads(capsys.readouterr().out)


# ------------------------------------------------------------------ the second magnetometer


def test_the_file_names_the_second_magnetometer(mix: Path) -> None:
    kept = ag.load(mix)
    assert isinstance(kept, Interference)
    assert (kept.sources, kept.second_sensor) == (("second",), "mag2")
    turn = ag.alignment.Alignment(rotation=kept_rotation(), frame_in="b", frame_out="b")
    chain = ag.Chain(steps=(kept, turn))
    assert (chain.second_sensor, chain.composed.second_sensor) == ("mag2", "mag2")


def kept_rotation():
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("z", 5, degrees=True)


@pytest.mark.slow
def test_a_mix_finds_its_second_in_another_log(mix: Path, flown: Path, tmp_path, capsys) -> None:
    log = str(flown / "again.csv")
    status, found = said(capsys, "heading", str(mix), log, "-o", str(tmp_path / "h.csv"))
    assert status == 0
    assert found["against_log"]["rms_deg"] < 2.0
    status, found = said(capsys, "verify", str(mix), log)
    assert (status, found["verdict"], found["own_data"]) == (0, "good", False)
    status, found = said(capsys, "apply", str(mix), log, "-o", str(tmp_path / "a.csv"))
    assert status == 0
    corrected = ag.read(tmp_path / "a.csv")
    assert np.linalg.norm(corrected.field, axis=1).std() < 400.0
    page = tmp_path / "r.html"
    assert run(["report", str(mix), log, "-o", str(page)]) in (0, 1)
    assert page.stat().st_size > 10_000


@pytest.mark.slow
def test_in_a_setup_as_well(mix: Path, flown: Path, tmp_path, capsys) -> None:
    setup = save_setup(Setup(compasses=(Compass(calibration=ag.load(mix)),)), tmp_path / "s.toml")
    out = str(tmp_path / "h.csv")
    status, found = said(capsys, "heading", str(setup), str(flown / "again.csv"), "-o", out)
    assert (status, found["sensors"]) == (0, ["mag1"])


def test_the_firmware_says_whose_readings_are_mixed(mix: Path, tmp_path) -> None:
    asked = ["export", str(mix), "--to", "c", "--whole", "--declination", "3"]
    assert run([*asked, "-o", str(tmp_path)]) == 0
    header = (tmp_path / "compass.h").read_text()
    assert "0: mag1, readings in nT, sensor axes, mixed with mag2" in header


def test_a_log_without_the_second_is_refused_in_one_line(mix, flown, tmp_path, capsys) -> None:
    for command in ("heading", "apply"):
        asked = [command, str(mix), str(flown / "alone.csv"), "-o", str(tmp_path / "x.csv")]
        assert run(asked) == 2
        error = capsys.readouterr().err
        assert "mag2" in error
        assert error.count("\n") == 1


def test_a_file_from_before_the_name_was_kept_is_read_and_explained(
    mix, flown, tmp_path, capsys
) -> None:
    old = json.loads(mix.read_text())
    for name in ("second_sensor", "latency_s"):
        del old["calibration"][name]
    path = tmp_path / "old.json"
    path.write_text(json.dumps(old))
    assert ag.load(path).second_sensor is None
    assert ag.load(path).latency_s == 0.0
    assert run(["verify", str(path), str(flown / "again.csv")]) == 2
    assert "does not say which" in capsys.readouterr().err


def test_second_and_with_go_together(flown: Path, capsys) -> None:
    log = ["fit", "levelled", str(flown / "both.csv"), "--sensor", "mag1"]
    assert run([*log, "--second", "mag2"]) == 2
    assert "--with second" in capsys.readouterr().err
    assert run([*log, "--with", "current_A", "--second", "mag2"]) == 2
    assert "--with current_A,second" in capsys.readouterr().err
    assert run([*log, "--with", "second"]) == 2
    assert "mag1, mag2" in capsys.readouterr().err


def test_a_mean_of_two_knows_the_second() -> None:
    one, two = (ag.Affine(bias=np.zeros(3), matrix=np.eye(3), sensor=f"mag{k}") for k in (1, 2))
    assert mean_of(one, two).second_sensor == "mag2"


@pytest.mark.slow
@pytest.mark.recordings
def test_two_compasses_of_a_quadrotor(recordings, tmp_path, capsys) -> None:
    """One carries the motors' field; the other of the same mast shows it; it crashed at 236 s."""
    log, cal = str(recordings / "vehicle/ardupilot/log171.bin"), tmp_path / "mix.json"
    asked = ("fit", "interference", log, "--sensor", "MAG2", "--between", "84,236")
    _, found = said(capsys, *asked, "--with", "second", "--second", "MAG3", "-o", str(cal))
    # its heading is known to 2.3° by what dip and magnitude do not hold: to be looked at
    assert (found["second_sensor"], found["verdict"]) == ("MAG3", "check")
    status, found = said(capsys, "heading", str(cal), log, "-o", str(tmp_path / "h.csv"))
    assert status == 0
    assert found["trusted"] > 0.8 * found["n"]
    assert found["against_log"]["rms_deg"] < 12.0
    assert said(capsys, "verify", str(cal), log)[1]["sensor"] == "MAG2"


# ------------------------------------------------------------------ the latency


def test_the_file_keeps_the_latency(late: Path) -> None:
    assert ag.load(late).latency_s == pytest.approx(LATE_S, abs=0.004)


def heading_rms(capsys, cal: Path, log: Path, out: Path) -> float:
    return said(capsys, "heading", str(cal), str(log), "-o", str(out))[1]["against_log"]["rms_deg"]


@pytest.mark.slow
def test_a_heading_undoes_it_once(late: Path, flown: Path, tmp_path, capsys) -> None:
    """Against the same calibration without it, or with it twice; alone and in a setup."""
    log, out, kept = flown / "again.csv", tmp_path / "h.csv", ag.load(late)
    files = {}
    for share in (0, 1, 2):
        files[share] = ag.save(
            replace(kept, latency_s=share * kept.latency_s), tmp_path / f"{share}.json"
        )
    rms = {share: heading_rms(capsys, file, log, out) for share, file in files.items()}
    assert rms[1] < 0.85 * min(rms[0], rms[2])
    setup = save_setup(Setup(compasses=(Compass(calibration=kept),)), tmp_path / "s.toml")
    assert heading_rms(capsys, setup, log, out) == pytest.approx(rms[1], rel=1e-9)
    bare = tmp_path / "bare.toml"
    bare.write_text(f'[[compass]]\ncalibration = "{late}"\n')
    assert heading_rms(capsys, bare, log, out) == pytest.approx(rms[1], rel=1e-9)


def test_a_setup_may_say_otherwise(late: Path, tmp_path) -> None:
    kept = ag.load(late)
    assert Compass(calibration=kept).latency_s == kept.latency_s
    told = Setup(compasses=(Compass(calibration=kept, latency_s=0.0),))
    assert load_setup(save_setup(told, tmp_path / "s.toml")).compasses[0].latency_s == 0.0


def test_checks_and_tables_are_on_time(late: Path, flown: Path, tmp_path, capsys) -> None:
    log = str(flown / "again.csv")
    never = ag.save(replace(ag.load(late), latency_s=0.0), tmp_path / "never.json")
    dips = []
    for cal in (late, never):
        checks = said(capsys, "verify", str(cal), log)[1]["checks"]
        dips.append(
            {check["name"]: check["value"] for check in checks}["dip against the reference"]
        )
    assert dips[0] < 0.8 * dips[1]
    assert run(["apply", str(late), log, "-o", str(tmp_path / "a.csv")]) == 0
    moved = ag.read(tmp_path / "a.csv").time
    logged = ag.read(flown / "again.csv", sensor="mag1").time
    assert moved[0] - logged[len(logged) - len(moved)] == pytest.approx(
        -ag.load(late).latency_s, abs=1e-6
    )


@pytest.mark.slow
def test_calibrate_writes_it_into_both_files_alike(flown: Path, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    status, found = said(capsys, "calibrate", str(flown / "both.csv"), "-o", str(out))
    assert status in (0, 1)
    for sensor, compass in zip(
        found["sensors"], load_setup(out / "setup.toml").compasses, strict=True
    ):
        assert sensor["latency_s"] == compass.latency_s == compass.calibration.latency_s
        assert abs(sensor["latency_s"] - LATE_S) < 5 * sensor["latency_sd_s"]


# ------------------------------------------------------------------ what is said


@pytest.mark.slow
def test_the_record_tells_sources_gauge_and_latency(flown: Path, capsys) -> None:
    log = ("fit", "vector", str(flown / "both.csv"), "-s", "mag1")
    _, found = said(capsys, *log, "--with", "current_A", "--gauge", "free")
    assert (found["gauge"], found["sources"]) == ("free", ["current_A"])
    assert (len(found["matrix_sd"]), found["second_sensor"]) == (9, None)
    assert np.shape(found["coefficients"]) == np.shape(found["coefficients_sd"]) == (3, 1)
    assert found["latency_s"] == pytest.approx(LATE_S, abs=0.004)
    assert 0 < found["latency_sd_s"] < 0.004
    _, found = said(capsys, *log, "--gauge", "symmetric")
    assert (found["gauge"], len(found["matrix_sd"])) == ("symmetric", 6)
    assert (found["sources"], found["coefficients"]) == (None, None)


@pytest.mark.slow
def test_standard_errors_are_told_of_what_they_are_of(flown: Path, tmp_path, capsys) -> None:
    out = tmp_path / "m.json"
    log = ("fit", "vector", str(flown / "both.csv"), "-s", "mag1", "-o", str(out))
    _, found = said(capsys, *log, "--with", "current_A,throttle", "--gauge", "free")
    kept = ag.load(out)
    sd = dict(zip(kept.parameters, kept.sd, strict=True))
    assert found["matrix_sd"][6] == pytest.approx(sd["matrix_yx"])
    assert found["coefficients_sd"][2][1] == pytest.approx(sd["z_per_throttle"])
    assert found["coefficients"][2][0] == pytest.approx(kept.coefficients[2, 0])


@pytest.mark.slow
def test_the_screen_tells_method_latency_and_current(flown: Path, capsys) -> None:
    run(["fit", "vector", str(flown / "both.csv"), "-s", "mag1", "--with", "current_A"])
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    latency = next(line for line in lines if line.startswith("Latency"))
    assert "ms late relative to the attitude" in latency
    current = next(line for line in lines if line.startswith("Current"))
    assert current.endswith("nT per A (current_A)")
    assert any(line.split(maxsplit=1)[:1] == ["Method"] and " vector: " in line for line in lines)
