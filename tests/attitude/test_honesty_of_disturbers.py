"""A current's share of the readings where noise is not equal, white and Gaussian: error over σ."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

import agonic as ag
from agonic.simulation import simulate

REFERENCE = ag.Reference.horizontal_vertical(25_000.0, 43_301.27018922)
STRAY = np.array([60.0, -35.0, 90.0])
Array = np.ndarray
Fault = Callable[[ag.Samples, np.random.Generator], ag.Samples]


def _with_memory(memory: float, shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Gauss–Markov noise of variance one."""
    white = rng.normal(size=(shape[0] + 1000, shape[1]))
    return np.sqrt(1 - memory**2) * lfilter([1], [1, -memory], white, axis=0)[1000:]


def lasting(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    return samples.with_columns(
        field=samples.field + 200.0 * _with_memory(0.98, samples.field.shape, rng)
    )


def unequal(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    added = rng.normal(size=samples.field.shape) * [50.0, 150.0, 500.0]
    return samples.with_columns(field=samples.field + added)


def coarse(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    return samples.with_columns(field=2000.0 * np.round(samples.field / 2000.0))


def late(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    before = np.interp(samples.time - 0.1, samples.time, samples.current_A)
    return samples.with_columns(current_A=before)


def noisy(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    """An ammeter whose noise is 0.3 of the current's changes: slopes were off by 3.2 σ."""
    current = samples.current_A
    return samples.with_columns(current_A=current + 0.3 * current.std() * rng.normal(size=2000))


def tilted(samples: ag.Samples, rng: np.random.Generator) -> ag.Samples:
    roll, pitch = _with_memory(0.99, (len(samples), 2), rng).T
    return samples.with_columns(
        roll_deg=samples.roll_deg + roll, pitch_deg=samples.pitch_deg + pitch
    )


@pytest.mark.slow
@pytest.mark.parametrize("fault", [lasting, unequal, coarse, late, noisy, tilted])
def test_bias_and_slopes_are_covered(fault: Fault) -> None:
    bias, slopes = [], []
    for seed in range(8):
        made = simulate("flight", n=2000, rate_Hz=25.0, noise=50.0, stray_nT_A=STRAY, seed=seed)
        rng = np.random.default_rng(seed + 7)
        roll, pitch = 0.5 * rng.normal(size=(2, 2000))
        samples = made.samples.with_columns(
            roll_deg=made.samples.roll_deg + roll,
            pitch_deg=made.samples.pitch_deg + pitch,
            heading_deg=None,
        )
        fit = ag.fit_interference(fault(samples, rng), REFERENCE)
        bias.append((fit.calibration.bias - made.truth.bias) / fit.sd[:3])
        wanted = np.linalg.solve(made.truth.matrix, STRAY)
        sd = np.sqrt(np.diag(fit.covariance))[-3:]
        slopes.append((fit.calibration.coefficients[:, 0] - wanted) / sd)
    for z in (bias, slopes):
        assert 0.35 < np.sqrt(np.mean(np.square(z))) < 1.65
        assert np.abs(z).max() < 4.0


@pytest.mark.slow
def test_a_current_that_changes_as_quickly_as_noise_keeps_its_slope() -> None:
    z = []
    for seed in range(6):
        made = simulate("flight", n=2000, rate_Hz=25.0, noise=50.0, stray_nT_A=STRAY, seed=seed)
        slope = np.linalg.solve(made.truth.matrix, STRAY)
        quick = np.random.default_rng(seed).normal(size=2000)
        samples = made.samples.with_columns(
            field=made.samples.field + np.outer(quick, slope),
            current_A=made.samples.current_A + quick,
            heading_deg=None,
        )
        fit = ag.fit_interference(samples, REFERENCE)
        sd = np.sqrt(np.diag(fit.covariance))[-3:]
        z.append((fit.calibration.coefficients[:, 0] - slope) / sd)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.4
