"""Logs with values that no sensor gives end in a verdict or in one line, whatever they are."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from agonic.recording.parts import compare_folds, fit_folds

N = 500
TIME = 0.1 * np.arange(N)
ATTITUDE = {
    "roll_deg": 20 * np.sin(TIME),
    "pitch_deg": 15 * np.cos(0.7 * TIME),
    "heading_deg": (30 * TIME) % 360,
}


def field_uT() -> np.ndarray:
    """Readings (n, 3) all round, with a bias of (5, 2, 1) µT."""
    rng = np.random.default_rng(1)
    to = rng.normal(size=(N, 3))
    to /= np.linalg.norm(to, axis=1)[:, None]
    return 50 * to + rng.normal(0, 0.1, (N, 3)) + [5, 2, 1]


def write(name: str, field: np.ndarray, **columns: np.ndarray) -> str:
    """A table of the readings in µT."""
    table = {"time_s": TIME[: len(field)]}
    table |= {f"mag_{axis}_uT": field[:, k] for k, axis in enumerate("xyz")}
    table |= {key: np.broadcast_to(values, len(field)) for key, values in columns.items()}
    rows = np.column_stack(list(table.values())).tolist()
    Path(name).write_text("\n".join([",".join(table), *(",".join(map(repr, r)) for r in rows)]))
    return name


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_magnetometer_of_zeros_beside_an_attitude_is_refused(capsys):
    log = write("zero.csv", np.zeros((N, 3)), **ATTITUDE)
    place = ["--at", "50,10", "--date", "2024-01-01"]
    assert run(["calibrate", log, *place, "-o", "out", "--json"]) == 1
    (sensor,) = json.loads(capsys.readouterr().out)["sensors"]
    assert sensor["verdict"] == "refused"
    assert "never change" in sensor["status"]
    assert run(["fit", "latency", log]) == 2
    assert "never change" in capsys.readouterr().err


def test_readings_beyond_any_sensor_are_left_out_and_counted(capsys):
    field = field_uT()
    field[[50, 300], [0, 2]] = 1e307, -1e20  # finite in µT, the first infinite in nT
    samples = ag.read(write("spikes.csv", field))
    assert len(samples) == N - 2
    assert samples.rejected == {"field beyond what any sensor gives": 2}
    assert run(["calibrate", "spikes.csv", "--field", "50000", "-o", "out", "--json"]) in (0, 1)
    (sensor,) = json.loads(capsys.readouterr().out)["sensors"]
    assert np.allclose(sensor["bias_nT"], [5000, 2000, 1000], atol=60)
    assert run(["calibrate", write("all.csv", 1e304 * field_uT())]) == 2
    assert "beyond what any sensor gives" in capsys.readouterr().err


def test_a_fleet_goes_on_past_a_log_that_cannot_be_drawn_and_one_of_the_year_9999(capsys):
    rng = np.random.default_rng(2)
    short = rng.normal(0, 20, (11, 3))
    short[:, 1] = 5.0
    write("short.csv", short)
    write("late.csv", field_uT(), epoch_unix_s=np.full(N, 2.49e11))
    write("good.csv", field_uT())
    names = ["short.csv", "late.csv", "good.csv"]
    command = ["fleet", *names, "-o", "out", "--workers", "0", "--reports", "--fail-above", "1"]
    for _ in range(2):  # a second run goes on from the first
        assert run(command) == 0, capsys.readouterr().err
    assert Path("out/report.html").stat().st_size > 10_000


def test_a_page_that_fails_costs_a_fleet_that_page_alone(monkeypatch, capsys):
    from agonic.fleet import one_log

    def fail(*_args, **_settings):
        raise StopIteration

    monkeypatch.setattr(one_log, "write_folder", fail)
    log = write("good.csv", field_uT())
    assert run(["fleet", log, "-o", "out", "--workers", "0", "--reports"]) == 0
    from agonic.population import read_population

    (status,) = read_population("out/fleet.parquet")["status"]
    assert "Its files could not be written" in status


@pytest.mark.parametrize(
    "error", [np.linalg.LinAlgError("singular"), RecursionError(), KeyError(3)]
)
def test_what_was_not_foreseen_is_one_line_with_the_command(monkeypatch, capsys, error):
    def fail(*_args, **_settings):
        raise error

    monkeypatch.setattr("agonic.logs.read.open_log", fail)
    assert run(["info", "log.csv"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("agonic: agonic info log.csv: ")
    assert told.count("\n") == 1
    monkeypatch.setenv("AGONIC_DEBUG", "1")
    with pytest.raises(type(error)):
        run(["info", "log.csv"])


def test_a_matrix_that_mirrors_has_no_turn():
    """As a refused fit may have; found by benchmarks/fuzz.py."""
    from agonic.calibration.affine import Affine
    from agonic.recording.quantities import turn_deg

    assert np.isnan(turn_deg(Affine(bias=[0, 0, 0], matrix=-np.eye(3)))).all()
    assert np.allclose(turn_deg(Affine(bias=[0, 0, 0], matrix=2 * np.eye(3))), 0.0)


def test_a_log_whose_name_is_not_utf_8_is_calibrated():
    name = write(os.fsdecode(b"l\xe9og.csv"), field_uT())
    assert run(["calibrate", name, "--field", "50000", "-o", "out"]) in (0, 1)
    assert b"<title>" in Path("out/report.html").read_bytes()


@pytest.mark.parametrize("field", ["1e308", "1e-308"])
def test_a_magnitude_that_is_no_field_is_told(capsys, field):
    assert run(["calibrate", write("log.csv", field_uT()), "--field", field]) == 2
    assert "not a magnetic field" in capsys.readouterr().err


def test_a_half_of_a_log_whose_fit_runs_away_disagrees_with_the_other() -> None:
    """A half at rest may fit a field beyond what any sensor gives; no row of it is lost."""
    samples = ag.Samples(field=1000 * field_uT(), time=TIME, unit="nT")
    whole = ag.fit_ellipsoid(samples, 50_000.0).calibration
    away = replace(whole, bias=whole.bias + 60_000.0, matrix=1e12 * whole.matrix)
    fits = iter([whole, away, *[whole] * 8])
    folds = fit_folds(samples, None, whole, lambda *_: lambda rows: next(fits))
    assert folds is not None
    assert not compare_folds(folds).passed
