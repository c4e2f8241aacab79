"""Flights with truth, and setups for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.headings.compute import heading
from agonic.headings.result import Heading
from agonic.samples import Samples
from agonic.simulation import Simulated, simulate

FIELD = 50_000.0


def flight(seed: int = 1, **settings: Any) -> Simulated:
    """Banked legs in a field of 50 000 nT, dip 65°, declination 2°, without currents."""
    chosen = {
        "n": 2000,
        "noise": 0.0,
        "inclination_deg": 65.0,
        "declination_deg": 2.0,
        "stray_nT_A": (0.0, 0.0, 0.0),
        "magnitude": FIELD,
    }
    return simulate("flight", seed=seed, **chosen | settings)


def setup_for(
    calibration: Any, *, latency_s: float = 0.0, deviation: Any = None, **more: Any
) -> Setup:
    """A setup of one compass that knows delay, declination and field of `flight`."""
    dip = np.radians(65.0)
    known = {
        "declination_deg": 2.0,
        "horizontal": FIELD * np.cos(dip),
        "vertical": FIELD * np.sin(dip),
    }
    compass = Compass(
        calibration=calibration, latency_s=latency_s, latency_sd_s=0.0, deviation=deviation
    )
    return Setup(compasses=(compass,), **known | more)


def plain(name: str = "mag", **more: Any) -> Affine:
    """A calibration that changes nothing and is exactly known."""
    exact = {"covariance": np.zeros((9, 9)), "noise": 0.0, "magnitude": FIELD}
    return Affine(bias=np.zeros(3), matrix=np.eye(3), sensor=name, **exact | more)


def off_deg(found: np.ndarray, wanted: np.ndarray | float) -> np.ndarray:
    """Difference of headings, −180…180."""
    return np.asarray((np.asarray(found) - wanted + 180.0) % 360.0 - 180.0)


def truth_of(samples: Samples) -> np.ndarray:
    assert samples.heading_deg is not None
    return samples.heading_deg


def each_row(samples: Samples | Sequence[Samples], setup: Setup) -> Heading:
    """Headings of rows by themselves, also where there is a gyro."""
    return heading(samples, setup, smooth=False)
