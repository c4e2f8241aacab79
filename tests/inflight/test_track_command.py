"""`agonic track` as a person or a script would run it."""

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.inflight.simulation.orbit import simulate_orbit
from agonic.simulation import simulate

FIELD = ["--field", "50000"]


pytestmark = pytest.mark.usefixtures("empty_folder")


def said(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


def tumbling(name: str = "log.csv", jump: float = 0.0, **settings):
    made = simulate("tumble", n=3000, noise=100.0, seed=4, **settings)
    field = made.samples.field + np.where(np.arange(3000) >= 1800, jump, 0.0)[:, None]
    ag.write_csv(made.samples.with_columns(field=field), name)
    return made


@pytest.mark.slow
def test_a_log_starts_a_state_and_the_next_resumes_it(capsys) -> None:
    made = tumbling()
    rows = made.samples.columns()["time"] < 20.0
    ag.write_csv(made.samples.select(rows), "first.csv")
    assert run(["track", "first.csv", "--state", "state.json", *FIELD, "--json"]) == 0
    first = said(capsys)
    assert first["schema"] == "agonic/track@1"
    assert first["new"] == rows.sum()
    assert run(["track", "log.csv", "--state", "state.json", *FIELD, "--json"]) == 0
    second = said(capsys)
    assert (second["new"], second["passed_over"]) == ((~rows).sum(), rows.sum())
    error = (np.array(second["bias"]) - made.truth.bias) / second["bias_sd"]
    assert np.abs(error).max() < 4
    assert max(second["bias_sd"]) < max(first["bias_sd"])
    assert second["predicted_rms_nT"] == pytest.approx(100.0, rel=0.1)
    assert run(["track", "log.csv", "--state", "state.json", *FIELD, "--json"]) == 0
    third = said(capsys)
    assert (third["new"], third["bias"]) == (0, second["bias"])


@pytest.mark.slow
def test_people_read_bias_with_its_band(capsys) -> None:
    tumbling()
    assert run(["track", "log.csv", "--state", "state.json", *FIELD]) == 0
    text = capsys.readouterr().out
    assert "✓ mag: good" in text
    assert " ±\N{NO-BREAK SPACE}" in text
    assert "3\u202f000 new; 3\u202f000 in all, 0 did not fit" in text


def test_a_jump_is_named_and_fails_the_check(capsys) -> None:
    tumbling(jump=3000.0)
    assert run(["track", "log.csv", "--state", "state.json", *FIELD, "--json"]) == 1
    found = said(capsys)
    (jump,) = found["jumps"]
    assert jump["time_s"] == pytest.approx(36.0, abs=0.4)
    assert jump["shift"] == pytest.approx([3000.0] * 3, abs=300)
    assert found["verdict"] == "check"
    assert "the bias jumped at 36.0 s" in found["status"].lower()
    assert run(["track", "log.csv", "--state", "other.json", *FIELD]) == 1
    assert "Jump      at 36.0 s" in capsys.readouterr().out


def test_an_orbit_is_followed_from_the_ground_calibration(capsys) -> None:
    made = simulate_orbit(
        n=12_000, moved=2000.0, thermal=0.0, external=0.0, pointing="tumble", seed=2
    )
    ag.write_csv(made.samples, "orbit.csv")
    ground = made.ground.at(20.0)
    covariance = np.diag([20.0**2] * 3 + [3e-4**2] * 6)
    ag.save(
        ag.Affine(bias=ground.bias, matrix=ground.matrix, covariance=covariance, noise=100.0),
        "ground.json",
    )
    options = ["--state", "state.json", "--ground", "ground.json", "--solve", "bias"]
    assert run(["track", "orbit.csv", *options, "--walk", "0.1", "--external", "0", "--json"]) == 0
    found = said(capsys)
    error = np.array(found["bias"]) - made.bias[-1]
    assert np.abs(error / found["bias_sd"]).max() < 4
    assert np.abs(error).max() < 40
    assert np.array(found["matrix"]) == pytest.approx(ground.matrix)
    assert len(found["history"]["time_s"]) == pytest.approx(200, abs=2)


@pytest.mark.slow
def test_a_thermal_ground_calibration_flagged_rows_and_a_resumed_state(capsys) -> None:
    """Two pieces are the whole, with the shape in temperature kept and torquers passed over."""
    made = simulate_orbit(
        n=9000,
        moved=2000.0,
        thermal=1500.0,
        external=0.0,
        pointing="tumble",
        torquer=5000.0,
        torquer_share=0.1,
        seed=6,
    )
    s = made.samples
    ag.write_csv(s, "whole.csv")
    ag.write_csv(s.select(s.time < 4000), "first.csv")
    ag.write_csv(s.select(s.time >= 4000), "second.csv")
    ag.save(made.ground, "ground.json")
    options = [
        "--ground",
        "ground.json",
        "--solve",
        "bias",
        "--noise",
        "100",
        "--walk",
        "0.1",
        "--external",
        "0",
        "--json",
    ]
    assert run(["track", "whole.csv", "--state", "whole.json", *options]) == 0
    whole = said(capsys)
    assert whole["n"] == (s.flagged == 0).sum()
    assert whole["passed_over"] == (s.flagged != 0).sum()
    assert run(["track", "first.csv", "--state", "state.json", *options]) == 0
    capsys.readouterr()
    assert run(["track", "second.csv", "--state", "state.json", *options]) == 0
    pieces = said(capsys)
    assert pieces["n"] == whole["n"]
    assert pieces["bias"] == pytest.approx(whole["bias"], abs=1e-6)
    assert pieces["bias_sd"] == pytest.approx(whole["bias_sd"], rel=1e-9)
    state = ag.inflight.Tracker.resume("state.json").state
    now = state.thermal.bias_at(s.temperature[-1:])[0]
    assert np.abs(now - made.bias[-1]).max() < 30.0
    assert np.ptp(state.thermal.bias_at([-15.0, 35.0]), axis=0) == pytest.approx(
        np.ptp(made.truth.bias_at([-15.0, 35.0]), axis=0), rel=0.02
    )


@pytest.mark.slow
def test_a_scalar_instrument_in_the_log_is_followed(capsys) -> None:
    made = simulate_orbit(
        n=3000, noise=0.3, scalar_sd=0.1, thermal=0.0, external=0.0, pointing="tumble", seed=3
    )
    ag.write_csv(made.samples.with_columns(latitude_deg=None), "log.csv")
    assert run(["track", "log.csv", "--state", "state.json", "--json"]) in (0, 1)
    found = said(capsys)
    assert np.abs(np.array(found["bias"]) - made.bias[-1]).max() < 0.5
    assert found["predicted_rms_nT"] < 5.0  # the first readings among them; 100 by the model
    assert run(["track", "log.csv", "--state", "other.json", "--no-scalar"]) == 2
    assert "field at the readings is not known" in capsys.readouterr().err
    flagged = made.samples.with_columns(flagged=np.ones(3000))
    ag.write_csv(flagged, "flagged.csv")
    assert run(["track", "flagged.csv", "--state", "third.json"]) == 2
    assert "all 3000 readings are flagged" in capsys.readouterr().err


@pytest.mark.slow
def test_the_walk_can_be_chosen_by_prediction(capsys) -> None:
    tumbling()
    options = ["--state", "state.json", *FIELD, "--walk", "auto", "--noise", "100", "--json"]
    assert run(["track", "log.csv", *options]) == 0
    assert said(capsys)["walk"] < 100.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--no-gyro"], "field at the readings is not known"),
        ([*FIELD, "--walk", "fast"], "neither a number"),
        ([*FIELD, "--solve", "nothing"], "solve 'nothing' is not known"),
        ([*FIELD, "--ground", "none.json"], "there is no such file"),
        ([*FIELD, "--sensor", "MAG7"], "MAG7"),
        ([*FIELD, "--noise", "-3"], "above zero"),
    ],
)
def test_bad_input_is_one_line_and_exit_two(options, message: str, capsys) -> None:
    tumbling()
    assert run(["track", "log.csv", "--state", "state.json", *options]) == 2
    seen = capsys.readouterr()
    assert message in seen.err
    assert seen.err.count("\n") == 1
    assert seen.out == ""
    assert not Path("state.json").exists()


def test_settings_cannot_change_under_way(capsys) -> None:
    tumbling()
    assert run(["track", "log.csv", "--state", "state.json", *FIELD]) == 0
    assert run(["track", "log.csv", "--state", "state.json", *FIELD, "--walk", "3"]) == 2
    assert "was started with another walk; leave that out" in capsys.readouterr().err
    assert run(["track", "log.csv", "--state", "state.json", *FIELD, "--walk", "0"]) == 0
    Path("state.json").write_text("{}")
    assert run(["track", "log.csv", "--state", "state.json", *FIELD]) == 2
    assert "not a usable track file" in capsys.readouterr().err
