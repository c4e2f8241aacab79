"""A mission: a record in one file or many, longer than memory, read piece by piece.

A `Samples` is checked, copied and put into units; for 10⁸ rows that costs more than reading them. A
strip is readings and times alone as they were decoded, with the factor and the clock of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.field.decimal_year import parse_date
from agonic.logs import parquet
from agonic.logs.clocks.clock import read_clock
from agonic.logs.formats import PARQUET
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.quantities import LAST
from agonic.logs.log import Log, Table
from agonic.logs.read import open_log
from agonic.logs.remote import Remote, locate, name_locally
from agonic.logs.rows.other_columns import AUXILIARY
from agonic.logs.table import build_log
from agonic.provenance import Input, hash_file
from agonic.samples import Samples
from agonic.units import RAW, nanotesla_per

Column = NDArray[Any]

STRIP = 65_536
"""Rows in a strip: two megabytes, some of them ahead of the work."""


class Strip(NamedTuple):
    """Some rows: x, y, z (n,) as stored, the factor to the unit of the fit, times (n,) in seconds
    where they were asked for, and why how many other rows are left out."""

    columns: tuple[Column, Column, Column]
    factor: float
    time: Array | None
    rejected: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.columns[0])

    def select(self, rows: NDArray[Any], rejected: Mapping[str, int]) -> Strip:
        """Some of the rows, and why the others are left out."""
        x, y, z = (column[rows] for column in self.columns)
        time = None if self.time is None else self.time[rows]
        return Strip((x, y, z), self.factor, time, {**self.rejected, **rejected})


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Which columns of a file are the readings and the time, and how they are counted:
    field = factor · stored, seconds = begun + scale · (stored − first)."""

    axes: tuple[str, str, str]
    factor: float
    time: str | None
    first: Any = 0
    scale: float = 1.0
    begun: float = 0.0


def find_layout(table: Mapping[str, Column], head: Samples, unit: str | None) -> Layout | None:
    """The layout of a file whose first rows are a table, read as `head` with the unit given. None
    where the columns need more than a factor and a steady clock: several sensors in one table,
    dates in texts, a clock that stands still."""
    found = identify_columns(table)
    axes = found["field"].get(head.name.removeprefix("mag"))
    times = found.get("time", {})
    if axes is None or not {"sensor", "date", "epoch", "frame"}.isdisjoint(found) or len(times) > 1:
        return None
    headers = (axes["x"].header, axes["y"].header, axes["z"].header)
    if any(table[header].dtype.kind not in "fiu" for header in headers):
        return None
    named = axes["x"].unit
    factor = nanotesla_per(unit or RAW if named in (None, RAW) else named)
    if head.time is None:
        return None if times else Layout(axes=headers, factor=factor, time=None)
    column, *others = next(iter(times.values())).values()
    if others:
        return None
    stored = table[column.header]
    if stored.dtype.kind not in "fiuM" or len(stored) < 2:
        return None
    seconds = read_clock(stored, column.quantity.units[column.unit][0] if column.unit else None)[0]
    if seconds is None or not (np.diff(seconds) > 0).all():
        return None
    numbers = _numbers(stored)
    scale = (seconds[-1] - seconds[0]) / float(numbers[-1] - numbers[0])
    ticks = (1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0)
    exact = min(ticks, key=lambda tick: abs(np.log(tick / scale)))
    if abs(scale / exact - 1) > 1e-6:
        return None
    begun = float(seconds[0])
    return Layout(
        axes=headers, factor=factor, time=column.header, first=numbers[0], scale=exact, begun=begun
    )


def _numbers(stored: Column) -> Column:
    return stored.view(np.int64) if stored.dtype.kind == "M" else stored


def keep_usable(strip: Strip, last: float) -> Strip:
    """The rows of a strip that `Samples` would keep, after a row at the time `last`."""
    with np.errstate(invalid="ignore", over="ignore"):
        total = sum(float(column.sum(dtype=np.float64)) for column in strip.columns)
    time = strip.time
    if np.isfinite(total) and (time is None or (time[0] > last and (time[1:] > time[:-1]).all())):
        return strip
    keep = np.all([np.isfinite(column) for column in strip.columns], axis=0)
    rejected = {"NaN or infinite field": int((~keep).sum())}
    if time is not None:
        known = np.isfinite(time)
        rejected["NaN or infinite time"] = int((keep & ~known).sum())
        keep &= known
        latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
        before = np.concatenate([[last], np.maximum(latest[:-1], last)])
        rejected["time does not increase"] = int((keep & ~(time > before)).sum())
        keep &= time > before
    return strip.select(keep, {why: count for why, count in rejected.items() if count})


