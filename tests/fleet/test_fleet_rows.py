"""Rows against the truth, and against what `agonic calibrate` says of the same log."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from agonic.cli import run
from agonic.files.calibration import load
from agonic.fleet import one_log
from agonic.fleet.settings import FleetSettings
from agonic.logs.read import sensors
from agonic.population import read_population
from agonic.recording.calibrated import Calibrated
from tests.fleet.boards import run_here, write_bad, write_boards


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rows")
    write_boards(folder / "good", 4)
    return folder


@pytest.mark.slow
def test_rows_hold_the_truth(tmp_path: Path) -> None:
    truth = write_boards(tmp_path / "logs", 12, first=20)
    population = run_here(tmp_path / "logs", out=tmp_path / "out").population
    assert population["sensor"].tolist() == sorted(truth)
    bias = np.array([truth[name].bias for name in population["sensor"]])
    scaled = (population.bias - bias) / population.bias_sd
    # 36 errors over their standard errors: mean 0, spread 1
    assert abs(scaled.mean()) < 3 / np.sqrt(scaled.size)
    assert 0.6 < scaled.std() < 1.4
    # the magnitude is not given, so matrices are known up to their size
    for matrix, name in zip(population.matrix, population["sensor"], strict=True):
        wanted = np.linalg.inv(truth[name].matrix)
        ratio = matrix @ wanted
        turned = np.linalg.svd(ratio, compute_uv=False)
        assert turned.max() / turned.min() < 1.005


@pytest.mark.parametrize(
    "options", [[], ["--field", "50000"], ["--at", "52,5", "--date", "2026-03-01"]]
)
def test_figures_are_those_of_calibrate(logs: Path, tmp_path: Path, options, capsys) -> None:
    log = logs / "good" / "board001.csv"
    run(["calibrate", str(log), *options, "-o", str(tmp_path / "one"), "--json"])
    (single,) = json.loads(capsys.readouterr().out)["sensors"]
    run(["fleet", str(log), *options, "-o", str(tmp_path / "out"), "--workers", "0", "--json"])
    (row,) = read_population(tmp_path / "out" / "fleet.parquet")
    assert (row.sensor, row.source) == ("board001", str(log))
    assert [row.bias_x, row.bias_y, row.bias_z] == single["bias"]
    assert [row.bias_x_sd, row.bias_y_sd, row.bias_z_sd] == single["bias_sd"]
    matrix = [[getattr(row, f"matrix_{i}{j}") for j in "xyz"] for i in "xyz"]
    assert matrix == single["matrix"]
    names = ("xx", "yy", "zz", "xy", "xz", "yz", "yx", "zx", "zy")
    sd = [getattr(row, f"matrix_{name}_sd") for name in names]
    assert sd[: len(single["matrix_sd"])] == single["matrix_sd"]
    assert all(value is None for value in sd[len(single["matrix_sd"]) :])
    for name in (
        "method",
        "model",
        "verdict",
        "status",
        "gauge",
        "magnitude",
        "noise",
        "spread_before",
        "spread_after",
        "heading_sd_deg",
    ):
        assert getattr(row, name) == single[name], name
    assert (row.rows, row.unit_in) == (single["n"], single["unit"])
    if row.unit_out == "nT":
        assert row.residual_rms == single["residual_rms_nT"]
    assert {finding["name"] for finding in single["findings"]} <= set(row.findings)


@pytest.mark.recordings
def test_an_autopilots_log_has_a_row_for_each_sensor(recordings: Path, tmp_path: Path) -> None:
    log = min(recordings.rglob("*.ulg"), key=lambda path: path.stat().st_size)
    population = run_here(log, out=tmp_path / "out").population
    assert population["channel"].tolist() == sorted(sensors(log))


def test_bad_logs_are_rows_with_their_reason(tmp_path: Path) -> None:
    reasons = write_bad(tmp_path / "logs")
    write_boards(tmp_path / "logs", 1)
    done = run_here(tmp_path / "logs", tmp_path / "logs" / "*.csv", out=tmp_path / "out")
    rows = {Path(row.source).name: row for row in done.population}
    assert rows.pop("board000.csv").verdict == "good"
    assert set(rows) == set(reasons)
    for name, word in reasons.items():
        assert rows[name].verdict == "refused"
        assert word in rows[name].status
        assert str(tmp_path) not in rows[name].status
        assert rows[name].bias_x is None


def test_what_nobody_foresaw_is_a_row_too(logs: Path, tmp_path: Path, monkeypatch) -> None:
    def fails(*_: object, **__: object) -> Calibrated:
        raise ZeroDivisionError("of a kind")

    monkeypatch.setattr(one_log, "calibrate", fails)
    (row,) = run_here(logs / "good" / "board000.csv", out=tmp_path / "out").population
    assert (row.verdict, row.status) == ("refused", "unexpected: ZeroDivisionError: of a kind")
    assert row.sha256
    assert row.duration_s is not None


def test_files_and_reports_are_named_from_the_folder(logs: Path, tmp_path: Path) -> None:
    shutil.copytree(logs / "good", tmp_path / "again")
    write_boards(tmp_path / "again", 1, first=9)  # other content under a name that exists
    shutil.move(tmp_path / "again" / "board009.csv", tmp_path / "again" / "board000.csv")
    inputs = (logs / "good", tmp_path / "again")
    population = run_here(
        *inputs, out=tmp_path / "out", settings=FleetSettings(reports=True)
    ).population
    written = set(population["calibration"])
    assert len(population) == 8
    assert len(written) == 5  # the same content is written once
    for row in population:
        assert row.calibration is not None
        saved = load(tmp_path / "out" / row.calibration)
        assert saved.bias.tolist() == [row.bias_x, row.bias_y, row.bias_z]
        assert "<html" in (tmp_path / "out" / str(row.report)).read_text()


def test_files_that_are_gone_are_written_again(logs: Path, tmp_path: Path) -> None:
    out, settings = tmp_path / "out", FleetSettings(files=True)
    first = run_here(logs / "good", out=out, settings=settings)
    (out / first.population["calibration"][2]).unlink()
    again = run_here(logs / "good", out=out, settings=settings)
    assert (again.calibrated, again.resumed) == (1, 3)
    assert (out / first.population["calibration"][2]).is_file()
    assert not list((out / "calibrations").rglob("*.html"))
