"""`agonic calibrate --store` and `agonic history`, as a person or a script would run them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run

STORE = ["--store", "boards.sqlite"]


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("AGONIC_STORE", raising=False)
    return tmp_path


def said(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


def calibrated(month: int, moved: float = 0.0) -> None:
    """A log of month 1…, whose bias z drifts by 100 nT a month, calibrated into the store."""
    truth = ag.simulate("tumble", n=200).truth
    scatter = np.random.default_rng(month).normal(0, 10.0, 3)
    bias = truth.bias + scatter + [moved, 0.0, -100.0 * month]
    made = ag.simulate("tumble", calibration=replace(truth, bias=bias), n=400, seed=month)
    ag.write_csv(made.samples, f"{month:02d}.csv")
    year, month_of_year = 2025 + (month - 1) // 12, (month - 1) % 12 + 1
    date = ["--date", f"{year}-{month_of_year:02d}-01", "--field", "50000"]
    assert run(["calibrate", f"{month:02d}.csv", *date, *STORE, "--as", "board-7"]) == 0


def test_from_logs_to_a_history(capsys) -> None:
    for month in range(1, 10):
        calibrated(month)
    calibrated(9)  # again: counts once
    capsys.readouterr()
    assert run(["history", *STORE, "--json"]) == 0
    [listed] = said(capsys)["sensors"]
    assert (listed["sensor"], listed["calibrations"], listed["verdict"]) == ("board-7", 9, "good")
    assert (listed["first"][:10], listed["last"][:10]) == ("2025-01-01", "2025-09-01")

    look = ["history", "board-7", *STORE, "--date", "2025-11-01"]
    assert run([*look, "-o", "page.html", "--json"]) == 0
    told = said(capsys)
    assert told["schema"] == "agonic/history@1"
    assert told["files"] == ["page.html"]
    assert Path("page.html").stat().st_size > 10_000
    trends = {one["parameter"]: one for one in told["trends"]}
    z = trends["bias z"]
    assert abs(z["slope_per_year"] + 1200.0) < 3 * z["slope_sd_per_year"] < 600.0
    assert [one["name"] for one in told["findings"]] == ["drifting"]
    assert len(told["calibrations"]) == 9
    assert told["calibrations"][0]["start"].startswith("2025-01-01")
    assert told["calibrations"][0]["dated"]

    calibrated(10, moved=3000.0)
    capsys.readouterr()
    assert run([*look[:-1], "2025-12-01"]) == 1
    text = capsys.readouterr().out
    assert "! board-7: check" in text
    assert "bias x by +3" in " ".join(text.replace("\u202f", "").split())
    assert "calibrate once more" in text.lower()
    assert run(["history", *STORE]) == 0
    assert "board-7" in capsys.readouterr().out


def test_sensor_is_known_by_its_log_where_nothing_else_is_said(capsys, monkeypatch) -> None:
    ag.write_csv(ag.simulate("tumble", n=300).samples, "seven.csv")
    assert run(["calibrate", "seven.csv", "--field", "50000", *STORE]) == 0
    capsys.readouterr()
    monkeypatch.setenv("AGONIC_STORE", "boards.sqlite")
    assert run(["history", "seven", "--json"]) == 0
    told = said(capsys)
    assert [one["dated"] for one in told["calibrations"]] == [False]
    assert {one["name"] for one in told["findings"]} == {"few calibrations", "dated when added"}
    assert told["trends"] == []


def test_refused_sensors_are_kept_and_said(capsys) -> None:
    made = ag.simulate("circle", tilt_deg=1.0, seed=2)
    ag.write_csv(made.samples, "flat.csv")
    assert run(["calibrate", "flat.csv", *STORE, "--as", "7"]) == 1
    capsys.readouterr()
    assert run(["history", "7", *STORE, "--json"]) == 1
    told = said(capsys)
    assert told["findings"][0]["name"] == "last one refused"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the history of one sensor, and a text that is none."""
    folder = tmp_path_factory.mktemp("kept")
    (folder / "text.csv").write_text("time_s,mag_x_nT\n" * 100)
    log = ag.write_csv(ag.simulate("tumble", n=300).samples, folder / "log.csv")
    store = ["--store", str(folder / "boards.sqlite"), "--as", "7", "-o", str(folder)]
    assert run(["calibrate", str(log), "--field", "50000", *store]) == 0
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name the history"),
        (["--store", "none.sqlite"], "there is no such history"),
        (["--store", "text.csv"], "not a history"),
        (["8", *STORE], "no sensor '8'"),
        (["7", *STORE, "--date", "tomorrow"], "is not a date such as 2026-05-01"),
        ([*STORE, "-o", "page.html"], "are of one sensor"),
        (["7", *STORE, "--date", "1999-01-01"], "before the first"),
    ],
)
def test_bad_input_is_one_line(arguments, words, kept, monkeypatch, capsys) -> None:
    monkeypatch.chdir(kept)
    capsys.readouterr()
    assert run(["history", *arguments]) == 2
    spoken = capsys.readouterr()
    assert spoken.out == ""
    assert words in spoken.err
    assert spoken.err.count("\n") == 1
