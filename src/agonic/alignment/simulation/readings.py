"""Readings of a simulated instrument: a true field, white noise, and when they were taken."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from agonic.arrays import Array
from agonic.samples import Samples

FIELD_N = (18_870.0, 1_390.0, 45_750.0)
"""North, east and down at Niemegk in 2024, rounded, nT."""


def read_field(
    true: Array,
    noise: float,
    rng: np.random.Generator,
    begins: datetime,
    time: Array,
    name: str = "magnetometer",
    **columns: Array,
) -> Samples:
    """Readings of a field (n, 3), nT, at seconds (n,) after it begins, with further columns."""
    return Samples(
        field=true + noise * rng.standard_normal(true.shape),
        unit="nT",
        time=np.asarray(time, dtype=np.float64),
        epoch=begins,
        name=name,
        **columns,  # type: ignore[arg-type]
    )


def vary_field(
    time: Array, size: float, periods_s: tuple[float, float, float], rng: np.random.Generator
) -> Array:
    """The ambient field (n, 3) about its mean: a wave on each axis, nT."""
    phase = rng.uniform(0, 6, 3)
    waves = np.sin(2 * np.pi * time[:, None] / np.array(periods_s) + phase)
    return np.asarray(FIELD_N + size * waves)
