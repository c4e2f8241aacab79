"""Named arrays, as MATLAB, NumPy and HDF5 files hold them, made into tables.

The names are those of `columns`. A vector may be one array of three columns or three rows, of four
with the time first, and a sampling rate may stand for the times. Arrays of one length are a table.
Where no name is that of a magnetometer, a lone array of three columns is taken for one.

The Berlin Robust Orientation Estimation Assessment Dataset (BROAD) has `imu_mag` in µT, `imu_acc`
in m/s², `imu_gyr` in rad/s, (n, 3) in sensor axes; `opt_quat` (n, 4), w, x, y, z (Hamilton), turns
components in sensor axes into east, north, up, its north the magnetic north of the room. The sensor
lies face up: vectors are read into forward, right, down (y and z change their signs). Where the
optical system lost sight, the attitude is held from the nearest row that has one if the sensor did
not move in between, and interpolated over up to half a second of movement. Source: Laidig, Caruso,
Cereatti, Seel, "BROAD", Data 6 (7), 72, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from agonic.arrays import Array, Mask
from agonic.logs.groups import Found
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.header import name_quantity, names_reading
from agonic.logs.log import About
from agonic.logs.rows.auxiliary import SHORT_REACH_S, measure_reach
from agonic.maths.rotations.attitude import angles_deg

NAMES = {"imu_mag": "mag_uT", "imu_acc": "acc_m_s2", "imu_gyr": "gyro_rad_s"}
NOTE = (
    "BROAD: vectors are in x, −y, −z of the sensor, which are forward, right, down where it lies "
    "flat; roll, pitch and heading are the optical ones; north is magnetic north of the room"
)

_NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FACE_UP = np.diag([1.0, -1.0, -1.0])


def is_broad(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether the variables of a file are those of the data set."""
    return {*NAMES, "opt_quat", "sampling_rate"} <= set(arrays)


