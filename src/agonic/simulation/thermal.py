"""Magnetometers whose calibration drifts with their temperature, drawn at random."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.symmetric import unpack_symmetric

TRUE_DEGREE = 3


def make_readings(truth: Thermal, field: Array, temperature: Array, rate: Array) -> Array:
    """The readings (n, 3) that a sensor gives of a field (n, 3): matrix(T)⁻¹ field + bias(T)."""
    seen = np.linalg.solve(truth.matrix_at(temperature), field[:, :, None])[:, :, 0]
    lag = 0.0 if truth.rate is None else np.outer(rate, truth.rate)
    return np.asarray(seen + truth.bias_at(temperature) + lag)


def random_drifting(
    rng: np.random.Generator,
    *,
    centre_C: float = 20.0,
    half_range_C: float = 30.0,
    bias: float = 20_000.0,
    drift: float = 20_000.0,
    soft_iron: float = 0.03,
    gain_drift: float = 0.01,
    per_rate: float = 0.0,
    sensor: str = "mag",
) -> Thermal:
    """A sensor to find: bias and matrix cubic in temperature."""
    direction = rng.standard_normal(3)
    biases = np.zeros((TRUE_DEGREE + 1, 3))
    biases[0] = bias * direction / np.linalg.norm(direction)
    biases[1:] = _cubics(rng, drift * rng.uniform(0.2, 1.0, 3))
    entries = np.zeros((TRUE_DEGREE + 1, 6))
    entries[0] = [1, 1, 1, 0, 0, 0] + soft_iron * rng.uniform(-1, 1, 6) * [1, 1, 1, 0.5, 0.5, 0.5]
    entries[1:] = _cubics(rng, gain_drift * rng.uniform(0.2, 1.0, 6) * [1, 1, 1, 0.5, 0.5, 0.5])
    return Thermal(
        bias=biases,
        matrix=unpack_symmetric(entries),
        centre_C=centre_C,
        half_range_C=half_range_C,
        rate=per_rate * rng.uniform(-1.0, 1.0, 3),
        sensor=sensor,
        validity=Validity(temperature_C=(centre_C - half_range_C, centre_C + half_range_C)),
    )


def _cubics(rng: np.random.Generator, spans: Array) -> Array:
    """Coefficients (3, m) of x, x², x³ such that each curve spans so much over −1…1."""
    x = np.linspace(-1.0, 1.0, 201)
    powers = np.stack([x, x**2, x**3], axis=1)
    drawn = rng.standard_normal((3, len(spans)))
    return np.asarray(drawn * spans / np.ptp(powers @ drawn, axis=0))
