"""`agonic fit inflight` as a person or a script would run it, one log or a mission."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run

PLAIN = {"n": 4000, "rate_Hz": 0.1, "thermal": 0.0, "external": 0.0, "pointing": "tumble"}


pytestmark = pytest.mark.usefixtures("empty_folder")


def said(capsys, *command: str) -> tuple[int, dict]:
    capsys.readouterr()
    status = run(["fit", "inflight", *command, "--json"])
    return status, json.loads(capsys.readouterr().out)


def orbit(name: str = "orbit.csv", **settings) -> ag.inflight.SimulatedOrbit:
    made = ag.inflight.simulate_orbit(**PLAIN | settings)
    ag.write_csv(made.samples, name)
    held = made.ground.at(20.0)
    covariance = np.diag([100.0] * 3 + [1e-8] * 6)
    ag.save(replace(held, covariance=covariance), "ground.json")
    return made


def test_calibration_and_page_are_written(capsys) -> None:
    made = orbit(moved=900.0, drift=200.0)
    status, found = said(
        capsys, "orbit.csv", "--ground", "ground.json", "-o", "now.json", "--knots", "1"
    )
    assert status == 0
    assert found["files"] == ["now.json", "now.html"]
    now = ag.load("now.json")
    assert np.abs((now.bias - made.bias[-1]) / found["sd"][:3]).max() < 4
    assert "<html" in Path("now.html").read_text(encoding="utf-8")


def test_a_scalar_instrument_in_the_log_teaches_unless_told_not_to(capsys) -> None:
    made = orbit(scalar_sd=0.1, noise=0.3)
    _, scalar = said(capsys, "orbit.csv", "--knots", "0")
    sensitivity = np.linalg.norm(np.linalg.inv(made.truth.matrix_at(20.0)), axis=1)
    off = np.array(scalar["scale_factors"]) - sensitivity
    assert np.abs(off / scalar["scale_factors_sd"]).max() < 4
    assert scalar["noise_nT"] == pytest.approx(0.316, rel=0.05)
    _, model = said(capsys, "orbit.csv", "--knots", "0", "--no-scalar")
    assert model["noise_nT"] == pytest.approx(0.3, rel=0.1)  # no external field here: 0.3
    orbit()
    assert run(["fit", "inflight", "orbit.csv", "--scalar"]) == 2
    assert "no scalar instrument" in capsys.readouterr().err


def test_attitude_currents_and_temperature_from_the_command_line(capsys) -> None:
    made = orbit(attitude_sd_deg=0.1, mounting_deg=30.0)
    _, found = said(capsys, "orbit.csv", "--attitude", "logged", "--knots", "0")
    assert found["direction_error_deg"] == pytest.approx(0.25, abs=0.15)
    turn = np.array(found["alignment_deg"]["rotation_vector"])
    assert np.abs(turn - np.degrees(made.rot_bm.as_rotvec())).max() < 0.1
    assert found["channels"]["azimuth"]["noise_nT"] > found["channels"]["magnitude"]["noise_nT"]
    rng = np.random.default_rng(0)
    current = rng.random(4000)
    field = made.samples.field + np.outer(current, [500.0, 0.0, -200.0])
    ag.write_csv(made.samples.with_columns(field=field, current_A=current), "current.csv")
    _, found = said(
        capsys, "current.csv", "--with", "current_A", "--ground", "ground.json", "--knots", "0"
    )
    assert found["sources"]["current_A"] == pytest.approx([500.0, 0.0, -200.0], abs=40.0)
    _, found = said(capsys, "orbit.csv", "--temperature", "2", "--knots", "0", "-o", "warm.json")
    assert found["calibration_kind"] == "thermal"
    assert ag.load("warm.json").degree == 2


def test_a_mission_of_several_files_is_read_in_pieces(capsys) -> None:
    made = orbit(moved=500.0)
    s = made.samples
    names = []
    for k, rows in enumerate(np.array_split(np.arange(len(s)), 3)):
        names.append(f"part{k}.csv")
        ag.write_csv(s.select(rows), names[-1])
    status, found = said(capsys, *names, "--ground", "ground.json", "--knots", "0", "-o", "m.json")
    assert status == 0
    assert found["n"] == 4000
    assert np.abs((ag.load("m.json").bias - made.bias[-1]) / found["sd"][:3]).max() < 4
    assert Path("m.html").exists()
    assert run(["fit", "inflight", *names, "--between", "0,10"]) == 2
    assert "without --between" in capsys.readouterr().err
    assert run(["fit", "inflight", *names[::-1], "--ground", "ground.json"]) == 2
    assert "in order of time" in capsys.readouterr().err


WRONG = [
    (("orbit.csv", "--attitude", "stars"), "use one of"),
    (("orbit.csv", "--with", "volts"), "volts"),
    (("orbit.csv", "--temperature", "-1"), "temperature_degree"),
    (("orbit.csv", "--within", "0"), "above 0"),
    (("none.csv",), "no such file"),
    (("orbit.csv", "none.csv"), "no such file"),
]


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_bad_input_is_one_line_and_exit_two(options, message: str, capsys) -> None:
    orbit(n=400)
    capsys.readouterr()
    assert run(["fit", "inflight", *options]) == 2
    seen = capsys.readouterr()
    assert message in seen.err
    assert seen.err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.recordings
def test_the_space_station_keeps_one_side_to_the_earth(recordings, capsys) -> None:
    """Direction by the local-vertical attitude, and a shifted clock named."""
    path = recordings / "orbit" / "iss_2021-04-16_all_photos_classified.csv"
    samples = ag.open_log(path, unit="uT").sensors[0]
    samples = samples.select(np.arange(len(samples)) >= 60)
    samples = samples.with_columns(altitude_m=np.full(len(samples), 420e3))
    ag.write_csv(samples, "iss.csv")
    _, found = said(capsys, "iss.csv", "--attitude", "nadir", "--knots", "0")
    assert found["direction_error_deg"] == pytest.approx(0.75, abs=0.05)
    assert np.linalg.norm(found["alignment_deg"]["rotation_vector"]) < 8.0  # axes of the station
    late = samples.select(np.arange(len(samples)) < len(samples) - 400).with_columns(
        latitude_deg=samples.latitude_deg[400:], longitude_deg=samples.longitude_deg[400:]
    )
    assert "in time" in ag.fit_inflight(late, drift_knots=0).status
    west = samples.with_columns(longitude_deg=-samples.longitude_deg)
    assert "counted west" in ag.fit_inflight(west, drift_knots=0).status
    old = samples.with_columns(epoch=samples.epoch.replace(year=1961))
    assert "a date near 20" in ag.fit_inflight(old, drift_knots=0).status


def test_the_world_model_can_be_chosen_and_is_named_everywhere(capsys) -> None:
    orbit()
    asked = ("orbit.csv", "--knots", "0", "--ground", "ground.json", "-o", "now.json")
    for name, official in (("igrf", "IGRF-14"), ("wmm", "WMM2025")):
        _, _ = said(capsys, *asked, "--model", name, "--force")
        assert official in ag.load("now.json").provenance.settings["reference"]
        assert official in Path("now.html").read_text(encoding="utf-8")
        assert run(["fit", "inflight", *asked[:5], "--model", name]) in (0, 1)
        assert official in capsys.readouterr().out
    assert run(["fit", "inflight", "orbit.csv", "--model", "emm"]) == 2
    assert "igrf, wmm" in capsys.readouterr().err


def test_an_altitude_is_given_where_the_table_lacks_it(capsys) -> None:
    made = orbit()
    ag.write_csv(made.samples.with_columns(altitude_m=None), "flat.csv")
    asked = ("--knots", "0", "--ground", "ground.json")
    _, bare = said(capsys, "flat.csv", *asked)
    assert bare["verdict"] == "refused"  # nothing orbits at the height of the sea
    height = str(float(np.mean(made.samples.altitude_m)))
    _, lifted = said(capsys, "flat.csv", *asked, "--altitude", height)
    _, whole = said(capsys, "orbit.csv", *asked)
    off = np.array(lifted["bias_change_nT"]) - whole["bias_change_nT"]
    assert lifted["verdict"] == whole["verdict"]
    assert np.abs(off).max() < 100.0
    assert run(["fit", "inflight", "flat.csv", "--altitude", "5e5", "--tle", "x.tle"]) == 2
    assert "not both" in capsys.readouterr().err
