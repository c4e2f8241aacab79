"""The first pass over a record of any length: magnitudes, and rows for the fit in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import IO, Any, NamedTuple, Protocol

import numpy as np

from agonic.arrays import Array, Index
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
    field in Earth-fixed axes, NaN where it is not known; in the first pass also the seconds since a
    torquer was switched (n,)."""

    magnitudes: Array
    direction_e: Array | None
    since: Array | None = None


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
    """What the first pass found: rows every `stride`-th with what is known there, how many readings
    can take part, seconds between two, what later passes need not read, and what told the field."""

    samples: Samples
    magnitudes: Array
    direction_e: Array | None
    since: Array
    stride: int
    usable: int
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
        thin.add(samples, known._replace(since=switches.measure_since(samples)))
        clean &= not samples.rejected
        done += len(samples)
        count += int(np.isfinite(values).sum())
        progress("world model", done)
    if not done:
        raise LogError("the record is empty")
    require_enough(np.ones(count, dtype=bool))
    samples, known = thin.whole()
    source = "the scalar instrument in the record" if scalar else model.source
    without = TRACK if clean else ()
    assert known.since is not None
    return Scan(
        samples, known.magnitudes, known.direction_e, known.since, thin.stride, count, step,
        without, source,
    )  # fmt: skip


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
                f"the field on the way is not known: {describe_missing(samples)}; give --date, "
                "or a scalar instrument"
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
    """Rows of a record at even steps, never many more than `MOST`."""

    def __init__(self) -> None:
        self.stride, self._seen = 1, 0
        self._parts: list[_Part] = []
        self._last: _Part | None = None

    def add(self, samples: Samples, known: Known) -> None:
        """Take the rows of a piece whose turn it is."""
        whole = _Part(samples, known, self._seen + np.arange(len(samples)))
        self._parts += whole.every(self.stride)
        self._last = whole.select(np.array([len(samples) - 1]))
        self._seen += len(samples)
        while sum(len(part.number) for part in self._parts) > MOST:
            self.stride *= 2
            self._parts = [few for part in self._parts for few in part.every(self.stride)]

    def whole(self) -> tuple[Samples, Known]:
        """All of them and the last row of the record, in one."""
        parts = list(self._parts)
        if self._last is not None and parts[-1].number[-1] != self._last.number[0]:
            parts.append(self._last)
        recorded = [part.samples.columns() for part in parts]
        columns = {
            name: np.concatenate([one[name] for one in recorded])
            for name in recorded[0]
            if all(name in one for one in recorded)
        }
        first = parts[0].samples
        disturbers = {n: columns.pop(n) for n in tuple(columns) if n in first.disturbers}
        own = dict.fromkeys(name for name in recorded[0] if name not in first.disturbers)
        samples = first.with_columns(**{**own, **columns, "disturbers": disturbers})
        outsides = [part.known.direction_e for part in parts if part.known.direction_e is not None]
        known = Known(
            np.concatenate([part.known.magnitudes for part in parts]),
            np.concatenate(outsides) if len(outsides) == len(parts) else None,
            np.concatenate([part.known.since for part in parts if part.known.since is not None]),
        )
        return samples, known


class _Part(NamedTuple):
    """Rows of a piece, with what is known of them and their number in the record."""

    samples: Samples
    known: Known
    number: Index

    def select(self, rows: Index) -> _Part:
        """Some of the rows."""
        magnitudes, outside_e, since = self.known
        some = Known(
            magnitudes[rows],
            None if outside_e is None else outside_e[rows],
            None if since is None else since[rows],
        )
        return _Part(self.samples.select(rows), some, self.number[rows])

    def every(self, stride: int) -> list[_Part]:
        """Those whose number is a multiple; none, or one part."""
        rows = np.flatnonzero(self.number % stride == 0)
        return [self.select(rows)] if len(rows) else []
