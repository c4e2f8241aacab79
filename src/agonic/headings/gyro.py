"""Down from gyro and accelerometer in motion, by VQF (Laidig & Seel 2023)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from agonic.errors import LogError, MissingExtraError

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

GAP_S = 1.0
"""A longer pause in the log starts the filter anew."""
LONGEST_STEP_S = 0.005
"""Slower logs are interpolated to this: VQF holds a rate for the whole step up to its row."""
SHORTEST = 10
"""Rows without which a stretch between two pauses tells no tilt."""


def down_by_gyro(
    time: Array, specific_force: Array, rotation_rate: Array, settling_s: float
) -> tuple[Array, Array]:
    """The direction of down in body axes, (n, 3), and the size of the lasting specific force.

    The offline filter runs forwards and backwards over evenly spaced rows, so readings are brought
    to even times and its result back. VQF takes the specific force at rest as up and its
    quaternion turns body components into axes whose third is up; the body axes may be any.

    Parameters: time (n,) s; specific_force (n, 3), m/s², and rotation_rate (n, 3), rad/s, in body
    axes; settling_s, the time constant of the accelerometer's pull. Returns down, NaN in stretches
    too short to tell, and the size (n,) of the specific force averaged over `settling_s` in axes
    that do not turn with the body: gravity, unless the vehicle keeps accelerating.

    Raises MissingExtraError without the package vqf.
    """
    down, force = np.full((len(time), 3), np.nan), np.full(len(time), np.nan)
    pauses = np.flatnonzero(np.diff(time) > GAP_S) + 1
    for rows in np.split(np.arange(len(time)), pauses):
        if len(rows) >= SHORTEST:
            down[rows], force[rows] = _stretch(
                time[rows], specific_force[rows], rotation_rate[rows], settling_s
            )
    if np.isnan(down).all():
        raise LogError(
            "the log has pauses so often that no gyro filter can run; take tilt from the log or "
            "from the accelerometer"
        )
    return down, force


def _stretch(
    time: Array, specific_force: Array, rotation_rate: Array, settling_s: float
) -> tuple[Array, Array]:
    try:
        from vqf import offlineVQF
    except ImportError:
        raise MissingExtraError("tilt from gyros", "gyro") from None
    step = float(np.median(np.diff(time)))
    step /= np.ceil(step / LONGEST_STEP_S)
    even = time[0] + step * np.arange(int(np.ceil((time[-1] - time[0]) / step)) + 1)
    force, rate = (
        np.stack([np.interp(even, time, axis) for axis in v.T], axis=1)
        for v in (specific_force, rotation_rate)
    )
    quat_wxyz = offlineVQF(rate, force, None, step, {"tauAcc": settling_s})["quat6D"]
    turn = Rotation.from_quat(np.roll(quat_wxyz, -1, axis=1))
    width = max(round(settling_s / step), 1)
    steady = uniform_filter1d(turn.apply(force), width, axis=0, mode="nearest")
    up = turn.as_matrix()[:, 2]
    down = np.stack([-np.interp(time, even, axis) for axis in up.T], axis=1)
    down /= np.sqrt((down**2).sum(axis=1, keepdims=True))
    return down, np.interp(time, even, np.sqrt((steady**2).sum(axis=1)))
