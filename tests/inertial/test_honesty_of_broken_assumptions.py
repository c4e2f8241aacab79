"""Beside accelerometer and gyro where noise is not equal, white and Gaussian: the error over σ."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

import agonic as ag
from tests.inertial.drives import drive

Fault = Callable[[ag.Samples, np.random.Generator], ag.Samples]


def unequal(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    added = rng.normal(size=samples.field.shape) * [50.0, 150.0, 500.0]
    return samples.with_columns(field=samples.field + added)


def coarse(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    return samples.with_columns(field=2000.0 * np.round(samples.field / 2000.0))


def shaken(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    """0.3 m/s² that last for two seconds."""
    white = rng.normal(size=(len(samples) + 1000, 3))
    slow = 0.3 * np.sqrt(1 - 0.99**2) * lfilter([1], [1, -0.99], white, axis=0)[1000:]
    return samples.with_columns(acceleration=samples.acceleration + slow)


@pytest.mark.parametrize("fault", [unequal, coarse, shaken])
def test_the_stated_error_covers_the_true_one(fault: Fault) -> None:
    z = []
    for seed in range(3):
        made, logged, place = drive(tilt_deg=20.0, seed=seed, n=2000)
        fit = ag.fit_inertial(fault(logged, np.random.default_rng(seed + 7)), place)
        z.append((fit.calibration.bias - made.truth.bias) / fit.sd[:3])
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.6
    assert np.abs(z).max() < 4.0
