"""What else calibrates a magnetometer beside an inertial unit, written from the literature.

- `by_scipy`: the magnitude alone, nine numbers by `scipy.optimize.least_squares`, no prior.
- `by_vqf`: agonic's levelled fit with the tilt of VQF (Laidig & Seel 2023).
- `by_kalman`: an error-state Kalman filter of attitude, gyro bias, accelerometer bias, magnetometer
  bias and matrix, as of Wu, Zou & Liu, Dynamic magnetometer calibration and alignment to inertial
  sensors by Kalman filtering, IEEE Transactions on Control Systems Technology 26, 2018, with the
  accelerometer as in Solà, Quaternion kinematics for the error-state Kalman filter, 2017.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.headings.acceleration import AT_REST
from agonic.headings.gyro import filter_down
from agonic.maths.rotations import tilt as kernel

GRAVITY = np.array([0.0, 0.0, -9.80665])
Array = np.ndarray


class Found(NamedTuple):
    """Bias (3,), matrix (3, 3), and standard deviations of the bias, where there are any."""

    bias: Array
    matrix: Array
    sd: Array | None = None


def by_vqf(samples: ag.Samples, place: ag.Reference) -> ag.Fit:
    """The levelled fit with the tilt of a filter."""
    found, _ = filter_down(samples.time, samples.acceleration, samples.rotation_rate, 3.0, AT_REST)
    roll, pitch = kernel.roll_pitch_deg(kernel.tilt_from_down(found.down))
    return ag.fit_levelled(samples.with_columns(roll_deg=roll, pitch_deg=pitch), place)


def by_scipy(samples: ag.Samples, magnitude: float) -> Found:
    """The magnitude alone, no prior; from the sphere by linear least squares."""
    raw = samples.field
    upper = np.triu_indices(3)

    def unpack(numbers: Array) -> tuple[Array, Array]:
        matrix = np.zeros((3, 3))
        matrix[upper] = numbers[3:]
        return magnitude * numbers[:3], matrix + np.triu(matrix, 1).T

    def residuals(numbers: Array) -> Array:
        bias, matrix = unpack(numbers)
        return np.linalg.norm((raw - bias) @ matrix.T, axis=1) / magnitude - 1.0

    table = np.column_stack([2 * raw / magnitude, np.ones(len(raw))])  # a sphere: |r|² = 2 b·r + c
    sphere = np.linalg.lstsq(table, ((raw / magnitude) ** 2).sum(axis=1), rcond=None)[0]
    start = np.concatenate([sphere[:3], np.eye(3)[upper]])
    bias, matrix = unpack(least_squares(residuals, start, method="lm").x)
    values, axes = np.linalg.eigh(matrix)
    return Found(bias, axes @ np.diag(np.abs(values)) @ axes.T)


def by_kalman(samples: ag.Samples, field_n: Array, start: ag.Fit, noise_nT: float) -> Found:
    """Forwards once: raw = D Rᵀ B + h, D, h and the biases of the unit constant.

    Starts at a fit by the magnitude, the attitude by the first acceleration and heading, with the
    standard deviations that `fit_inertial` has as priors. Acceleration counts as gravity, with what
    its size scatters.
    """
    size = float(np.linalg.norm(field_n))
    level = np.hypot(*field_n[:2])
    earth = np.array([level, 0.0, field_n[2]]) / size  # north is magnetic north
    raw, force, rate = samples.field / size, samples.acceleration, samples.rotation_rate
    step = float(np.median(np.diff(samples.time)))
    bias, matrix = start.calibration.bias / size, start.calibration.matrix
    h, d = bias.copy(), np.linalg.inv(matrix)
    gyro, lean = np.zeros(3), np.zeros(3)
    attitude = _orient(force[:25].mean(axis=0), matrix @ (raw[:25].mean(axis=0) - bias))
    sds = np.repeat([0.1, np.radians(1.0), 0.1, 0.2, 0.1], [3, 3, 3, 3, 9])
    p = np.diag(sds**2)
    shaken = max(float(np.std(np.linalg.norm(force, axis=1))), 0.02)
    noise = np.diag(np.repeat([shaken**2, (noise_nT / size) ** 2], 3))
    grown = np.zeros(21)
    grown[:3] = (8.7e-4) ** 2 * step
    eye = np.eye(21)
    for row in range(len(raw)):
        if row:
            turned = (rate[row] + rate[row - 1]) / 2 - gyro
            f = eye.copy()
            f[:3, 3:6] = -attitude * step
            attitude = attitude @ Rotation.from_rotvec(turned * step).as_matrix()
            p = f @ p @ f.T
            p[range(21), range(21)] += grown
        up, seen = attitude.T @ GRAVITY, attitude.T @ earth
        left = np.concatenate([force[row] - lean - up, raw[row] - h - d @ seen])
        jacobian = np.zeros((6, 21))  # R → exp(δ) R
        jacobian[:3, :3] = attitude.T @ _skew(GRAVITY)
        jacobian[:3, 6:9] = np.eye(3)
        jacobian[3:, :3] = d @ attitude.T @ _skew(earth)
        jacobian[3:, 9:12] = np.eye(3)
        jacobian[3:, 12:] = np.kron(np.eye(3), seen)
        across = p @ jacobian.T
        gain = np.linalg.solve(jacobian @ across + noise, across.T).T
        error = gain @ left
        p = p - gain @ across.T
        p = (p + p.T) / 2
        attitude = Rotation.from_rotvec(error[:3]).as_matrix() @ attitude
        gyro, lean, h = gyro + error[3:6], lean + error[6:9], h + error[9:12]
        d = d + error[12:].reshape(3, 3)
    return Found(h * size, np.linalg.inv(d), np.sqrt(np.diag(p)[9:12]) * size)


def _orient(force: Array, field: Array) -> Array:
    """The attitude (3, 3) to magnetic north, east, down, by one force and one field."""
    down = -force / np.linalg.norm(force)
    east = np.cross(down, field)
    east /= np.linalg.norm(east)
    return np.stack([np.cross(east, down), east, down])


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
