"""Readings beside a gyro with known truth, for tests of what follows them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.simulation import random_calibration

FIELD = 50_000.0


class Turned(NamedTuple):
    """Samples, and what is true: bias, matrix, gyro bias, delay, the field in the sensor's axes."""

    samples: ag.Samples
    bias: np.ndarray
    matrix: np.ndarray
    gyro_bias: np.ndarray
    delay_s: float
    field: np.ndarray

    @property
    def magnitude(self) -> ag.Reference:
        """The length of the field at each reading."""
        return ag.Reference.magnitude(np.linalg.norm(self.field, axis=1))


def accumulate(turns: Rotation) -> Rotation:
    """The products of the first one, two, three … turns, in doubling strides."""
    stride = 1
    while stride < len(turns):
        turns = Rotation.concatenate([turns[:stride], turns[:-stride] * turns[stride:]])
        stride *= 2
    return turns


def turn_about(
    seed: int,
    *,
    n: int = 1200,
    noise: float = 100.0,
    gyro_noise: float = 1e-3,
    gyro_bias: float = 0.05,
    delay: float = 0.02,
    walk: float = 50.0,
    soft_iron: float = 0.0,
    bias: float = 3000.0,
    jump: float = 0.0,
    at: int = 800,
    step: float = 0.05,
) -> Turned:
    """A sensor turned to and fro in a field that wanders, read each `step` s; defaults as stated.

    `gyro_bias`, `delay`, `soft_iron` and `bias` are standard deviations of what is drawn; a `jump`
    comes in a direction of its own and stays.
    """
    rng = np.random.default_rng(seed)
    finer = max(4, round(step / 0.0125))
    time = np.arange(n * finer) * step / finer
    rate = np.zeros((len(time), 3))
    for _ in range(4):
        pace, phase = rng.uniform(0.12, 1.9), rng.uniform(0, 2 * np.pi, 3)
        rate += 0.5 * rng.standard_normal(3) * np.sin(pace * time[:, None] + phase)
    turns = Rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) * step / finer)
    attitude = accumulate(Rotation.concatenate([Rotation.random(random_state=seed), turns]))
    rate = rate[::finer]
    wander = np.cumsum(walk * np.sqrt(step) * rng.standard_normal((n, 3)), axis=0)
    field = FIELD * np.array([0.4, 0.1, 0.91]) + wander
    field = attitude[::finer].inv().apply(field)
    late = delay * rng.standard_normal()
    shown = field + late * np.cross(rate, field)
    truth = random_calibration(rng, soft_iron=soft_iron, cross=soft_iron / 2, bias=bias)
    matrix = truth.matrix if soft_iron else np.eye(3)
    true_bias = np.broadcast_to(truth.bias, (n, 3)).copy()
    way = rng.standard_normal(3)
    true_bias[at:] += jump * way / np.linalg.norm(way)
    raw = shown @ np.linalg.inv(matrix).T + true_bias + noise * rng.standard_normal((n, 3))
    drift = gyro_bias * rng.standard_normal(3)
    read = rate + drift + gyro_noise / np.sqrt(step) * rng.standard_normal((n, 3))
    samples = ag.Samples(time=time[::finer] + 1.0, field=raw, rotation_rate=read)
    return Turned(samples, true_bias, matrix, drift, late, field)
