"""What a network has to learn: the published scenario, and a sensor that no affine fits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError, check_choice
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.readable import Readable
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.simulation.draws import draw_directions as random_directions
from agonic.simulation.sensor import simulate

Directions = Literal["planar", "space"]

CHANGE_S = 15.0
"""When the sensor of the paper changes."""
GROUND_BIAS = np.array([-633.2, 1281.7, -455.5])
GROUND_RESPONSE = np.array(
    [[0.9599, -0.0209, -0.0065], [0.0020, 0.9476, -0.0040], [0.0011, 0.0561, 0.9657]]
)
CHANGED_BIAS = np.array([-652.7, 1266.4, -444.49])
CHANGED_RESPONSE = np.array(
    [[0.9579, -0.0209, -0.0065], [0.0020, 0.9456, -0.0040], [0.0011, 0.0561, 0.9637]]
)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedField(Readable):
    """Readings, and the field (n, 3) that they were taken in, in the axes of the sensor, nT."""

    samples: Samples
    field: Array
    facts: Mapping[str, Any]

    @property
    def reference(self) -> Reference:
        """The field at every reading, as a known vector."""
        return Reference.vector(self.field, frame=self.samples.frame, source="simulated")

    def select(self, rows: Index | Mask | slice) -> SimulatedField:
        """Some of the rows."""
        index = np.arange(len(self.field))[rows]
        return SimulatedField(
            samples=self.samples.select(index), field=self.field[index], facts=self.facts
        )


def simulate_paper(
    duration_s: float = 30.0,
    *,
    directions: Directions = "planar",
    rate_Hz: float = 100.0,
    noise: float = 2.0,
    seed: int = 0,
) -> SimulatedField:
    """The simulation of Wang et al. (2020): raw = B₀ + A B + noise, which changes at 15 s.

        B = 4000 + 100 (sin t, cos t, −sin t) nT

    Parameters
    ----------
    duration_s, rate_Hz : length of the record and rows a second (the paper does not say; 100).
    directions : "planar", the field as printed, which never leaves a plane; or "space", where the
        100 nT point in directions that fill space.
    noise : standard deviation of a reading on an axis, nT.
    seed : of noise and directions.

    Source: Wang, Sheng, He & Cheng (2020), Eqs. 1 and 15–17, doi:10.4236/jcc.2020.86004.
    """
    settings = {"kind": "paper", **locals()}
    del settings["duration_s"]
    check_choice("directions", directions, ("planar", "space"))
    n = round(duration_s * rate_Hz)
    if n < 1:
        raise AgonicError(f"{duration_s} s at {rate_Hz} Hz hold no reading")
    time = np.arange(n) / rate_Hz
    noise_rng, way_rng = np.random.default_rng(seed).spawn(2)
    if directions == "planar":
        turning = np.stack([np.sin(time), np.cos(time), -np.sin(time)], axis=1)
    else:
        turning = random_directions(way_rng, n)
    field = 4000.0 + 100.0 * turning
    late = (time >= CHANGE_S)[:, None]
    ground = GROUND_BIAS + field @ GROUND_RESPONSE.T
    changed = CHANGED_BIAS + field @ CHANGED_RESPONSE.T
    raw = np.where(late, changed, ground) + noise * noise_rng.standard_normal((n, 3))
    return SimulatedField(
        samples=Samples(time=time, field=raw, unit="nT", name="paper", notes=("simulated",)),
        field=field,
        facts=MappingProxyType(settings | {"n": n}),
    )


def simulate_nonaffine(
    *,
    n: int = 6000,
    rate_Hz: float = 10.0,
    magnitude: float = 50_000.0,
    noise: float = 20.0,
    saturation: float = 0.02,
    cross: float = 0.01,
    hysteresis: float = 200.0,
    seed: int = 0,
) -> SimulatedField:
    """A tumbling sensor that saturates, mixes its axes, and lags behind its temperature.

        u = A B,   v_i = u_i + cross u_j u_k/F,   raw_i = v_i (1 − saturation (v_i/F)²) + b_i(T, T′)

    with A and the constant bias as `simulate` draws them, F the magnitude, T the temperature, which
    swings by ±25 °C, and T′ what a part that lags a minute behind has; b moves by `hysteresis` nT
    between warming and cooling.

    Parameters
    ----------
    n, rate_Hz : number of rows and rows a second. magnitude : of the field, nT.
    noise : standard deviation of a reading on an axis, nT.
    saturation : share that a reading along the field is short of. cross : how far the product of
        the two other axes reaches over, as a share of the field. hysteresis : nT.
    seed : of everything random.
    """
    settings = {"kind": "nonaffine", **locals()}
    made = simulate("tumble", n=n, rate_Hz=rate_Hz, magnitude=magnitude, noise=0.0, seed=seed)
    bias, matrix = made.truth.bias, made.truth.matrix
    u = np.linalg.solve(matrix, made.field_b.T).T
    v = u + cross * np.roll(u, 1, axis=1) * np.roll(u, 2, axis=1) / magnitude
    raw = v * (1.0 - saturation * (v / magnitude) ** 2) + bias
    time = np.arange(n) / rate_Hz
    rng = np.random.default_rng((seed, 1))
    temperature, lag = _swing(time, rate_Hz, float(rng.uniform(0, 2 * np.pi)))
    way = random_directions(rng, 1)[0]
    raw += hysteresis / 2 * lag[:, None] * way + noise * rng.standard_normal((n, 3))
    assert made.samples.time is not None
    return SimulatedField(
        samples=made.samples.with_columns(field=raw, temperature=temperature, name="bent"),
        field=made.field_b,
        facts=MappingProxyType(settings),
    )


def _swing(time: Array, rate_Hz: float, phase: float) -> tuple[Array, Array]:
    """Temperature (n,) °C, over ten minutes, and how far a part lags behind it, about −1…1."""
    period_s, lag_s, half_C = 600.0, 60.0, 25.0
    before = np.arange(-round(5 * lag_s * rate_Hz), 0) / rate_Hz
    whole = half_C * np.sin(2 * np.pi * np.concatenate([before, time]) / period_s + phase)
    kept = np.exp(-1.0 / (lag_s * rate_Hz))
    behind = autoregress((1 - kept) * (whole - whole[0]), kept) + whole[0]
    away = (whole - behind)[len(before) :]
    turns = 2 * np.pi * lag_s / period_s
    return 15.0 + whole[len(before) :], away / (half_C * turns / np.hypot(1.0, turns))
