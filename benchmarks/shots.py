"""Accelerometer and magnetometer by shots, beside each calibrated apart: a part of the page of
`benchmarks.inertial`, also alone: python -m benchmarks.shots [--draws 20].

The rival is the method of CircuitPython_mag_cal (P. Underwood), which is no package that pip finds:
an ellipsoid by linear least squares for each sensor, then each turned so that the normals of the
planes through its rolled sets lie along the sight.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.inertial.pair.simulate import SimulatedShots
from agonic.inertial.pair.solve import point_ahead
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from benchmarks import tables

Array = np.ndarray
Sensors = tuple[Callable[[Array], Array], Callable[[Array], Array]]
"""Up and field, in axes whose x is the sight, of readings (n, 3)."""

REAL = """Eight cave-survey instruments, 24 shots each: eight in all attitudes, and two sets of
eight rolled about the sight on one target. Each set by the calibration of all other shots: rms
scatter of the direction of the sight, degrees. Makers aim at 0.5°. Beside it the library's method,
by the same shots, and two ellipsoids apart, along the sight as drawn (+y)."""
SIMULATED = """Simulated instruments, {draws} draws: 0.02 m/s² and 150 nT of noise, 0.1° of
pointing; eight shots in all attitudes and two sets of eight. rms error of the azimuth of the sight
over directions within 60° of level, degrees, the readings then free of noise; and over the standard
error that is stated, rms."""


def by_ellipsoid(readings: Array) -> tuple[Array, Array]:
    """Bias and symmetric matrix: nine numbers of a quadric by linear least squares."""
    x, y, z = readings.T
    rows = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, 2 * readings])
    a, b, c, d, e, f, *line = np.linalg.lstsq(rows, np.ones(len(x)), rcond=None)[0]
    form = np.array([[a, d, e], [d, b, f], [e, f, c]])
    bias = -np.linalg.solve(form, line)
    values, vectors = np.linalg.eigh(form / (1.0 + bias @ form @ bias))
    return bias, vectors * np.sqrt(np.maximum(values, 1e-12)) @ vectors.T


def apart(samples: ag.Samples) -> Sensors:
    """An ellipsoid each; the sight is the axis it is drawn along."""
    found = [by_ellipsoid(one) for one in (samples.acceleration, samples.field)]
    nominal = find_drawn(samples)
    return tuple(_sensor(bias, point_ahead(nominal) @ matrix) for bias, matrix in found)


def along_the_sight(samples: ag.Samples) -> Sensors:
    """An ellipsoid each, turned so that its rolled sets lie across the sight."""
    nominal, sensors = find_drawn(samples), []
    for readings in (samples.acceleration, samples.field):
        bias, matrix = by_ellipsoid(readings)
        total = np.zeros(3)
        for number in np.unique(samples.target[samples.target > 0]):
            points = (readings[samples.target == number] - bias) @ matrix.T
            normal = np.linalg.lstsq(points, np.ones(len(points)), rcond=None)[0]
            total += normal / np.linalg.norm(normal) * np.sign(normal @ nominal)
        sensors.append(_sensor(bias, point_ahead(total) @ matrix))
    return tuple(sensors)


def together(samples: ag.Samples) -> Sensors:
    """Ours."""
    fit = ag.fit_pair(samples)
    return fit.accelerometer.correct, fit.calibration.correct


def _sensor(bias: Array, matrix: Array) -> Callable[[Array], Array]:
    return lambda readings: (readings - bias) @ matrix.T


def find_drawn(samples: ag.Samples) -> Array:
    """The axis of the instrument about which it was rolled."""
    apart = [
        own - own.mean(axis=0)
        for number in np.unique(samples.target[samples.target > 0])
        for own in [samples.acceleration[samples.target == number]]
    ]
    square = (np.concatenate(apart) ** 2).sum(axis=0)
    return np.eye(3)[int(np.argmin(square))]


METHODS = {
    "ellipsoids apart": apart,
    "CircuitPython_mag_cal": along_the_sight,
    "fit_pair": together,
}


def look(sensors: Sensors, samples: ag.Samples) -> Array:
    """The direction of the sight at each shot: north, east, up."""
    up = sensors[0](samples.acceleration)
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    azimuth = np.radians(heading_by_vectors_deg(sensors[1](samples.field), -up))
    level = np.sqrt(1 - up[:, 0] ** 2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up[:, 0]], axis=1)


def scatter_deg(directions: Array) -> float:
    """rms angle from the mean direction."""
    mean = directions.mean(axis=0)
    cosine = directions @ mean / np.linalg.norm(mean)
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))


def real(folder: Path) -> str:
    """The table of the instruments, or a word on why there is none."""
    files = sorted((folder / "instruments").glob("*.csv"))
    if not files:
        return "The recordings of instruments were not found: set AGONIC_RECORDINGS."
    rows, every = [], {name: [] for name in METHODS}
    for file in files:
        shots, cells = ag.read(file), [file.stem]
        for name, method in METHODS.items():
            for held_out in (1, 2):
                sensors = method(shots.select(shots.target != held_out))
                found = scatter_deg(look(sensors, shots.select(shots.target == held_out)))
                every[name].append(found)
                cells.append(f"{found:.2f}")
        rows.append(cells)
    rows.append(["median", *(c for name in METHODS for c in (f"{np.median(every[name]):.2f}", ""))])
    head = [f"{name}: set {k}" for name in METHODS for k in (1, 2)]
    return f"{REAL}\n\n{tables.markdown(['instrument', *head], rows)}"


def errors_deg(sensors: Sensors, made: SimulatedShots) -> Array:
    """Errors of the azimuth of the sight over directions within 60° of level."""
    rng = np.random.default_rng(7)
    angles = np.column_stack([rng.uniform(0, 360, 300), rng.uniform(-60, 60, 300), np.zeros(300)])
    angles[:, 2] = rng.uniform(0, 360, 300)
    rot_nb = Rotation.from_euler("ZYX", angles, degrees=True)
    dip = np.radians(made.inclination_deg)
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True) * 49_000.0
    force = rot_nb.apply([0.0, 0.0, -9.80665], inverse=True)
    mag, acc = made.magnetometer, made.accelerometer
    samples = ag.Samples(
        field=field @ np.linalg.inv(mag.matrix).T + mag.bias,
        acceleration=force @ np.linalg.inv(acc.matrix).T + acc.bias,
        unit="nT",
    )
    north, east, _ = look(sensors, samples).T
    return (np.degrees(np.arctan2(east, north)) - angles[:, 0] + 180) % 360 - 180


def simulated(draws: int) -> str:
    """The table of simulated instruments."""
    rows = []
    for name, method in METHODS.items():
        off, over = [], []
        for seed in range(draws):
            made = ag.inertial.simulate_shots(seed=seed)
            error = errors_deg(method(made.samples), made)
            off.append(np.mean(error**2))
            if method is together:
                stated = ag.fit_pair(made.samples).heading_sd_deg
                over.append(np.mean(error**2) / stated**2)
        said = f"{np.sqrt(np.mean(over)):.2f}" if over else ""
        rows.append([name, f"{np.sqrt(np.mean(off)):.2f}", f"{np.sqrt(np.median(off)):.2f}", said])
    head = ["method", "error, rms", "error, median", "error/sd"]
    return f"{SIMULATED.format(draws=draws)}\n\n{tables.markdown(head, rows)}"


def describe(draws: int) -> str:
    """Both tables, under a heading."""
    folder = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings"))
    return "\n\n".join(["## Shots", real(folder), simulated(draws)])


if __name__ == "__main__":
    print(describe(tables.arguments("accelerometer and magnetometer by shots", draws=20).draws))
