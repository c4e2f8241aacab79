"""The first pass over a record of any length: magnitudes, and rows for the fit in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import IO, Any, NamedTuple, Protocol

import numpy as np

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError, LogError
from agonic.field.decimal_year import decimal_year
from agonic.field.place import choose_model, describe_missing
from agonic.inflight.fit.pointing import find_direction_e
from agonic.inflight.fit.problem import Settings, require_enough, select_rows
from agonic.inflight.fit.torquers import Switches, list_dipoles
from agonic.samples import Samples

Progress = Callable[[str, int], None]

MOST = 200_000
"""Rows that are kept in memory for the start, the choice of the spline, and the record."""
TRACK = ("latitude_deg", "longitude_deg", "altitude_m", "flagged", "scalar")
"""Columns that only the first pass needs."""


class Recording(Protocol):
    """Readings piece by piece, the same each time; `agonic.logs.large.mission.Mission` is one."""

    @property
    def rows(self) -> int: ...

    def pieces(self, without: tuple[str, ...] = ()) -> Iterator[Samples]: ...


class Known(NamedTuple):
    """The magnitude at readings (n,), NaN where one is left out, and the direction (n, 3) of the
    field in Earth-fixed axes, None where it is not known."""

    magnitudes: Array
    direction_e: Array | None


def write_known(cache: IO[bytes], known: Known) -> None:
    """Append to the cache."""
    n = len(known.magnitudes)
    direction_e = np.full((n, 3), np.nan) if known.direction_e is None else known.direction_e
    known.magnitudes.tofile(cache)
    direction_e.astype(np.float32).tofile(cache)


def read_known(cache: IO[bytes], n: int) -> Known:
    """The next n readings of the cache, as they were written."""
    magnitudes = np.fromfile(cache, count=n)
    direction_e = np.fromfile(cache, dtype=np.float32, count=3 * n).reshape(n, 3)
    return Known(
        magnitudes, None if np.isnan(direction_e[0, 0]) else direction_e.astype(np.float64)
    )


class Scan(NamedTuple):
    """What the first pass found: rows every `stride`-th with what is known there, seconds between
    two, what later passes need not read, and what told the field."""

    samples: Samples
    magnitudes: Array
    direction_e: Array | None
    since: Array
    stride: int
    step_s: float
    without: tuple[str, ...]
    source: str


def scan_recording(
    recording: Recording, cache: IO[bytes], scalar: bool, settings: Settings, progress: Progress
) -> Scan:
    """The first pass: magnitudes into the cache, and rows for the fit in memory."""
    model = _Model()
    magnitude = _scalar if scalar else model
    thin, done, count, clean, step = _ThinnedRows(), 0, 0, True, 0.0
    switches: Switches | None = None
    for samples in recording.pieces():
        if samples.time is None:
            raise AgonicError("a fit in flight needs times; the log has none")
        if not step and len(samples) > 1:
            step = float(np.median(np.diff(samples.time)))
        known = magnitude(samples)
        values = np.where(
            select_rows(samples, None, settings.latitude_deg), known.magnitudes, np.nan
        )
        known = known._replace(magnitudes=values)
        write_known(cache, known)
        switches = switches or Switches(list_dipoles(samples))
        thin.add(samples, known, switches.measure_since(samples))
        clean &= not samples.rejected
        done += len(samples)
        count += int(np.isfinite(values).sum())
        progress("world model", done)
    if not done:
        raise LogError("the record is empty")
    require_enough(np.ones(count, dtype=bool))
    samples, beside = thin.join()
    source = "the scalar instrument in the record" if scalar else model.source
    without = TRACK if clean else ()
    known_there = beside["magnitudes"], beside.get("direction_e"), beside["since"]
    return Scan(samples, *known_there, thin.stride, step, without, source)


class _Model:
    """The world model along pieces of a track, the same model for all of them."""

    def __init__(self) -> None:
        self._model: Any = None

    @property
    def source(self) -> str:
        """What a report says of it."""
        return f"{self._model.name} along the track"

    def __call__(self, samples: Samples) -> Known:
        if samples.latitude_deg is None or samples.longitude_deg is None or samples.epoch is None:
            raise AgonicError(
                f"the field along the track is not known: {describe_missing(samples)}; give "
                "--date, or a scalar instrument"
            )
        if samples.altitude_m is None:
            samples = samples.with_columns(altitude_m=np.zeros(len(samples)))
        if self._model is None:
            assert samples.time is not None
            assert samples.epoch is not None
            begun = samples.epoch + timedelta(seconds=float(samples.time[0]))
            self._model = choose_model(float(decimal_year(begun)))
        reference = self._model.along(samples)
        return Known(reference.magnitudes(len(samples)), find_direction_e(samples, reference))


def _scalar(samples: Samples) -> Known:
    if samples.scalar is None:
        raise AgonicError("the record holds no scalar instrument (column scalar_nT)")
    return Known(samples.scalar, None)


class _ThinnedRows:
    """Rows of a record at even steps, never many more than `MOST`, with what is known of them."""

    def __init__(self) -> None:
        self.stride, self._seen = 1, 0
        self._parts: list[_Columns] = []
        self._last: _Columns = {}
        self._first: Samples | None = None

    def add(self, samples: Samples, known: Known, since: Array) -> None:
        """Take the rows of a piece whose turn it is."""
        number = self._seen + np.arange(len(samples))
        beside = {"number": number, "since": since, **known._asdict()}
        columns = {**samples.columns(), **{f"beside {k}": v for k, v in beside.items()}}
        columns = {name: values for name, values in columns.items() if values is not None}
        self._first = self._first or samples
        self._parts.append(_select(columns, number % self.stride == 0))
        self._last = _select(columns, number == number[-1])
        self._seen += len(samples)
        while sum(len(part["time"]) for part in self._parts) > MOST:
            self.stride *= 2
            self._parts = [_select(p, p["beside number"] % self.stride == 0) for p in self._parts]

    def join(self) -> tuple[Samples, _Columns]:
        """All of them and the last row of the record, in one, and what was known beside them."""
        assert self._first is not None, "the record is not empty"
        parts = [part for part in self._parts if len(part["time"])]
        if parts[-1]["beside number"][-1] != self._seen - 1:
            parts.append(self._last)
        columns = {
            name: np.concatenate([one[name] for one in parts])
            for name in parts[0]
            if all(name in one for one in parts)
        }
        known = [f"beside {k}" for k in ("number", "since", *Known._fields)]
        beside = {k.removeprefix("beside "): columns.pop(k) for k in [*columns] if k in known}
        named = self._first.disturbers
        disturbers = {name: columns.pop(name) for name in named if name in columns}
        own = dict.fromkeys(name for name in parts[0] if name not in (*known, *named))
        return self._first.with_columns(**{**own, **columns, "disturbers": disturbers}), beside


_Columns = dict[str, Array]


def _select(columns: _Columns, rows: Mask) -> _Columns:
    return {name: values[rows] for name, values in columns.items()}
