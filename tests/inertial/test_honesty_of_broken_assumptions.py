"""Beside accelerometer and gyro where noise is not equal, white and Gaussian: the error over σ."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

import agonic as ag
from tests.inertial.drives import drive, used_error_deg

Fault = Callable[[ag.Samples, np.random.Generator], ag.Samples]


def unequal(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    added = rng.normal(size=samples.field.shape) * [50.0, 150.0, 500.0]
    return samples.with_columns(field=samples.field + added)


def coarse(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    return samples.with_columns(field=2000.0 * np.round(samples.field / 2000.0))


def indoors(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    """800 nT that last for two seconds: iron along the way."""
    slow = gaussian_filter1d(rng.normal(size=samples.field.shape), 50, axis=0)
    return samples.with_columns(field=samples.field + 800.0 * slow / slow.std())


def shaken(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    """0.3 m/s² that last for two seconds."""
    white = rng.normal(size=(len(samples) + 1000, 3))
    slow = 0.3 * np.sqrt(1 - 0.99**2) * lfilter([1], [1, -0.99], white, axis=0)[1000:]
    return samples.with_columns(acceleration=samples.acceleration + slow)


@pytest.mark.slow
@pytest.mark.parametrize("fault", [unequal, coarse, shaken, indoors])
def test_the_stated_error_covers_the_true_one(fault: Fault) -> None:
    z = []
    for seed in range(3):
        made, logged, place = drive(tilt_deg=20.0, seed=seed, n=2000)
        fit = ag.fit_inertial(fault(logged, np.random.default_rng(seed + 7)), place)
        z.append((fit.calibration.bias - made.truth.bias) / fit.sd[:3])
    assert 0.25 < np.sqrt(np.mean(np.square(z))) < 1.6
    assert np.abs(z).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 6])
def test_iron_along_the_way_outweighs_neither_gyro_nor_gravity(seed: int) -> None:
    """Taken for white, its thousands of rows turn the attitude after the field: 4° and more."""
    unit = {"accelerometer_bias": 0.05, "gyro_bias_deg_s": 1.0, "gyro_scale": 0.02}
    made, logged, place = drive("car", seed, rate_Hz=25.0, noise=200.0, unit=unit)
    fit = ag.fit_inertial(indoors(logged, np.random.default_rng(seed)), place)
    assert used_error_deg(fit.calibration, made, 4.0, seed=seed, **unit) < 1.5
