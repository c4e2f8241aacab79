"""Vehicles with two whole compasses: they turn, rock and accelerate, pass iron, and may fail.

A chain of its own: rotations by angles, errors drawn beside the truth, nothing of agonic's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

FIELD, DIP = 50_000.0, np.radians(65.0)
GRAVITY = 9.81


@dataclass(frozen=True)
class Fault:
    """1: a tilt error, degrees, or a field, nT, of a compass (0 or 1), from so many seconds on."""

    unit: str
    compass: int
    size: float
    since_s: float


@dataclass(frozen=True)
class Drive:
    """Rows of several vehicles: time (n,) s, field (n, v, 2, 3) nT, down (n, v, 2, 3)."""

    time: np.ndarray
    field: np.ndarray
    down: np.ndarray
    heading_deg: np.ndarray
    roll_deg: np.ndarray
    pitch_deg: np.ndarray


def drift(rng, shape, step_s, sd, tau_s):
    """Gauss-Markov noise along the first axis."""
    kept = np.exp(-step_s / tau_s)
    new = rng.normal(size=shape) * np.sqrt(1 - kept**2)
    new[0] /= np.sqrt(1 - kept**2)
    return sd * lfilter([1.0], [1.0, -kept], new, axis=0)


def turning(rng, n, v, step_s):
    """Rates of turn (n, v), rad/s: legs of 8 to 18 s, turns of 60 to 130 degrees."""
    rate = np.zeros((n, v))
    for k in range(v):
        at = 0
        while at < n:
            at += int(rng.uniform(8, 18) / step_s)
            speed = np.radians(rng.uniform(8, 16)) * rng.choice([-1, 1])
            long = int(np.radians(rng.uniform(60, 130)) / abs(speed) / step_s)
            rate[at : at + long, k] = speed
            at += long
    return uniform_filter1d(rate, max(int(2 / step_s), 1), axis=0)


def turn_into_body(vector, heading, roll, pitch):
    """A vector (…, 3) of north, east, down in body axes, heading then pitch then roll."""
    x, y, z = np.moveaxis(vector, -1, 0)
    c, s = np.cos(heading), np.sin(heading)
    x, y = c * x + s * y, c * y - s * x
    c, s = np.cos(pitch), np.sin(pitch)
    x, z = c * x - s * z, c * z + s * x
    c, s = np.cos(roll), np.sin(roll)
    y, z = c * y + s * z, c * z - s * y
    return np.stack([x, y, z], axis=-1)


def passing_iron(rng, n, v, step_s, every_s=600.0):
    """A field (n, v, 3) of iron that is passed in up to 15 s, nT."""
    field = np.zeros((n, v, 3))
    for k in range(v):
        for at in rng.uniform(0, n * step_s, rng.poisson(n * step_s / every_s)):
            half = rng.uniform(2, 7.5)
            rows = slice(max(int((at - half) / step_s), 0), int((at + half) / step_s))
            t = (np.arange(n)[rows] * step_s - at) / half
            shape = (
                np.cos(t * np.pi / 2)[:, None]
                * np.array([np.ones_like(t), np.sin(np.pi * t), np.cos(np.pi * t)]).T
            )
            field[rows, k] += shape * rng.normal(size=3) * rng.uniform(500, 20_000)
    return field


def make_drive(
    seed,
    duration_s,
    vehicles=1,
    rate_hz=10.0,
    fault=None,
    iron=True,
    straight=False,
    anomaly=30.0,
    ripple=0.02,
) -> Drive:
    """Drives of several vehicles, each with sensors of its own."""
    rng = np.random.default_rng(seed)
    step, n, v = 1 / rate_hz, int(duration_s * rate_hz), vehicles
    time = np.arange(n) * step
    rate = np.zeros((n, v)) if straight else turning(rng, n, v, step)
    heading = np.cumsum(rate, axis=0) * step + rng.uniform(0, 2 * np.pi, v)
    waves = [
        np.radians(rng.uniform(*most, v))
        * np.sin(2 * np.pi * time[:, None] / rng.uniform(3, 8, v) + rng.uniform(0, 6, v))
        for most in ((1, 5), (1, 5), (0, 1))
    ]
    roll, pitch = (w + np.radians(drift(rng, (n, v), step, 1.5, 60.0)) for w in waves[:2])
    heading = heading + waves[2]
    place = FIELD * np.array([np.cos(DIP), 0.0, np.sin(DIP)])
    place = place + drift(rng, (n, v, 3), step, anomaly, 60.0)
    disturbed = passing_iron(rng, n, v, step) if iron else np.zeros((n, v, 3))
    speed = 5.0 + drift(rng, (n, v), step, 0.5, 60.0)
    ahead = drift(rng, (n, v), step, ripple, 3.0)
    field, down = np.empty((n, v, 2, 3)), np.empty((n, v, 2, 3))
    for k in range(2):
        share = 1.0 + 0.3 * k
        around = place + disturbed * share
        late = 0.005 * k  # beside the attitude
        own = turn_into_body(around, heading - rate * late, roll, pitch)
        errors = np.eye(3) + rng.normal(scale=0.002, size=(v, 3, 3))
        own = np.einsum("vij,nvj->nvi", errors, own) + rng.normal(scale=100.0, size=(v, 3))
        own += drift(rng, (n, v, 3), step, 40.0, 600.0)
        field[:, :, k] = own + rng.normal(scale=50.0, size=own.shape)
        arm = rng.normal(scale=0.3, size=(v, 2))
        spin = np.gradient(rate, step, axis=0)
        push = np.stack(
            [
                ahead - rate**2 * arm[:, 0] - spin * arm[:, 1],
                speed * rate - rate**2 * arm[:, 1] + spin * arm[:, 0],
            ],
            axis=-1,
        )
        true = turn_into_body(np.array([0.0, 0.0, 1.0]) * np.ones((n, v, 1)), heading, roll, pitch)
        felt = true.copy()
        felt[..., :2] -= push / GRAVITY
        lean = np.radians(rng.normal(scale=0.3, size=(v, 2)))
        lean = lean + np.radians(drift(rng, (n, v, 2), step, 0.05, 300.0))
        felt[..., :2] += lean + np.radians(rng.normal(scale=0.1, size=(n, v, 2)))
        down[:, :, k] = felt
    if fault is not None:
        on = time >= fault.since_s
        way = rng.normal(size=(v, 3))
        if fault.unit == "inclinometer":
            way[:, 2] = 0.0
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        if fault.unit == "magnetometer":
            field[on, :, fault.compass] += fault.size * way
        else:
            down[on, :, fault.compass] += np.tan(np.radians(fault.size)) * way
    down /= np.linalg.norm(down, axis=-1, keepdims=True)
    return Drive(time, field, down, np.degrees(heading), np.degrees(roll), np.degrees(pitch))


def average(drive: Drive, block_s: float) -> tuple[np.ndarray, ...]:
    """Means of blocks: field and down (b, v, 2, 3), strength and vertical less expected (b, v, 2);
    and the level field (b, v, 3) of their last rows."""
    step = drive.time[1] - drive.time[0]
    rows = round(block_s / step)
    b = len(drive.time) // rows
    size = np.linalg.norm(drive.field, axis=-1)
    vertical = (drive.field * drive.down).sum(axis=-1) - size * np.sin(DIP)
    means = [
        values[: b * rows].reshape(b, rows, *values.shape[1:]).mean(axis=1)
        for values in (drive.field, drive.down, size - FIELD, vertical)
    ]
    last = slice(rows - 1, b * rows, rows)
    field, down = drive.field[last].mean(axis=2), drive.down[last].mean(axis=2)
    return (*means, field - (field * down).sum(axis=-1, keepdims=True) * down)
