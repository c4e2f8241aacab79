"""`agonic simulate orbit` as a person or a script would run it."""

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_the_files_hold_the_readings_and_what_undoes_them(capsys) -> None:
    options = ["-n", "900", "--rate", "0.2", "--noise", "0", "--moved", "2000", "--drift", "100"]
    more = ["--torquer", "3000", "--scalar", "0.1", "--external", "30", "--pointing", "tumble"]
    assert run(["simulate", "orbit", "-o", "day.csv", *options, *more, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["schema"], said["kind"], said["n"]) == ("agonic/simulate@1", "orbit", 900)
    assert said["files"] == ["day.csv", "day.ground.json", "day.truth.json", "day.truth.csv"]
    samples, ground, truth = (
        ag.read("day.csv"),
        ag.load("day.ground.json"),
        ag.load("day.truth.json"),
    )
    assert {"temperature", "latitude_deg", "scalar", "flagged"} <= set(samples.columns())
    assert np.linalg.norm(truth.bias[0] - ground.bias[0]) == pytest.approx(2000.0)
    rows = np.genfromtxt("day.truth.csv", delimiter=",", names=True)
    bias = np.stack([rows[f"bias_{axis}_nT"] for axis in "xyz"], axis=1)
    field = np.stack([rows[f"field_{axis}_nT"] for axis in ("north", "east", "down")], axis=1)
    matrix = truth.matrix_at(samples.temperature)
    size = np.linalg.norm(np.einsum("nij,nj->ni", matrix, samples.field - bias), axis=1)
    quiet = samples.flagged == 0
    np.testing.assert_allclose(size[quiet], np.linalg.norm(field, axis=1)[quiet], atol=0.01)
    assert said["eclipse"] == pytest.approx(rows["eclipse"].mean())


def test_a_word_on_each_file(capsys) -> None:
    assert run(["simulate", "orbit", "-o", "day.csv", "-n", "60"]) == 0
    said = capsys.readouterr().out
    for name in ("60 readings: day.csv", "day.ground.json", "day.truth.json", "day.truth.csv"):
        assert name in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["orbit", "--tilt", "10"], "No such option: --tilt"),
        (
            ["orbit", "--outliers", "0.1"],
            "No such option: --outliers",
        ),
        (
            ["tumble", "--scalar", "0.1"],
            "No such option: --scalar",
        ),
        (["vehicle", "--jump", "5"], "No such option: --jump"),
        (["orbit", "--pointing", "sun"], "pointing 'sun' is not known"),
    ],
)
def test_options_that_do_not_fit_are_refused(arguments: list[str], said: str, capsys) -> None:
    assert run(["simulate", *arguments, "-o", "x.csv", "-n", "20"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert f"agonic simulate {arguments[0]} --help" in error or "No such option" not in said
    assert not Path("x.csv").exists()
