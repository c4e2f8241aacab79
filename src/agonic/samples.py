"""`Samples`: one sensor's time-aligned columns, validated once, read-only."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, fields, replace
from dataclasses import field as dataclass_field
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.maths.moments_of_time import count_seconds, has_moments
from agonic.maths.one_pass import interpolate
from agonic.provenance import Input
from agonic.readable import Readable
from agonic.units import RAW, find_unit, nanotesla_per
from agonic.usable_rows import check_axes, check_column, find_usable, refuse_other_unit

WORST_HEADING_DEG = 20.0
"""A heading that is known no better tells nothing of a calibration."""

COLUMNS = (
    "time",
    "field",
    "temperature",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "heading_sd_deg",
    "acceleration",
    "rotation_rate",
    "current_A",
    "throttle",
    "latitude_deg",
    "longitude_deg",
    "altitude_m",
    "second",
    "station",
    "target",
    "scalar",
    "flagged",
)
"""Every per-row column with a name of its own, in the order they are written."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Logged(Readable):
    """The correction that a log says was already applied: field = matrix @ (raw − bias).

    `bias` in the unit of the samples, `matrix` (3, 3); `source` names where it was found.
    """

    bias: Array
    matrix: Array
    source: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples(Readable):
    """Readings of one magnetometer and what was recorded beside them, a row a sample.

    Rows that hold a NaN or infinity in any column, or whose time does not increase, are left out
    and counted in `rejected`. A column that was not recorded is `None`.

    Parameters
    ----------
    field : (n, 3) readings, in `unit`; kept in nT, or as they are when the unit is "raw".
    unit : "nT", "uT", "mT", "T", "G", "mG" or "raw"; nT where it is not said, unless the readings
        have the size of the Earth's field in another unit: then it must be.
    time : (n,) seconds since `epoch`, strictly increasing; or moments (datetimes of any kind).
    epoch : UTC moment of time zero, if known.
    temperature : (n,) °C, the magnetometer's own.
    roll_deg, pitch_deg, heading_deg : (n,) aerospace attitude (yaw-pitch-roll) of the body;
        heading clockwise from true north.
    acceleration : (n, 3) specific force, m/s², in the frame of the magnetometer.
    rotation_rate : (n, 3) rad/s, in the frame of the magnetometer.
    current_A, throttle : (n,) on-board current, throttle 0…1.
    latitude_deg, longitude_deg, altitude_m : (n,) geodetic position, height above WGS-84.
    second : (n, 3) readings of a second magnetometer of the vehicle at the same moments, in the
        unit of `field` (see `with_second`), whose name is `second_sensor`.
    station : (n,) number of the static position.
    disturbers : columns (n,) of what may disturb the readings beside these, by name with the unit
        at its end: motor1_duty (0…1), esc2_A, torquer_x_Am2, heater_W.
    target : (n,) number of the target that the sight was kept on, 0 for none (see `fit_pair`).
    scalar : (n,) reading of an absolute scalar magnetometer at the same moments, nT always.
    flagged : (n,) not 0 where a fit should leave the row out, as when torquers are on.
    axes : "xyz"; "xy" of a two-axis compass, whose readings along z are written as zeros.
    name : the sensor. frame : the letter of its axes, "m" sensor or "b" body.
    device_id : the number by which an autopilot knows the sensor.
    heading_sd_deg : (n,) standard deviation of the heading; 180 in rows where it is not known.
    heading_source : what told the heading, where that is not the magnetometer.
    heading_estimated : the heading is an estimate that follows the magnetometer itself.
    corrected : the readings carry a correction of the autopilot that could not be taken out.
    logged : the correction already found in the log and taken out of `field`.
    notes : sentences of the reader on how these rows came about.
    source : the file they came from.

    Examples
    --------
    >>> s = Samples(field=[[20.0, 0.0, 43.0], [float("nan"), 1.0, 2.0]], unit="uT")
    >>> s.field.tolist(), len(s), dict(s.rejected)
    ([[20000.0, 0.0, 43000.0]], 1, {'NaN or infinite field': 1})
    """

    field: Array
    unit: str = ""
    time: Array | None = None
    epoch: datetime | None = None
    temperature: Array | None = None
    roll_deg: Array | None = None
    pitch_deg: Array | None = None
    heading_deg: Array | None = None
    heading_sd_deg: Array | None = None
    acceleration: Array | None = None
    rotation_rate: Array | None = None
    current_A: Array | None = None
    throttle: Array | None = None
    latitude_deg: Array | None = None
    longitude_deg: Array | None = None
    altitude_m: Array | None = None
    second: Array | None = None
    station: Array | None = None
    target: Array | None = None
    scalar: Array | None = None
    flagged: Array | None = None
    disturbers: Mapping[str, Array] = dataclass_field(default_factory=dict)
    name: str = "mag"
    axes: str = "xyz"
    frame: str = "m"
    device_id: int | None = None
    second_sensor: str | None = None
    heading_estimated: bool = False
    heading_source: str | None = None
    corrected: bool = False
    logged: Logged | None = None
    notes: tuple[str, ...] = ()
    source: Input | None = None
    rejected: Mapping[str, int] = dataclass_field(default_factory=dict)

    def __post_init__(self) -> None:
        if has_moments(self.time):
            seconds, epoch = count_seconds(self.time, self.epoch)
            self._put("time", seconds)
            self._put("epoch", epoch)
        columns = {name: check_column(name, getattr(self, name)) for name in COLUMNS}
        others = self.disturbers.items()
        named = {_disturber_name(name): check_column(name, c) for name, c in others}
        columns |= named
        lengths = {name: len(c) for name, c in columns.items() if c is not None}
        if len(set(lengths.values())) > 1:
            raise LogError(f"columns differ in length: {lengths}; give one value a row in each")
        if self.axes != "xyz":
            check_axes(self.axes, columns["field"])
        if not self.unit:
            refuse_other_unit(columns["field"])
            self._put("unit", "nT")
        factor = nanotesla_per(self.unit)
        keep, rejected = find_usable(columns, factor)
        kept = {
            name: None if values is None else _freeze(values if keep.all() else values[keep])
            for name, values in columns.items()
        }
        for name in COLUMNS:
            self._put(name, kept[name])
        self._put("disturbers", MappingProxyType({name: kept[name] for name in named}))
        self._put("rejected", MappingProxyType(_add_counts(self.rejected, rejected)))
        if not keep.any():
            reasons = ", ".join(f"{n} rows: {why}" for why, n in self.rejected.items())
            raise LogError(f"no usable readings ({reasons or 'no rows at all'})")
        if factor != 1.0:
            self._put("field", _freeze(self.field * factor))
            if self.second is not None:
                self._put("second", _freeze(self.second * factor))
        self._put("unit", RAW if find_unit(self.unit) == RAW else "nT")

    def _put(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.field)

    def __getitem__(self, rows: slice | ArrayLike) -> Samples:
        """The rows that a slice, a mask (n,), numbers (k,) or one number name.

        >>> Samples(field=[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])[1:].field.tolist()
        [[4.0, 5.0, 6.0]]
        """
        chosen = np.arange(len(self))[rows] if isinstance(rows, slice) else np.atleast_1d(rows)
        if isinstance(rows, str) or chosen.ndim != 1 or chosen.dtype.kind not in "iub":
            raise AgonicError(
                f"samples[{rows!r}]: needed are rows, as samples[10:20], a mask or numbers; a "
                "column is an attribute, as samples.field"
            )
        try:
            return self.select(chosen)
        except IndexError as error:
            raise AgonicError(f"the samples have {len(self)} rows: {error}") from None

    __iter__ = None  # a row alone is of no use, and the columns are attributes

    def __array__(self, *_: Any, **__: Any) -> Array:
        raise AgonicError("samples are a table of columns; their readings (n, 3) are samples.field")

    def _say(self) -> list[str]:
        """How many, how long, which columns, from where."""
        head = f"Samples {self.name!r}: {len(self)} readings in {self.unit}"
        if self.duration_s:
            rate = (len(self) - 1) / self.duration_s
            head += f", {self.duration_s:.6g} s at {rate:.3g} Hz"
        lines = [", ".join(self.columns())]
        lines += [f"since {self.epoch:%Y-%m-%d %H:%M:%S}"] if self.epoch else []
        lines += [f"from {self.source.name}"] if self.source else []
        lines += [f"left out: {n} rows, {why}" for why, n in self.rejected.items()]
        return [head, *lines, *self.notes]

    @property
    def duration_s(self) -> float | None:
        """Seconds from the first row to the last; `None` without times."""
        return None if self.time is None else float(self.time[-1] - self.time[0])

    @property
    def heading_known(self) -> Mask:
        """The rows (n,) whose heading is known to 20°; all where nothing is said of it."""
        if self.heading_sd_deg is None:
            return np.ones(len(self), dtype=bool)
        return np.asarray(self.heading_sd_deg <= WORST_HEADING_DEG)

    @property
    def origin(self) -> Input:
        """What a result made of these samples names as its input: the file, else the readings."""
        return self.source or Input.of_array(self.name, self.field)

    def columns(self) -> dict[str, Array]:
        """The columns that are there, by name, in writing order; disturbers last."""
        own = {name: c for name in COLUMNS if (c := getattr(self, name)) is not None}
        return own | dict(self.disturbers)

    def select(self, rows: ArrayLike) -> Samples:
        """The `rows` that a boolean mask (n,) or indices (k,) name, in their order."""
        chosen = np.asarray(rows)
        return self.with_columns(**{name: c[chosen] for name, c in self.columns().items()})

    def seconds_since(self, epoch: datetime | None, *, known: bool = True) -> Array:
        """The times as something counts them that was begun at `epoch`, itself `None` undated.

        `known` is false before anything was begun: then the times are as they are.
        Raises `LogError` without times, or where only one of the two knows the date.

        >>> day = datetime.fromisoformat("2026-05-01T00:00:00+00:00")
        >>> later = Samples(time=[0.5], epoch=day.replace(minute=1), field=[[1.0, 2.0, 3.0]])
        >>> later.seconds_since(day)
        array([60.5])
        """
        if self.time is None:
            raise LogError(f"{self.name} was logged without times; what goes on needs them")
        if not known or (epoch is None and self.epoch is None):
            return self.time
        if epoch is None or self.epoch is None:
            first, other = ("what was begun", "log") if self.epoch is None else ("log", "other")
            raise LogError(
                f"the {first} knows the date of its times and the {other} does not, so they "
                "cannot be put in order; read the log with its date"
            )
        return np.asarray(self.time + (self.epoch - epoch).total_seconds())

    def with_second(self, other: Samples) -> Samples:
        """These samples with the readings of another magnetometer of the vehicle beside them.

        The other's readings are interpolated to the rows here that lie between its first and last.
        Raises `LogError` without times, `UnitError` and `FrameError` where the two do not meet.

        >>> first = Samples(time=[0.0, 1.0, 2.0], field=np.zeros((3, 3)))
        >>> other = Samples(time=[0.5, 2.5], field=[[1.0, 2.0, 3.0], [5.0, 6.0, 7.0]])
        >>> first.with_second(other).second.tolist()
        [[2.0, 3.0, 4.0], [4.0, 5.0, 6.0]]
        """
        if self.time is None or other.time is None:
            raise LogError("two magnetometers meet by their times; both need them")
        if self.unit != other.unit:
            raise UnitError(f"{self.name} is in {self.unit} and {other.name} in {other.unit}")
        if self.frame != other.frame:
            raise FrameError(
                "two magnetometers must be in the same axes", left=self.frame, right=other.frame
            )
        rows = (self.time >= other.time[0]) & (self.time <= other.time[-1])
        if not rows.any():
            raise LogError(f"{self.name} and {other.name} were never recorded at the same time")
        within = self.select(rows)
        assert within.time is not None
        seen = interpolate(within.time, other.time, other.field)
        return within.with_columns(second=seen, second_sensor=other.name)

    def with_source(self, source: Input) -> Samples:
        """The same samples from another input.

        >>> one = Samples(field=[[1.0, 2.0, 3.0]])
        >>> one.with_source(Input(name="log.csv", sha256="", count=1)).source.name
        'log.csv'
        """
        return self.with_columns(source=source)

    def with_columns(self, **changed: Any) -> Samples:
        """The same samples with some columns or facts replaced; only columns are checked again.

        >>> Samples(field=[[1.0, 2.0, 3.0]]).with_columns(name="MAG2").name
        'MAG2'
        """
        own = {f.name for f in fields(self)}
        others = {name: changed.pop(name) for name in set(changed) & set(self.disturbers)}
        unknown = set(changed) - own
        if unknown:
            raise LogError(
                f"no such column: {', '.join(sorted(unknown))}; a new disturber is given with "
                "disturbers={name: values}"
            )
        if not others and _FACTS.issuperset(changed):
            same = copy(self)
            for name, value in changed.items():
                same._put(name, value)
            return same
        if others:
            changed["disturbers"] = dict(self.disturbers) | others | changed.get("disturbers", {})
        return replace(self, **changed)


_FACTS = frozenset(
    {
        *("name", "frame", "device_id", "second_sensor", "corrected", "logged"),
        *("heading_estimated", "heading_source", "notes", "source"),
    }
)
"""What is said of the rows as a whole and changes none of them."""


def _disturber_name(name: str) -> str:
    """The name of a disturber's column, or a clear error where it cannot be one."""
    if not name.isidentifier() or name in {f.name for f in fields(Samples)}:
        raise LogError(
            f"{name!r} cannot name a disturber: it needs letters, digits and _ and a name of its "
            "own, with the unit at the end, as motor1_duty or heater_A"
        )
    return name


def _add_counts(left: Mapping[str, int], right: Mapping[str, int]) -> dict[str, int]:
    return {why: left.get(why, 0) + right.get(why, 0) for why in (*left, *right)}


def _freeze(array: Array) -> Array:
    array.flags.writeable = False
    return array
