"""A rover on its circles, from the command that makes it to the calibration that it gets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from tests.command_line import answer


@pytest.mark.parametrize("seed", ["0", "1"])
def test_a_rover_is_calibrated_beside_its_inertial_unit(
    seed: str, empty_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The world model's own error is one unknown of all rows and does not spoil the rest."""
    assert answer(capsys, "simulate", "rover", "--seed", seed, "-o", "rover.csv")[0] == 0
    _, told = answer(capsys, "calibrate", "rover.csv", "-o", "out")
    (sensor,) = told["sensors"]
    assert (sensor["method"], sensor["verdict"]) == ("inertial", "good")
    assert sensor["heading_sd_deg"] < 1.5
    truth = ag.load("rover.truth.json")
    ratio = (np.array(sensor["bias"]) - truth.bias) / np.array(sensor["bias_sd"])
    assert np.abs(ratio).max() < 3.0
