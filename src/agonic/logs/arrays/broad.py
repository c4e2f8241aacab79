"""The recordings of the Berlin Robust Orientation Estimation Assessment Dataset (BROAD).

Its variables have fixed units: `imu_mag` in µT, `imu_acc` in m/s², `imu_gyr` in rad/s, (n, 3) in
sensor axes. `opt_quat` (n, 4) is w, x, y, z (Hamilton) and turns components in sensor axes into
east, north, up; its north is the magnetic north of the room. The sensor lies face up: its axes
point forward, left and up. All vectors are read into forward, right, down (y and z change their
signs), so that roll, pitch and heading describe a vehicle: lying flat it is level.

Where the optical system lost sight, the attitude is held from the nearest row that has one if the
sensor did not move in between, and interpolated over up to half a second of movement.

Laidig, D., Caruso, M., Cereatti, A., Seel, T., "BROAD — A Benchmark for Robust Inertial
Orientation Estimation", Data 6 (7), 72, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from agonic.arrays import Array, Mask
from agonic.logs.rows.auxiliary import SHORT_REACH_S, measure_reach
from agonic.maths.rotations.attitude import angles_deg

NAMES = {"imu_mag": "mag_uT", "imu_acc": "acc_m_s2", "imu_gyr": "gyro_rad_s"}
NOTE = (
    "BROAD: vectors are in x, −y, −z of the sensor, which are forward, right, down where it lies "
    "flat; roll, pitch and heading are the optical ones; north is magnetic north of the room"
)

_NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FACE_UP = np.diag([1.0, -1.0, -1.0])
_REST_RAD_S = np.radians(2.0)


def is_broad(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether the variables of a file are those of the data set."""
    return {*NAMES, "opt_quat", "sampling_rate"} <= set(arrays)


def rename_variables(
    arrays: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """The variables under names that say their units, with roll, pitch, heading; and notes."""
    seen = np.array(arrays["opt_quat"], dtype=np.float64)
    time = np.arange(len(seen)) / float(arrays["sampling_rate"].reshape(()))
    moving = np.array(np.linalg.norm(arrays["imu_gyr"], axis=1) > _REST_RAD_S)
    if "movement" in arrays:
        moving |= arrays["movement"].astype(bool)
    held = hold_at_rest(seen, moving)
    filled = fill_short_gaps(held, time)
    roll, pitch, heading = compute_attitude_deg(filled)
    named = {NAMES.get(name, name): array for name, array in arrays.items()}
    named |= {name: named[name] @ _FACE_UP for name in NAMES.values()}
    named |= {"roll_deg": roll, "pitch_deg": pitch, "heading_deg": heading}
    lost, still, gone = (int(np.isnan(q).any(axis=1).sum()) for q in (seen, held, filled))
    counts = (
        f"{lost} rows have no optical attitude: {lost - still} at rest take the nearest row's, "
        f"{still - gone} are interpolated"
    )
    return named, (NOTE, *((counts,) if lost else ()))


def compute_attitude_deg(quat_wxyz: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading (n,) by rotations from sensor axes to east, north, up; NaN stays.

    >>> face_up_x_north = np.array([[0.5**0.5, 0.0, 0.0, 0.5**0.5]])
    >>> [(a.round(9) + 0.0).tolist() for a in compute_attitude_deg(face_up_x_north)]
    [[0.0], [0.0], [0.0]]
    """
    known = np.isfinite(quat_wxyz).all(axis=1)
    rot_eb = Rotation.from_quat(quat_wxyz[known], scalar_first=True).as_matrix()
    angles = np.full((3, len(quat_wxyz)), np.nan)
    angles[:, known] = angles_deg(_NED_FROM_ENU @ rot_eb @ _FACE_UP)
    return angles[0], angles[1], angles[2]


def hold_at_rest(quat_wxyz: Array, moving: Mask) -> Array:
    """The rotations with gaps filled from the nearest known row without movement in between."""
    known = np.flatnonzero(np.isfinite(quat_wxyz).all(axis=1))
    if not len(known):
        return quat_wxyz
    rows = np.arange(len(quat_wxyz))
    after = np.searchsorted(known, rows)
    moved = np.cumsum(moving)
    held = quat_wxyz.copy()
    for side in (after - 1, after):
        nearest = known[np.clip(side, 0, len(known) - 1)]
        free = np.isnan(held).any(axis=1) & (moved[nearest] == moved)
        held[free] = quat_wxyz[nearest[free]]
    return held


def fill_short_gaps(quat_wxyz: Array, time: Array) -> Array:
    """The rotations with short gaps filled at constant turn rate."""
    known = np.asarray(np.isfinite(quat_wxyz).all(axis=1))
    if known.sum() < 2:
        return quat_wxyz
    span = time[known][[0, -1]]
    short = ~known & (measure_reach(time[known], time) <= SHORT_REACH_S)
    short &= (time > span[0]) & (time < span[1])
    if not short.any():
        return quat_wxyz
    beside = known & np.convolve(~known, [1, 1, 1], "same").astype(bool)
    path = Slerp(time[beside], Rotation.from_quat(quat_wxyz[beside], scalar_first=True))
    filled = quat_wxyz.copy()
    filled[short] = path(time[short]).as_quat(scalar_first=True)
    return filled