ROWS = 262_144
"""Rows in a piece: some tens of megabytes with all that is computed from them."""

IN_MEMORY = 5_000_000
"""Rows of one recording that are read at once; longer ones are read piece by piece."""

_HEAD = 16_384
"""Rows that tell what the columns are."""


@dataclass(frozen=True, kw_only=True)
class Mission:
    """The readings of one magnetometer over files that follow each other in time.

    `files` with their checksums; `rows` how many they hold; `sensor`, `unit` as for `ag.read`;
    `epoch` the UTC moment from which all times are counted, where it was given.
    """

    files: tuple[Path | Remote, ...]
    inputs: tuple[Input, ...]
    rows: int
    sensor: str | int | None = None
    unit: str | None = None
    epoch: datetime | None = None
    piece: int = ROWS
    strip: int = STRIP

    def pieces(self, without: tuple[str, ...] = ()) -> Iterator[Samples]:
        """The readings in order of time, piece by piece, times counted from one epoch. Parameters:
        `without`, columns of `Samples` that are not needed and not read."""
        epoch, last = self.epoch, None
        for path, source in zip(self.files, self.inputs, strict=True):
            for samples in self._of_file(path, source, without):
                epoch = epoch or samples.epoch
                shifted = _count_from(samples, epoch, given=self.epoch is not None)
                if shifted.time is None:
                    raise LogError("a mission needs times; this file has none", path=str(path))
                if last is not None and shifted.time[0] <= last:
                    raise _out_of_order(path)
                last = float(shifted.time[-1])
                yield shifted

    def head(self) -> Samples:
        """The first rows: name, unit, frame and epoch of all."""
        return self._head(self.files[0], self.inputs[0])

    def _head(self, path: Path | Remote, source: Input) -> Samples:
        return next(replace(self, piece=_HEAD)._of_file(path, source, AUXILIARY))

    def sensors(self) -> tuple[str, ...]:
        """The magnetometers that have columns of their own; none where a column names them."""
        path = self.files[0]
        if not _is_parquet(path):
            return tuple(samples.name for samples in open_log(path, unit=self.unit).sensors)
        table = next(parquet.read_batches(path, _HEAD))
        label = identify_columns(table).get("sensor", {}).get("", {}).get("")
        if label is not None and label.rank != LAST:
            return ()
        log = self._build_log(table, path, self.inputs[0])
        return tuple(samples.name for samples in log.sensors)

    def strips(self) -> Iterator[Strip]:
        """The readings alone, in order of time, as few operations a row as there can be."""
        epoch, last = self.epoch, -np.inf
        for path, source in zip(self.files, self.inputs, strict=True):
            head = self._head(path, source)
            epoch = epoch or head.epoch
            shifted = _count_from(head, epoch, given=self.epoch is not None)
            shift = 0.0
            if head.time is not None and shifted.time is not None:
                shift = float(shifted.time[0] - head.time[0])
                if shifted.time[0] <= last:
                    raise _out_of_order(path)
            elif len(self.files) > 1:
                raise LogError("several files need times to follow each other", path=str(path))
            for strip in self._strips_of_file(path, source, head, shift):
                if strip.time is not None and len(strip):
                    last = float(strip.time[-1])
                yield strip

    def _strips_of_file(
        self, path: Path | Remote, source: Input, head: Samples, shift: float
    ) -> Iterator[Strip]:
        """Its strips, without rows that are not finite or whose time does not increase."""
        of = None
        if _is_parquet(path):
            of = find_layout(next(parquet.read_batches(path, _HEAD)), head, self.unit)
        if of is not None:
            whole = self._sweep(path, replace(of, begun=of.begun + shift))
        else:
            whole = (
                Strip((x, y, z), 1.0, None if one.time is None else one.time + shift, one.rejected)
                for one in self._of_file(path, source, AUXILIARY)
                for x, y, z in [one.field.T]
            )
        last = -np.inf
        for strip in whole:
            usable = keep_usable(strip, last)
            if usable.time is not None and len(usable):
                last = float(usable.time[-1])
            yield usable

    def _sweep(self, path: Path | Remote, of: Layout) -> Iterator[Strip]:
        """The strips of a Parquet file, with all their rows."""
        time = [] if of.time is None else [of.time]
        for table in parquet.read_ahead(path, self.strip, [*of.axes, *time]):
            x, y, z = (table[header] for header in of.axes)
            seconds = [(_numbers(table[one]) - of.first) * of.scale + of.begun for one in time]
            yield Strip((x, y, z), of.factor, next(iter(seconds), None), {})

    def _of_file(
        self, path: Path | Remote, source: Input, without: tuple[str, ...]
    ) -> Iterator[Samples]:
        chosen = 0 if self.sensor is None else self.sensor
        if not _is_parquet(path):
            whole = open_log(path, unit=self.unit).sensor(chosen)
            rows = np.arange(len(whole))
            for start in range(0, len(whole), self.piece):
                yield whole.select(rows[start : start + self.piece])
            return
        for table in parquet.read_batches(path, self.piece, without):
            yield self._build_log(table, path, source).sensor(chosen)

    def _build_log(self, table: Table, path: Path | Remote, source: Input) -> Log:
        """The log of some rows of a Parquet table."""
        here = name_locally(path)
        return build_log(table, path=here, source=source, format="Parquet table", unit=self.unit)


