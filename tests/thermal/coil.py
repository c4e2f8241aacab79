"""`simulate_thermal_coil`: a sensor in a coil that steps its field while it grows warm and cold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.simulation.thermal import make_readings


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedThermalCoil:
    """The readings, the coil's field at each of them, and the calibration that undoes them."""

    samples: Samples
    reference: Reference
    truth: Thermal


def simulate_thermal_coil(
    n: int = 4000,
    *,
    range_C: tuple[float, float] = (24.0, 66.0),
    magnitude: float = 50_000.0,
    noise: float = 70.0,
    bias: float = 6700.0,
    drift: float = 1200.0,
    gain: float = 0.05,
    gain_drift: float = 0.02,
    curve: float = 0.01,
    seed: int = 0,
) -> SimulatedThermalCoil:
    """A sensor in a three-axis coil, warmed and cooled: what AERO-VISTA's sensors went through.

        reading = matrix(T)⁻¹ field + bias(T) + noise

    Parameters
    ----------
    n : readings, one a second; the field is another every forty. range_C : of the temperature.
    magnitude : largest component of the field, nT. noise : of a reading, nT.
    bias : length, nT; drift : of it over half the range. gain : how far entries of the matrix are
        from the identity's; gain_drift : their change over half the range, at most.
    curve : share of the linear changes that bends quadratically. seed : of everything random.

    Returns a `SimulatedThermalCoil`. The matrix is not symmetric: the axes of the sensor and of the
    coil differ.

    >>> made = simulate_thermal_coil(400)
    >>> len(made.samples), made.reference.kind, made.truth.gauge
    (400, 'vector', 'free')
    """
    sensor, course = np.random.default_rng(seed).spawn(2)
    low, high = range_C
    centre, half = (low + high) / 2, (high - low) / 2
    level = centre + half * np.sin(np.linspace(0.0, 2 * np.pi, n))
    biases, matrices = np.zeros((3, 3)), np.zeros((3, 3, 3))
    biases[0], biases[1] = _draw_vector(sensor, bias), _draw_vector(sensor, drift)
    matrices[0] = np.eye(3) + gain * sensor.uniform(-1, 1, (3, 3))
    matrices[1] = gain_drift * sensor.uniform(-1, 1, (3, 3))
    biases[2], matrices[2] = curve * biases[1], curve * matrices[1]
    truth = Thermal(
        bias=biases,
        matrix=matrices,
        centre_C=centre,
        half_range_C=half,
        gauge="free",
        frame_out="b",
        validity=Validity(temperature_C=range_C),
    )
    steps = magnitude * course.uniform(-1, 1, (-(-n // 40), 3))
    field = np.repeat(steps, 40, axis=0)[:n]
    raw = make_readings(truth, field, level, np.zeros(n)) + noise * course.standard_normal((n, 3))
    samples = Samples(field=raw, temperature=level, time=np.arange(float(n)), notes=("simulated",))
    return SimulatedThermalCoil(
        samples=samples,
        reference=Reference.vector(field, frame="b", source="the coil, simulated"),
        truth=truth,
    )


def _draw_vector(rng: np.random.Generator, size: float) -> Array:
    """A vector of a length in a random direction."""
    drawn = rng.standard_normal(3)
    return np.asarray(size * drawn / np.linalg.norm(drawn))
