"""Two sensors of a vehicle, disturbed by one thing that was not recorded: told, and mixed away."""

from __future__ import annotations

import numpy as np
import pytest

import agonic as ag
from agonic.exports.csv import write_sensors
from agonic.recording.each_sensor import calibrate_each, compare, report_pairs
from agonic.simulation import simulate_vehicle
from tests.command_line import complaint


def fly(seed: int, stray_nT_A: tuple[float, float, float], placing: str) -> list[ag.Samples]:
    made = simulate_vehicle(n=2500, seed=seed, stray_nT_A=stray_nT_A, placing=placing)
    return [one.with_columns(current_A=None, throttle=None) for one in made.samples]


def calibrate(sensors: list[ag.Samples]) -> list:
    return [ag.calibrate(one, ag.wmm().along(one)) for one in sensors]


@pytest.mark.slow
def test_opposite_disturbance_is_told_and_mixed_away(tmp_path) -> None:
    sensors = fly(3, (60.0, -35.0, 90.0), "opposite")
    told = report_pairs(calibrate(sensors))
    for one in told:
        (found,) = [f for f in one.fit.findings if f.name == "pair"]
        assert "opposite signs" in found.what
        assert "--second auto" in found.move
        assert one.verdict == "check"
    path = tmp_path / "flight.csv"
    write_sensors(sensors, path)
    _, mixed, _ = calibrate_each(path, second="auto")
    for alone, one in zip(told, mixed, strict=True):
        assert one.verdict == "good"
        if alone.verdict == "good":  # surer alone
            continue
        assert one.method == "interference"
        assert one.verification.spread_after < 0.5 * alone.verification.spread_after
        assert "was mixed in" in one.reason


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_undisturbed_sensors_are_no_pair(seed: int) -> None:
    first, second = calibrate(fly(seed, (0.0, 0.0, 0.0), "apart"))
    assert compare(first, second) is None
    again = report_pairs([first, second])
    assert [one.fit.findings for one in again] == [first.fit.findings, second.fit.findings]


@pytest.mark.slow
def test_what_disturbs_both_alike_has_no_mix() -> None:
    """A field that changes with the way: alike at both, in whatever direction they point."""
    first, second = fly(5, (0.0, 0.0, 0.0), "apart")
    grown = 1 + 0.012 * np.sin(np.arange(len(first)) / 300.0)
    made = simulate_vehicle(n=2500, seed=5, stray_nT_A=(0.0, 0.0, 0.0))
    alike = []
    for one, truth in zip((first, second), made.truths, strict=True):
        field = truth.correct(one.field, current_A=0.0) * grown[:, None]
        raw = field @ np.linalg.inv(truth.matrix).T + truth.bias
        alike.append(one.with_columns(field=raw))
    found = compare(*calibrate(alike))
    assert found is not None
    assert "equal signs" in found.what
    assert "no mix" in found.move


def test_the_command_names_the_sensors_that_there_are(capsys, tmp_path) -> None:
    path = tmp_path / "flight.csv"
    write_sensors(fly(3, (60.0, -35.0, 90.0), "opposite"), path)
    said = complaint(capsys, "calibrate", str(path), "--second", "mag3", "-o", str(tmp_path))
    assert "mag1, mag2" in said
