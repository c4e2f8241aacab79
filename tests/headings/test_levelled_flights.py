"""A vehicle calibrated on one flight by roll and pitch alone, its heading told on another."""

from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.fit import fit_levelled

QUIET = {"sensors": 1, "stray_nT_A": ((0.0, 0.0, 0.0),), "latency_s": 0.0, "heading_sd_deg": 0.0}


def told(seed: int, *, noise: float, attitude_sd_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Error and standard error of every true heading of the second flight."""
    facts = QUIET | {"noise": noise, "attitude_sd_deg": attitude_sd_deg, "n": 2500, "rate_Hz": 25.0}
    first = ag.simulate_vehicle(**facts, seed=seed)
    samples = first.samples[0]
    exact = replace(ag.wmm().along(samples), sd=0.0)  # the field of the simulation is the model's
    fit = fit_levelled(samples, exact, gauge="symmetric")
    assert fit.ok
    other = ag.simulate_vehicle(**facts, seed=seed + 1000, calibrations=first.truths)
    north, east, _ = other.field_n.mean(axis=0)
    setup = ag.Setup(
        compasses=(ag.Compass(calibration=fit.calibration, latency_sd_s=0.0),),
        tilt="log",
        tilt_sd_deg=max(attitude_sd_deg, 1e-3),
        declination_deg=float(np.degrees(np.arctan2(east, north))),
        declination_sd_deg=0.0,
    )
    found = ag.heading(other.samples[0], setup, smooth=False)
    error = (found.true_deg - other.heading_deg + 180.0) % 360.0 - 180.0
    return error, found.sd_deg


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.slow
def test_the_heading_of_another_flight_is_right_to_what_is_stated() -> None:
    """Bank ±27°, one magnetometer, 20 nT noise, full matrix and bias."""
    flights = [told(seed, noise=20.0, attitude_sd_deg=0.0) for seed in range(8)]
    errors, stated = (np.concatenate(part) for part in zip(*flights, strict=True))
    assert max(rms(error) for error, _ in flights) < 0.3
    assert rms(errors) < 1.1 * rms(stated)
    assert rms(errors / stated) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_it_is_with_errors_of_roll_and_pitch_too() -> None:
    flights = [told(seed, noise=100.0, attitude_sd_deg=0.2) for seed in range(12)]
    z = np.concatenate([error / sd for error, sd in flights])
    # attitude errors last for two seconds: some fifty independent headings a flight
    assert rms(z) == pytest.approx(1.0, abs=0.2)
    assert abs(z.mean()) < 0.2
