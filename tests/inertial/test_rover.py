"""A rover on its circles, from the command that makes it to the calibration that it gets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from tests.command_line import answer
from tests.inertial.drives import drive, used_error_deg


def test_a_rover_is_calibrated_beside_its_inertial_unit(
    empty_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The world model's own error is one unknown of all rows and does not spoil the rest."""
    assert answer(capsys, "simulate", "rover", "--seed", "0", "-o", "rover.csv")[0] == 0
    _, told = answer(capsys, "calibrate", "rover.csv", "-o", "out")
    (sensor,) = told["sensors"]
    assert (sensor["method"], sensor["verdict"]) == ("inertial", "good")
    assert sensor["heading_sd_deg"] < 1.5
    truth = ag.load("rover.truth.json")
    ratio = (np.array(sensor["bias"]) - truth.bias) / np.array(sensor["bias_sd"])
    assert np.abs(ratio).max() < 3.0


def test_gross_readings_change_nothing() -> None:
    """Left out where the estimate starts, they were back where the attitude is free: 2 % of them
    took the noise from 200 to 2800 nT, and a rover's log was refused."""
    _, logged, place = drive(n=1500, tilt_deg=5.0)
    rng = np.random.default_rng(1)
    gross = rng.random(1500) < 0.02
    struck = logged.field + gross[:, None] * rng.normal(0, 20_000, (1500, 3))
    clean, spoilt = (
        ag.fit_inertial(samples, place) for samples in (logged, logged.with_columns(field=struck))
    )
    assert spoilt.noise == pytest.approx(clean.noise, rel=0.05)
    assert (np.abs(spoilt.calibration.bias - clean.calibration.bias) < 0.5 * clean.sd[:3]).all()
    assert (spoilt.weights[gross] == 0).mean() > 0.95


@pytest.mark.slow
def test_a_rover_without_a_place_is_calibrated_beside_its_unit_too() -> None:
    made, logged, place = drive(tilt_deg=8.0, n=2500, rate_Hz=20.0)
    size = float(np.linalg.norm(made.field_n))
    beside_place = ag.calibrate(logged, place)
    for given in (None, ag.Reference.constant(size)):
        result = ag.calibrate(logged, given)
        assert (result.method, result.verdict) == ("inertial", "good")
        sd = result.fit.coverage.heading_sd_deg
        assert sd < 1.5
        assert used_error_deg(result.calibration, made, 8.0) < 3 * sd
        assert sd > 0.9 * beside_place.fit.coverage.heading_sd_deg


MOUNTINGS = {
    "z up": np.diag([1.0, -1.0, -1.0]),
    "x down": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
}


def remounted(samples: ag.Samples, turn: np.ndarray) -> ag.Samples:
    """The same drive with the board turned in the vehicle, magnetometer and inertial unit alike."""
    return samples.with_columns(
        field=samples.field @ turn.T,
        acceleration=samples.acceleration @ turn.T,
        rotation_rate=samples.rotation_rate @ turn.T,
    )


@pytest.mark.slow
def test_however_a_board_is_mounted_its_level_heading_is_known_alike() -> None:
    """Level is as the vehicle drives, not z down: those headings alone it will ever have."""
    _, logged, place = drive(n=1500, tilt_deg=4.0)
    whole = ag.calibrate(logged, place)
    for turn in MOUNTINGS.values():
        turned = ag.calibrate(remounted(logged, turn), place)
        assert turned.verdict == whole.verdict
        assert turned.fit.coverage.heading_sd_deg == pytest.approx(
            whole.fit.coverage.heading_sd_deg, rel=1e-3
        )
        assert turned.fit.coverage.turns == whole.fit.coverage.turns


@pytest.mark.slow
def test_a_boat_whose_field_changed_is_calibrated_for_a_stretch_without_a_place_too() -> None:
    made, logged, _ = drive("boat", 1, n=600, rate_Hz=10.0)
    late = (logged.time > logged.time[-1] / 2)[:, None]
    moved = logged.with_columns(field=made.samples.field + late * [8000.0, 5000.0, 0.0])
    result = ag.calibrate(moved)
    assert (result.method, result.verdict) == ("inertial", "check")
    assert result.fit.findings[0].name == "field changed"
    moved_by = np.array([8000.0, 5000.0, 0.0]) * (result.samples.time[0] > logged.time[-1] / 3)
    off = result.calibration.bias - made.truth.bias - moved_by
    assert (np.abs(off) < 3.5 * result.fit.sd[:3]).all()
