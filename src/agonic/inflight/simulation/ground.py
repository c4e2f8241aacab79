"""A simulated satellite's magnetometer on the ground, in a coil, before it flies."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inflight.simulation.orbit import RANGE_C, SimulatedOrbit
from agonic.samples import Samples
from agonic.simulation.draws import draw_directions

MAGNITUDES = (20_000.0, 55_000.0)
"""Fields of the coil, nT: those that an orbit meets."""
SWEEP_S = 600.0


def simulate_ground(
    made: SimulatedOrbit, *, n: int = 4000, noise: float = 100.0, seed: int = 0
) -> tuple[Samples, Array]:
    """Readings of the same sensor in a coil, and the field (n, 3), body axes, nT.

    The field points in all directions with the magnitudes of an orbit, while the temperature is
    swept over −30 to 50 °C and back every ten minutes.

    Parameters: `n` readings, one a second; `noise` of each on an axis, nT; `seed` of both.
    """
    rng = np.random.default_rng((seed, 7))
    time = np.arange(float(n))
    low, high = RANGE_C
    temperature = (low + high) / 2 - (high - low) / 2 * np.cos(2 * np.pi * time / SWEEP_S)
    field_m = draw_directions(rng, n) * rng.uniform(*MAGNITUDES, (n, 1))
    matrix, bias = made.ground.matrix_at(temperature), made.ground.bias_at(temperature)
    raw = np.linalg.solve(matrix, field_m[..., None])[..., 0] + bias
    samples = Samples(
        time=time,
        field=raw + noise * rng.standard_normal((n, 3)),
        unit="nT",
        temperature=temperature,
        name=made.samples.name,
        notes=("simulated",),
    )
    return samples, np.asarray(made.rot_bm.apply(field_m))
