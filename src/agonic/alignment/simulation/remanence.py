"""`simulate_remanence`: a platform turned beneath a magnetometer that stands still."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike

from agonic.alignment.simulation.readings import FIELD_N, read_field
from agonic.arrays import Array
from agonic.samples import Samples


def simulate_remanence(
    *,
    remanence: float = 0.0,
    induced: float = 0.0,
    settings: int = 12,
    readings: int = 30,
    noise: float = 0.5,
    drift: float = 5.0,
    field_n: ArrayLike = FIELD_N,
    begins: datetime = datetime(2024, 3, 12, 19, 0, tzinfo=UTC),
    seed: int = 0,
) -> Samples:
    """Readings while the platform goes once round in equal steps, its angle in `heading_deg`.

    Parameters
    ----------
    remanence : nT of its own field at the magnetometer, across the axis; induced : what the ambient
        field makes, going round twice. settings, readings : of the platform, and at each.
    drift : nT of the ambient field meanwhile. noise : nT. field_n : (3,) the ambient field.
    begins : when; seed : of noise, drift and the direction of the platform's field.

    >>> simulate_remanence(settings=8, readings=2).field.shape
    (16, 3)
    """
    rng = np.random.default_rng(seed)
    angle = np.repeat(np.arange(settings) * 360.0 / settings, readings)
    turned = np.radians(angle) + rng.uniform(0, 2 * np.pi)
    time = np.arange(len(angle)) + 20.0 * np.repeat(np.arange(settings), readings)
    own = remanence * _round(turned) + induced * _round(2 * turned)
    ambient = np.asarray(field_n) + drift * (time / time[-1])[:, None] * rng.standard_normal(3)
    return read_field(ambient + own, noise, rng, begins, time, heading_deg=angle)


def _round(angle_rad: Array) -> Array:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad), 0 * angle_rad], axis=1)
