"""What a table holds beside a magnetometer, at its rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.logs.clocks.clock import Clock
from agonic.logs.headers.columns import Identified
from agonic.logs.headers.header import Column
from agonic.logs.log import Table
from agonic.logs.rows import auxiliary
from agonic.logs.rows.times import pick
from agonic.provenance import Input
from agonic.samples import COLUMNS

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

ENU = "enu"
"""The unit of a quaternion that is documented to turn sensor axes into east, north, up."""


def compute_attitude_deg(
    quat_wxyz: Array, acceleration: Array | None, axes: str | None
) -> tuple[dict[str, Array], str]:
    """Roll and pitch (n,), and heading where `axes` is `ENU` and gravity agrees, by a quaternion
    (n, 4); and a note. They turn components in the sensor's own x, y, z, as if those were forward,
    right, down, into north, east, down: a sensor lying face up has a roll of 180°. Whether it turns
    sensor axes into those of the world or the reverse, and where the world's z points, is seen from
    the acceleration (n, 3), in any unit, which must show gravity along that z."""
    from scipy.spatial.transform import Rotation

    known = np.isfinite(quat_wxyz).all(axis=1) & (np.linalg.norm(quat_wxyz, axis=1) > 0.5)
    if not known.any():
        return {}, "orientation left out: it is never known"
    rotation = Rotation.from_quat(quat_wxyz[known], scalar_first=True)
    if acceleration is None and axes != ENU:
        return {}, "orientation left out: without an accelerometer its axes are not known"
    seen = (False, False) if acceleration is None else _find_axes(rotation, acceleration[known])
    if seen is None:
        return {}, "orientation left out: the accelerometer does not show gravity along its z"
    inverse, down = seen
    world_from_sensor = rotation.inv() if inverse else rotation
    ned_from_enu = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    north = world_from_sensor if down else ned_from_enu * world_from_sensor
    angles = np.full((len(quat_wxyz), 3), np.nan)
    angles[known] = north.as_euler("ZYX", degrees=True)
    found = {"roll_deg": angles[:, 2], "pitch_deg": angles[:, 1]}
    if axes == ENU and not down and not inverse:
        return found | {"heading_deg": angles[:, 0] % 360.0}, (
            "roll, pitch and heading are those of the quaternion, which turns sensor axes x, y, z "
            "into east, north, up"
        )
    return found, (
        "roll and pitch are those of the quaternion, by gravity from "
        f"{'world to sensor' if inverse else 'sensor to world'} axes with z "
        f"{'down' if down else 'up'}; its heading counts from an unknown direction and is left out"
    )


def _find_axes(rotation: Rotation, acceleration: Array) -> tuple[bool, bool] | None:
    """Whether the rotation is from world to sensor, and whether z of the world points down. Of the
    two directions one must be clearly nearer to gravity, but where both are level to a few degrees;
    its vertical holds nine tenths of gravity."""
    size = np.linalg.norm(acceleration, axis=1)
    usable = np.isfinite(size) & (size > 0)
    if not usable.any():
        return None
    up = acceleration[usable] / size[usable, None]
    turned = [turn.apply(up) for turn in (rotation[usable], rotation[usable].inv())]
    tilts = [float(np.median(np.hypot(*seen[:, :2].T))) for seen in turned]
    upward = [float(np.median(seen[:, 2])) for seen in turned]
    inverse = tilts[1] < 0.7 * tilts[0]
    unclear = not inverse and not tilts[0] < 0.7 * tilts[1] and tilts[0] > 0.05
    if unclear or abs(upward[inverse]) < 0.9:
        return None
    return inverse, upward[inverse] < 0


AUXILIARY = tuple(name for name in COLUMNS if name not in ("time", "field"))
_HEADING = ("heading_deg", "heading_sd_deg")
STATED_SD_DEG = 1.0
"""Of a heading that is known in some rows and states no error: all its rows count alike."""
YAW = "a heading called yaw was taken for the estimate of a filter, which follows its magnetometer"


@dataclass(frozen=True, kw_only=True)
class Part:
    """The rows of a table that belong to one sensor, with what is known of all of them. `rows` are
    their numbers, in order; `None` where all rows do."""

    table: Table
    found: Identified
    rows: Index | None
    clocks: Mapping[str, Clock]
    source: Input
    unit: str | None = None
    remarks: tuple[str, ...] = ()

    def take(self, column: NDArray[Any]) -> NDArray[Any]:
        """What a column holds in these rows, not copied where that is all of it."""
        return column if self.rows is None else column[self.rows]

    def clock(self, number: str) -> Clock:
        """The clock of a magnetometer in these rows."""
        time, epoch, notes = self.clocks[number]
        return None if time is None else self.take(time), epoch, notes

    def values(self, axes: Mapping[str, Column]) -> Array:
        """The numbers in the columns of a quantity, (n, k), axes in alphabetical order."""
        columns = (auxiliary.to_numbers(self.table[axes[axis].header]) for axis in sorted(axes))
        stacked = np.stack([self.take(c) for c in columns], 1)
        stacked.flags.writeable = False  # `Samples` need not copy it
        return stacked


def find_foreign_rows(part: Part, field: Array, readings: Mask) -> Index:
    """Rows without a reading that hold what the readings' rows lack: another sensor's. `readings`
    (n,) marks the rows of the field (n, 3) that hold one."""
    if readings.all():
        return np.empty(0, np.int64)
    empty = np.asarray(np.isnan(field).all(axis=1))
    groups = (axes for n, g in part.found.items() if n != "field" for axes in g.values())
    columns = (part.table[axes[min(axes)].header] for axes in groups)
    known = (np.isfinite(part.take(c)) for c in columns if c.dtype.kind == "f")
    mixed = empty.any() and not empty.all()
    mixed = mixed and any(k[empty].mean() > 0.5 > k[~empty].mean() for k in known)
    return np.flatnonzero(empty) if mixed else np.empty(0, np.int64)


def read_columns(
    part: Part, number: str, time: Array | None, readings: Mask
) -> tuple[dict[str, Any], bool, tuple[str, ...]]:
    """The columns of a sensor, whether its heading is an estimate, and notes. `readings` marks the
    rows that matter."""
    columns: dict[str, Any] = {}
    estimated = False
    notes: list[str] = []
    for column in AUXILIARY:
        group = pick(part.found.get(column, {}), number)
        if not group:
            continue
        if column == "target":
            columns[column] = part.take(auxiliary.number_labels(part.table[group[""].header]))
            continue
        heads = column in _HEADING  # one that is known in few rows is of use for those
        values, remarks = auxiliary.convert_column(
            group, part.values(group), time, readings, keep_holes=heads
        )
        notes.extend(remarks)
        if heads and values is not None and readings.any():
            known = np.isfinite(values[readings])
            if not known.all() and known.sum() < 10:  # too few to tell
                name = next(iter(group.values())).quantity.name
                notes.append(f"{name} left out: hardly any row has one")
                values = None
        columns[column] = values
        if column == "heading_deg" and any("yaw" in c.header.lower() for c in group.values()):
            estimated = True
            notes.append(YAW)
    notes.extend(_mark_unknown_headings(columns, readings))
    if columns.get("roll_deg") is None and (
        group := pick(part.found.get("quaternion", {}), number)
    ):
        angles, remarks = _read_quaternion(part, group, columns.get("acceleration"), time, readings)
        columns.update(angles)
        estimated = estimated or "heading_deg" in angles
        notes.extend(remarks)
    return columns, estimated, tuple(notes)


def _mark_unknown_headings(columns: dict[str, Any], readings: Mask) -> tuple[str, ...]:
    """Give headings that are missing an sd of 180° and, for a number, the one before; a note."""
    heading, sd = (columns.get(name) for name in _HEADING)
    if heading is None:
        if sd is not None:
            columns["heading_sd_deg"] = None
        return ()
    known = np.isfinite(heading) & (np.isfinite(sd) if sd is not None else True)
    missing = int((readings & ~known).sum())
    if not missing:
        return ()
    at = np.flatnonzero(known)
    last = at[np.clip(np.searchsorted(at, np.arange(len(known)), "right") - 1, 0, None)]
    columns["heading_deg"] = heading[last]
    stated = np.full(len(known), STATED_SD_DEG) if sd is None else sd
    from agonic.logs.rows.tracks import UNKNOWN_SD_DEG

    columns["heading_sd_deg"] = np.where(known, stated, UNKNOWN_SD_DEG)
    return (f"heading known in {int((readings & known).sum())} of {int(readings.sum())} rows",)


def read_disturbers(
    part: Part, time: Array | None, readings: Mask
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The columns of what may disturb, by name, and notes."""
    found: dict[str, Array] = {}
    notes: list[str] = []
    for name, group in part.found.get("disturber", {}).items():
        values, remarks = auxiliary.convert_column(group, part.values(group), time, readings)
        if values is not None:
            found[name] = values
        notes += [f"{name}: {remark.removeprefix('disturber ')}" for remark in remarks]
    return found, tuple(notes)


def _read_quaternion(
    part: Part,
    group: Mapping[str, Column],
    acceleration: Array | None,
    time: Array | None,
    readings: Mask,
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Roll, pitch and perhaps heading of the quaternion beside a magnetometer, and notes."""
    if set(group) != set("wxyz"):
        return {}, ("orientation left out: it has not all of w, x, y and z",)
    angles, note = compute_attitude_deg(part.values(group), acceleration, group["w"].unit)
    filled = {}
    for name, values in angles.items():
        whole, gaps = auxiliary.fill_holes(name, values[:, None], time, readings)
        if whole is None:
            return {}, (f"orientation {gaps}",)
        filled[name] = whole[:, 0]
    return filled, (note,)
