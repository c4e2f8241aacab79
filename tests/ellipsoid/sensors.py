"""Sensors that a model describes exactly, and the field they are in."""

import numpy as np
import pytest

import agonic as ag
from agonic.simulation import Simulated, random_calibration, simulate

FIELD = 50_000.0
KNOWN = ag.Reference.constant(FIELD)
MODELS = ["sphere", "diagonal", "full"]
FREE = {"sphere": 4, "diagonal": 6, "full": 9}


def made(model: str = "full", kind: str = "sphere", seed: int = 0, **settings) -> Simulated:
    """Readings of a sensor that a model describes exactly."""
    truth = random_calibration(np.random.default_rng(seed), model=model)
    return simulate(kind, calibration=truth, seed=seed, **{"n": 2000, "noise": 100.0, **settings})


def assert_close(affine: ag.Affine, truth: ag.Affine, *, bias: float, matrix: float) -> None:
    assert affine.bias == pytest.approx(truth.bias, abs=bias)
    assert affine.matrix == pytest.approx(truth.matrix, abs=matrix)
