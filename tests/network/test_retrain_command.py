"""`agonic retrain` as a person or a script would run it, and networks in `export` and `report`."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.network.commands.retrain import span

KNOWN = ["--reference", "flight.reference.csv"]


pytestmark = pytest.mark.usefixtures("empty_folder")


def said(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


def flown(*options: str) -> None:
    """The paper's sensor, and a network of what it was before it changed at 15 s."""
    assert run(["simulate", "paper", "-n", "4500", "-o", "flight.csv"]) == 0
    fit = ["fit", "network", "flight.csv", *KNOWN, "--between", "0,14.99", "-o", "ground.json"]
    assert run([*fit, *options]) in (0, 1)  # 1: on an affine sensor the base is as good


@pytest.mark.slow
@pytest.mark.parametrize("base", ["none", "affine"])
def test_published_scenario_from_end_to_end(base: str, capsys) -> None:
    flown("--base", base)
    capsys.readouterr()
    command = ["retrain", "flight.csv", *KNOWN, "--window", "15s", "--every", "15s"]
    assert run([*command, "--ground", "ground.json", "-o", "now.json", "--json"]) == 0
    done = said(capsys)
    assert done["schema"] == "agonic/retrain@1"
    assert (done["verdict"], done["new"], done["passed_over"]) == ("good", 4500, 0)
    [change] = [one for one in done["retrainings"] if one["onset_s"] is not None]
    assert change["accepted"]
    assert change["onset_s"] == pytest.approx(15.0, abs=0.05)
    assert change["running_rms_nT"] > 15.0 > 3.0 > change["candidate_rms_nT"]
    late = slice(1500, None)
    flight, known = ag.read("flight.csv"), ag.read("flight.reference.csv").field
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ag.AgonicWarning)  # the change leads out of the domain
        before, now = (
            np.abs(ag.load(name).correct(flight.field[late]) - known[late])
            for name in ("ground.json", "now.json")
        )
    assert 25.0 < before.max() < 45.0
    assert now.max() < 10.0


@pytest.mark.slow
def test_next_log_goes_on_where_the_last_one_ended(capsys) -> None:
    flown()
    flight = ag.read("flight.csv")
    ag.write_csv(flight.select(flight.time < 20.0), "first.csv")
    command = ["retrain", "first.csv", *KNOWN, "--state", "state.json"]
    assert run([*command, "--window", "10s", "--ground", "ground.json"]) == 0
    text = capsys.readouterr().out
    assert "accepted  change" in text
    assert "Written   state.json" in text
    command[1] = "flight.csv"
    assert run([*command, "--json"]) == 0
    second = said(capsys)
    assert (second["new"], second["passed_over"], second["n"]) == (2500, 2000, 4500)
    assert run([*command, "--json"]) == 0
    third = said(capsys)
    assert (third["new"], third["retrainings"], third["residual_rms_nT"]) == (0, [], None)
    assert run([*command, "--window", "10s"]) == 2
    assert "holds its settings already; leave out --window" in capsys.readouterr().err


@pytest.mark.slow
def test_poisoned_end_of_a_log_is_a_check_with_its_reason(capsys) -> None:
    flown()
    known = ag.read("flight.reference.csv")
    wrong = np.array(known.field)
    wrong[3000:] *= 1000.0
    ag.write_csv(known.with_columns(field=wrong), "wrong.csv")
    capsys.readouterr()
    command = ["retrain", "flight.csv", "--reference", "wrong.csv", "--window", "10s"]
    assert run([*command, "--ground", "ground.json", "-o", "now.json", "--json"]) == 1
    done = said(capsys)
    assert done["verdict"] == "check"
    assert done["findings"][0]["name"] in ("retraining rejected", "change not learned yet")
    rejected = [one for one in done["retrainings"] if one["poisoned"]]
    assert rejected
    assert all("wrong reference" in one["reason"] for one in rejected)
    flight, field = ag.read("flight.csv"), known.field
    now = ag.load("now.json").correct(flight.field[2000:3000]) - field[2000:3000]
    assert np.abs(now).max() < 10.0


def test_magnitude_is_enough_where_no_attitude_is_known(capsys) -> None:
    made = ag.simulate("tumble", n=4000, noise=50.0, seed=3)
    ag.write_csv(made.samples, "log.csv")
    command = ["retrain", "log.csv", "--field", "50000", "--window", "2000", "-o", "now.json"]
    assert run([*command, "--json"]) == 0
    done = said(capsys)
    assert (done["target"], done["kind"]) == ("magnitude", "affine")
    bias = ag.load("now.json").bias
    np.testing.assert_allclose(bias, made.truth.bias, atol=40.0)


