"""Beside raw accelerometer and gyro, what disturbs on board is found, also by command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.cli import run
from tests.inertial.drives import drive

SOURCES = ("motor1_duty^1.5", "heater_A")
ADDED = np.array([[4000.0, 300.0], [-2500.0, -150.0], [1500.0, 250.0]])


def disturbed(seed: int) -> tuple[ag.Samples, ag.Reference]:
    """A flight with a motor and a heater, both changed by themselves."""
    _, logged, place = drive("flight", seed, n=3000, rate_Hz=25.0, stray_nT_A=(0.0, 0.0, 0.0))
    rng = np.random.default_rng(seed)
    columns = {
        "motor1_duty": np.repeat(rng.uniform(0.2, 0.9, 150), 20),
        "heater_A": np.repeat(rng.integers(0, 2, 60), 50) * 3.0,
    }
    x = np.stack([columns["motor1_duty"] ** 1.5, columns["heater_A"]], axis=1)
    quiet = logged.with_columns(current_A=None, throttle=None)
    return quiet.with_columns(field=quiet.field + x @ ADDED.T, disturbers=columns), place


@pytest.mark.slow
def test_what_disturbs_is_found_within_its_standard_error() -> None:
    ratios = []
    for seed in range(2):
        samples, place = disturbed(seed)
        fit = ag.fit_inertial(samples, place, sources=SOURCES)
        sd = np.sqrt(np.diag(fit.calibration.covariance)[-6:]).reshape(3, 2)
        ratios.append((fit.calibration.coefficients - ADDED) / sd)
    assert abs(np.mean(ratios)) < 0.7
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


@pytest.mark.slow
def test_the_command_takes_sources(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples, _ = disturbed(0)
    ag.write_csv(samples.select(np.arange(1000)), tmp_path / "log.csv")
    log, out = str(tmp_path / "log.csv"), tmp_path / "mag.json"
    at = ["--at", "47,8,500", "--date", "2026-05-01"]
    command = ["fit", "inertial", log, "-o", str(out), *at, "--with", ",".join(SOURCES), "--json"]
    run(command)
    assert json.loads(capsys.readouterr().out)["method"] == "inertial"
    assert ag.load(out).sources == SOURCES
    assert run([*command[:-2], "nothing_A"]) == 2
    assert "holds no nothing_A" in capsys.readouterr().err
