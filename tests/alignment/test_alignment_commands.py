"""`agonic simulate|fit|plan alignment` as a person at an observatory would run them."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from agonic.cli import run
from agonic.files.calibration import load
from tests.command_line import answer, complaint

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_from_a_simulated_night_to_a_calibration(capsys) -> None:
    status, said = answer(capsys, "simulate", "alignment", "-o", "night", "--seed", "4")
    assert (status, said["orientations"], said["n"]) == (0, 24, 480)
    truth = json.loads(Path("night/truth/truth.json").read_text())
    status, fit = answer(
        capsys, "fit", "alignment", "night", "-o", "cal.json", "--report", "night.html"
    )
    assert (status, fit["schema"], fit["verdict"]) == (0, "agonic/fit-alignment@1", "good")
    assert fit["files"] == ["cal.json", "night.html"]
    off = np.array(fit["angles_323_deg"]) - truth["angles_323_deg"]
    assert np.abs(off * 3600 / fit["angles_323_sd_arcsec"]).max() < 4
    assert fit["worst_sd_arcsec"] < 2.0
    assert len(fit["orientations"]) == 24
    assert {effect["name"] for effect in fit["error_budget"]} >= {"precession", "polar motion"}
    calibration = load("cal.json")
    matrix = np.array(fit["matrix_mc"])
    np.testing.assert_allclose(calibration.rotation.as_matrix(), matrix.T, atol=1e-12)
    assert (calibration.frame_in, calibration.frame_out) == ("m", "c")
    page = Path("night.html").read_text()
    assert page.count('class="dot"') == 48
    assert "polar motion" in page


def test_for_people(capsys) -> None:
    assert run(["simulate", "alignment", "-o", "night"]) == 0
    capsys.readouterr()
    assert run(["fit", "alignment", "night/session.toml", "--solve", "bias"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("✓ magnetometer: good (alignment with a star sensor, 24 orientations)")
    assert "α 36.68" in said
    assert "Bias" in said
    assert "Nothing was written." in said
    assert max(map(len, said.splitlines())) <= 100


def read_next(said: str) -> list[str]:
    """The command after "Next", without "agonic"."""
    return shlex.split(said.split("Next", 1)[1].replace("\\\n", " "))[1:]


@pytest.mark.parametrize("out", ["cal.json", "aligned"])
def test_what_is_said_to_be_next_runs_as_it_is_printed(capsys, out: str) -> None:
    assert run(["simulate", "alignment", "-o", "a night"]) == 0
    simulated = capsys.readouterr().out
    assert run(read_next(simulated.replace("cal.json", out))) == 0
    assert run(read_next(capsys.readouterr().out)) == 0
    assert Path("field.csv").is_file()


def test_a_refused_session_writes_no_calibration(capsys) -> None:
    assert run(["simulate", "alignment", "-o", "night", "--orientations", "1"]) == 0
    status, said = answer(capsys, "fit", "alignment", "night", "-o", "cal.json")
    assert (status, said["verdict"], said["files"]) == (1, "refused", [])
    assert said["rank"] == 2
    assert said["add"]
    assert "the turn of the alignment about the field" in said["undetermined"][0]
    assert not Path("cal.json").exists()


@pytest.mark.slow
def test_a_session_with_a_mistake(capsys) -> None:
    assert run(["simulate", "alignment", "-o", "night"]) == 0
    file = Path("night/session.toml")
    file.write_text(file.read_text().replace("longitude_deg = 12", "longitude_deg = -12"))
    capsys.readouterr()
    assert run(["fit", "alignment", "night", "-o", "cal.json"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "longitude counted west would explain it" in said
    assert not Path("cal.json").exists()


def test_a_plan(capsys) -> None:
    where = ("plan", "alignment", "--at", "52.07,12.68", "--date", "2026-01-01", "--wanted", "2")
    status, said = answer(capsys, *where, "-o", "plan.html")
    assert (status, said["schema"]) == (0, "agonic/plan-alignment@1")
    assert said["worst_sd_arcsec"] <= 2.0
    assert said["field_n_nT"][2] > 40_000
    assert said["sd_arcsec"][0] is None  # one orientation determines nothing
    assert Path("plan.html").read_text().count("<tr>") == len(said["orientations"]) + 1
    assert run([*where, "-o", "plan.txt"]) == 0
    assert "orientations of 20 readings each" in Path("plan.txt").read_text()


def test_bad_input_is_one_line(capsys) -> None:
    assert "there is no such file" in complaint(capsys, "fit", "alignment", "nowhere")
    assert run(["simulate", "alignment", "-o", "night", "--orientations", "3", "-n", "3"]) == 0
    assert "solve 'axes' is not known" in complaint(
        capsys, "fit", "alignment", "night", "--solve", "axes"
    )
    assert "name it .html or .txt" in complaint(
        capsys, "fit", "alignment", "night", "--report", "night.pdf"
    )
    assert "is not LAT,LON" in complaint(capsys, "plan", "alignment", "--at", "here")
    assert "leave the alignment at" in complaint(
        capsys, "plan", "alignment", "--at", "52,12", "--date", "2026-01-01", "--wanted", "0.001"
    )
    assert "No such option: --orientations; see agonic simulate hand --help" in complaint(
        capsys, "simulate", "hand", "-o", "a.csv", "--orientations", "3"
    )
