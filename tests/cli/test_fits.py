"""`agonic fit levelled|vector|interference|inflight` and `calibrate --method`, as users do."""

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight of two magnetometers, and the same with something missing."""
    there = tmp_path_factory.mktemp("flights")
    made = ag.simulate_vehicle(n=1200, rate_Hz=10.0, seed=4)
    ag.write_sensors(made.samples, there / "both.csv")
    one = made.samples[0].with_columns(name="mag")
    ag.write_csv(one, there / "one.csv")
    ag.write_csv(one.with_columns(roll_deg=None), there / "no-roll.csv")
    ag.write_csv(one.with_columns(latitude_deg=None), there / "no-place.csv")
    ag.write_csv(one.with_columns(current_A=None), there / "no-current.csv")
    ag.write_csv(one.select(np.arange(3)), there / "three.csv")
    ag.write_csv(one.with_columns(time=None), there / "no-time.csv")
    return there


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict]:
    status = run([*arguments, "--json"])
    return status, json.loads(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["levelled", "vector", "interference"])
def test_a_fit_says_and_writes_what_it_found(kind: str, folder, tmp_path, capsys) -> None:
    out = tmp_path / "mag.json"
    asked = ("fit", kind, str(folder / "one.csv"), "--with", "current_A", "-o", str(out))
    status, found = said(capsys, *asked)
    assert status == 0
    assert found["schema"] == "agonic/fit@1"
    assert (found["method"], found["verdict"]) == (kind, "good")
    assert found["files"] == [str(out)]
    assert ag.load(out).bias.tolist() == found["bias_nT"]
    assert found["heading_sd_deg"] < 1.0


@pytest.mark.slow
def test_a_second_magnetometer_is_named(folder, tmp_path, capsys) -> None:
    arguments = ("fit", "interference", str(folder / "both.csv"), "--sensor", "mag1")
    status, found = said(
        capsys, *arguments, "--with", "second", "--second", "mag2", "-o", str(tmp_path / "m.json")
    )
    assert status in (0, 1)
    assert ag.load(tmp_path / "m.json").sources == ("second",)
    assert "placement" in [finding["name"] for finding in found["findings"]]
    assert run([*arguments, "--with", "second"]) == 2
    assert "second" in capsys.readouterr().err


def test_calibrate_takes_the_method_it_is_told(folder, tmp_path, capsys) -> None:
    for method in ("ellipsoid", "levelled"):
        _, found = said(
            capsys,
            "calibrate",
            str(folder / "one.csv"),
            "-o",
            str(tmp_path / method),
            "--method",
            method,
        )
        assert [sensor["method"] for sensor in found["sensors"]] == [method]
    _, found = said(capsys, "calibrate", str(folder / "one.csv"), "-o", str(tmp_path / "auto"))
    assert found["sensors"][0]["method"] == "vector"
    assert "whole attitude" in found["sensors"][0]["reason"]


def test_inflight_brings_a_ground_calibration_up_to_date(folder, tmp_path, capsys) -> None:
    ground = tmp_path / "ground.json"
    assert run(["fit", "vector", str(folder / "one.csv"), "-o", str(ground), "--with", ""]) in (
        0,
        1,
    )
    capsys.readouterr()
    status, found = said(
        capsys,
        "fit",
        "inflight",
        str(folder / "no-current.csv"),
        "--ground",
        str(ground),
        "-o",
        str(tmp_path / "now.json"),
    )
    assert status in (0, 1)
    assert found["schema"] == "agonic/fit-inflight@1"
    assert found["solve"] == "bias"
    assert set(found["held_out_nT"]) >= {"0", "1"}


WRONG = [
    (("fit", "levelled", "no-roll.csv"), "no roll"),
    (("fit", "levelled", "no-place.csv"), "--at"),
    (("fit", "levelled", "one.csv", "--date", "1700-01-01"), "1700"),
    (("fit", "levelled", "one.csv", "--gauge", "tight"), "gauge"),
    (("fit", "levelled", "one.csv", "--with", "volts"), "volts"),
    (("fit", "levelled", "one.csv", "--between", "0"), "START,STOP"),
    (("fit", "levelled", "one.csv", "--between", "900,999"), "holds no reading"),
    (("fit", "levelled", "three.csv"), "too few"),
    (("fit", "levelled", "both.csv"), "choose one with --sensor"),
    (("fit", "vector", "no-roll.csv"), "no roll"),
    (("fit", "interference", "no-current.csv"), "no current_A"),
    (("fit", "interference", "one.csv", "--with", ""), "name what disturbs"),
    (("fit", "inflight", "no-place.csv"), "positions"),
    (("fit", "inflight", "no-time.csv"), "times"),
    (("fit", "inflight", "one.csv", "--solve", "bias"), "ground"),
    (("fit", "inflight", "one.csv", "--knots", "many"), "--knots"),
    (("fit", "inflight", "one.csv", "--latitudes", "north"), "LOW,HIGH"),
    (("fit", "inflight", "one.csv", "--scalar"), "scalar"),
    (("calibrate", "one.csv", "--method", "best"), "--method"),
    (("calibrate", "no-place.csv", "--method", "levelled"), "field of the place"),
]


@pytest.mark.parametrize(("arguments", "words"), WRONG)
def test_bad_input_is_one_line_and_status_two(
    arguments, words, folder, capsys, monkeypatch
) -> None:
    monkeypatch.chdir(folder)
    assert run(list(arguments)) == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1