def open_mission(
    paths: Iterable[Path | Remote | str],
    *,
    sensor: str | int | None = None,
    unit: str | None = None,
    date: str | None = None,
    piece: int = ROWS,
) -> Mission:
    """A record in several files, to be read piece by piece; Parquet is never read whole.

    Parameters
    ----------
    paths : the files, in order of time; URLs of object storage are read where they lie.
    sensor, unit : as for `ag.read`.
    date : of time zero (UTC), for files that count their times from no known moment.
    piece : rows read at a time.

    Returns a `Mission`; `fit_mission` and `fit_recording` take it.

    Raises `LogError` where a file cannot be read.

    Source: a reader of agonic's own over pyarrow's record batches.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "log.csv")
    ...     _ = path.write_text("time_s,mag_x_nT,mag_y_nT,mag_z_nT\\n0,1,2,3\\n1,4,5,6\\n")
    ...     [len(samples) for samples in open_mission([path], piece=1).pieces()]
    [1, 1]
    """
    files = tuple(map(locate, paths))
    if not files:
        raise LogError("no files were named")
    missing = [file for file in files if not file.is_file()]
    if missing:
        raise LogError("there is no such file", path=str(missing[0]))
    inputs = []
    for file in files:
        whole = None if _is_parquet(file) else open_log(file).sensors[0]
        count = parquet.count_rows(file) if whole is None else len(whole)
        sha256 = file.hash() if isinstance(file, Remote) else hash_file(file)
        inputs.append(Input(name=file.name, sha256=sha256, count=count))
    return Mission(
        files=files,
        inputs=tuple(inputs),
        rows=sum(one.count for one in inputs),
        sensor=sensor,
        unit=unit,
        epoch=None if date is None else parse_date(date),
        piece=piece,
    )


def _is_parquet(path: Path | Remote) -> bool:
    with path.open("rb") as stream:
        return PARQUET.accepts(stream.read(4))


def _out_of_order(path: Path | Remote) -> LogError:
    return LogError(
        "its readings do not come after those before; name the files in order of time, each once",
        path=str(path),
    )


def is_long(paths: Sequence[Path | Remote], rows: int | None = None) -> bool:
    """Whether files are several, or a Parquet table of more rows than these, or `IN_MEMORY`."""
    most = IN_MEMORY if rows is None else rows
    if len(paths) != 1:
        return True
    path = locate(paths[0])
    return path.is_file() and _is_parquet(path) and parquet.count_rows(path) > most


def _count_from(samples: Samples, epoch: datetime | None, *, given: bool) -> Samples:
    """The samples with their times counted from an epoch; theirs must be known, unless given."""
    if samples.time is None or samples.epoch == epoch:
        return samples
    if epoch is None or (samples.epoch is None and not given):
        raise LogError("some of the files know their date and some do not; give the date")
    if samples.epoch is None:
        return replace(samples, epoch=epoch)
    shift = (samples.epoch - epoch).total_seconds()
    return replace(samples, time=samples.time + shift, epoch=epoch)