@pytest.mark.parametrize(
    ("text", "expected"), [("15s", ("s", 15.0)), ("2 h", ("s", 7200.0)), ("300", ("n", 300.0))]
)
def test_spans(text: str, expected: tuple[str, float]) -> None:
    assert span(text) == expected


@pytest.mark.parametrize("text", ["0s", "x", "1.5", "-3s", "5weeks"])
def test_wrong_span_is_said_in_a_line(text: str, capsys) -> None:
    assert run(["retrain", "flight.csv", f"--window={text}"]) == 2
    assert "is no span" in capsys.readouterr().err


@pytest.mark.slow
def test_page_header_and_report_of_what_was_retrained(capsys) -> None:
    flown("--base", "none", "--report", "fit.html")
    command = ["retrain", "flight.csv", *KNOWN, "--window", "15s", "--ground", "ground.json"]
    assert run([*command, "-o", "now.json", "--report", "flight.html"]) == 0
    assert "retraining accepted" in Path("flight.html").read_text()
    assert "Unseen, network" in Path("fit.html").read_text()
    assert run(["export", "now.json", "--to", "c", "-o", "mag.h"]) == 0
    assert "tanhf" in Path("mag.h").read_text()
    capsys.readouterr()
    assert run(["export", "now.json", "--to", "px4"]) == 2
    assert "is a network" in capsys.readouterr().err
    assert run(["export", "now.json", "--to", "c", "--whole", "--declination", "2"]) == 2
    assert "export it on its own" in capsys.readouterr().err
    assert run(["report", "now.json", "--json"]) == 0
    assert (said(capsys)["method"], Path("now.html").exists()) == ("network", True)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert run(["report", "now.json", "flight.csv", "-o", "log.html"]) in (0, 1)
    assert "outside what the network" in capsys.readouterr().err
    assert "On the log" in Path("log.html").read_text()


@pytest.mark.slow
def test_an_orbit_with_its_network_is_aided_by_attitude(capsys) -> None:
    """The network ends in body axes, as the attitude and the world model do."""
    asked = ("-n", "9000", "--jump", "1500", "--seed", "6", "--external", "0", "--network")
    assert run(["simulate", "orbit", "-o", "orbit.csv", *asked]) == 0
    assert "agonic retrain orbit.csv --ground orbit.network.json" in capsys.readouterr().out
    words = ("retrain", "orbit.csv", "--ground", "orbit.network.json", "--window", "50min")
    assert run([*words, "-o", "now.json", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["target"] == "vector"
    jumped = [one for one in said["retrainings"] if one["why"] == "change" and one["accepted"]]
    assert jumped[0]["onset_s"] == pytest.approx(4500.0, abs=5.0)
    assert said["noise_nT"] == pytest.approx(100.0, rel=0.1)
    before, now = ag.load("orbit.network.json"), ag.load("now.json")
    assert np.linalg.norm(now.base.bias - before.base.bias) == pytest.approx(1500.0, rel=0.1)


def test_an_orbit_with_its_ground_calibration_needs_no_further_word(capsys) -> None:
    """Thermal, in the sensor's axes; the attitude is the body's: the magnitude teaches, and after a
    jump of the bias the ground calibration is brought up to date and keeps its shape over
    temperature."""
    asked = ("-n", "9000", "--jump", "1500", "--seed", "5", "--external", "0")
    assert run(["simulate", "orbit", "-o", "orbit.csv", *asked]) == 0
    capsys.readouterr()
    spans = ("--window", "50min", "--every", "50min")
    words = ("retrain", "orbit.csv", "--ground", "orbit.ground.json", *spans)
    assert run([*words, "--state", "s.json", "-o", "now.json", "--json"]) in (0, 1)
    said = json.loads(capsys.readouterr().out)
    assert said["target"] == "magnitude"
    jumped = [one for one in said["retrainings"] if one["why"] == "change" and one["accepted"]]
    assert jumped[0]["onset_s"] == pytest.approx(4500.0, abs=60.0)
    assert jumped[0]["candidate_rms_nT"] < 0.3 * jumped[0]["running_rms_nT"]
    ground, now = ag.load("orbit.ground.json"), ag.load("now.json")
    assert now.kind == "thermal"
    np.testing.assert_allclose(now.bias[1:], ground.bias[1:])
    assert np.linalg.norm(now.bias[0] - ground.bias[0]) > 300.0