def rename_variables(
    arrays: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """The variables under names that say their units, with roll, pitch, heading; and notes."""
    seen = np.array(arrays["opt_quat"], dtype=np.float64)
    time = np.arange(len(seen)) / float(arrays["sampling_rate"].reshape(()))
    moving = np.array(np.linalg.norm(arrays["imu_gyr"], axis=1) > np.radians(2.0))
    if "movement" in arrays:
        moving |= arrays["movement"].astype(bool)
    rested = fill_at_rest(seen, moving)
    filled = fill_short_gaps(rested, time)
    roll, pitch, heading = compute_attitude_deg(filled)
    named = {NAMES.get(name, name): array for name, array in arrays.items()}
    named |= {name: named[name] @ _FACE_UP for name in NAMES.values()}
    named |= {"roll_deg": roll, "pitch_deg": pitch, "heading_deg": heading}
    lost, still, gone = (int(np.isnan(q).any(axis=1).sum()) for q in (seen, rested, filled))
    counts = (
        f"{lost} rows have no optical attitude: {lost - still} at rest take the nearest row's, "
        f"{still - gone} are interpolated"
    )
    return named, (NOTE, *((counts,) if lost else ()))


def compute_attitude_deg(quat_wxyz: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading (n,) by rotations from sensor axes to east, north, up; NaN stays."""
    known = np.isfinite(quat_wxyz).all(axis=1)
    rot_eb = Rotation.from_quat(quat_wxyz[known], scalar_first=True).as_matrix()
    angles = np.full((3, len(quat_wxyz)), np.nan)
    angles[:, known] = angles_deg(_NED_FROM_ENU @ rot_eb @ _FACE_UP)
    return angles[0], angles[1], angles[2]


def fill_at_rest(quat_wxyz: Array, moving: Mask) -> Array:
    """The rotations with gaps filled from the nearest known row without movement in between."""
    known = np.flatnonzero(np.isfinite(quat_wxyz).all(axis=1))
    if not len(known):
        return quat_wxyz
    rows = np.arange(len(quat_wxyz))
    after = np.searchsorted(known, rows)
    moved = np.cumsum(moving)
    filled = quat_wxyz.copy()
    for side in (after - 1, after):
        nearest = known[np.clip(side, 0, len(known) - 1)]
        free = np.isnan(filled).any(axis=1) & (moved[nearest] == moved)
        filled[free] = quat_wxyz[nearest[free]]
    return filled


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


Arrays = Mapping[str, NDArray[Any]]


def find_tables(arrays: Arrays, about: About) -> Found:
    """The tables that named arrays are, without names of their own."""
    remarks: tuple[str, ...] = ()
    if is_broad(arrays):
        arrays, remarks = rename_variables(arrays)
    tables, unused = build_tables(arrays)
    others = [*unused, *about.get("others", ())]
    return Found(dict(enumerate(tables)), {**about, "others": others, "remarks": remarks})


def build_tables(arrays: Arrays) -> tuple[list[dict[str, NDArray[Any]]], list[str]]:
    """The columns that are understood, a table for each length, and the names of other arrays."""
    found = _find_columns(arrays)
    if not any(
        name_quantity(header) == "field" for columns in found.values() for header in columns
    ):
        found |= _find_lone(arrays, found)
    tables: dict[int, dict[str, NDArray[Any]]] = {}
    for columns in found.values():
        for header, values in columns.items():
            tables.setdefault(len(values), {})[header] = values
    named = [array for name, array in arrays.items() if is_sampling_rate(name)]
    rates = (float(a.reshape(())) for a in named if a.size == 1 and a.dtype.kind in "fiu")
    rate = next(rates, 0.0)
    for rows, table in tables.items():
        if 0 < rate < np.inf and "time" not in map(name_quantity, table):
            table["time_s"] = np.arange(rows) / rate
    ordered = sorted(tables.values(), key=lambda table: "field" not in map(name_quantity, table))
    return ordered, [name for name in arrays if name not in found]


def _find_columns(arrays: Arrays) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of each array that are understood, by its name."""
    every = {name: _columns(name, np.squeeze(array)) for name, array in arrays.items()}
    headers = [header for columns in every.values() for header in columns]
    ours = dict(zip(headers, rename_headers(headers), strict=True))
    known = {
        name: {ours[h]: values for h, values in columns.items() if name_quantity(ours[h])}
        for name, columns in every.items()
    }
    return {name: columns for name, columns in known.items() if columns}


def _columns(name: str, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns that an array holds: itself, or those of a vector, its time before them."""
    if array.ndim == 1:
        return {name: array} if len(array) > 1 else {}
    if array.ndim != 2:
        return {}
    if 3 in array.shape:
        rows = array if array.shape[1] == 3 else array.T
        return {f"{name}[{k}]": rows[:, k] for k in range(3)}
    for rows in (array, array.T):
        timed = rows.shape[1] in (2, 4) and len(rows) > 4 and rows.dtype.kind in "fiu"
        if timed and (rows[1:, 0] > rows[:-1, 0]).all():
            others = _columns(name, rows[:, 1] if rows.shape[1] == 2 else rows[:, 1:])
            return {f"{name}.time": rows[:, 0], **others}
    return {}


def _find_lone(arrays: Arrays, known: Mapping[str, Any]) -> dict[str, dict[str, NDArray[Any]]]:
    """The one array of three columns, or of four with the time first, as bare x, y and z."""
    alone = {
        name: columns
        for name, array in arrays.items()
        if name not in known
        and names_reading(name)
        and array.dtype.kind in "fiu"
        and len(columns := _columns("", np.squeeze(array))) >= 3
        and len(next(iter(columns.values()))) > 4
    }
    if len(alone) != 1:
        return {}
    name, columns = next(iter(alone.items()))
    axes = {"[0]": "x", "[1]": "y", "[2]": "z", ".time": "time"}
    return {name: {axes[header]: values for header, values in columns.items()}}


def is_sampling_rate(name: str) -> bool:
    """Whether an array is named as a sampling rate in Hz."""
    plain = "".join(filter(str.isalpha, name.rpartition(".")[2])).lower()
    return plain in ("samplingrate", "samplerate", "samplingfrequency", "fs", "ratehz", "fshz")
