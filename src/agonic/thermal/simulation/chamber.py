"""What a climatic chamber does to a simulated campaign: its field, its lag, disturbances."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.simulation.draws import draw_directions, make_knots
from agonic.thermal.plan.plan import ThermalPlan

TICK_S = 1.0
"""Between the temperatures that `lagged` takes."""
_SPIKE = (2_000.0, 60_000.0)


def draw_field(
    rng: np.random.Generator, plan: ThermalPlan, sd: float, pace_s: float, drift: float
) -> tuple[Array, Array]:
    """Knots of the chamber's field over the campaign: slow changes, and a steady drift."""
    total = plan.duration_s
    knots = make_knots(total, pace_s)
    dip = np.radians(plan.inclination_deg)
    steady = plan.magnitude * np.array([np.cos(dip), 0.0, np.sin(dip)])
    away = draw_directions(rng, 1)[0] * drift
    values = steady + sd * rng.standard_normal((len(knots), 3))
    return knots, values + np.outer(knots / total - 0.5, away)


def apply_lag(level: Array, lag_s: float) -> Array:
    """A temperature that follows with a lag, τ dT/dt = chamber − T, a value a second."""
    if lag_s <= 0.0:
        return level
    share = 1.0 - np.exp(-TICK_S / lag_s)
    return np.asarray(level[0] + autoregress(share * (level - level[0]), 1.0 - share))


def add_spikes(raw: Array, share: float, rng: np.random.Generator) -> None:
    """Add spikes to a share of the rows."""
    rows = np.flatnonzero(rng.random(len(raw)) < share)
    sizes = rng.uniform(*_SPIKE, len(rows))
    raw[rows] += draw_directions(rng, len(rows)) * sizes[:, None]
