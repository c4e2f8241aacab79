"""The first pass over a record of any length: magnitudes, and rows for the fit in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import timedelta
from typing import IO, NamedTuple, Protocol

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
    field in Earth-fixed axes, None where it is not known."""

    magnitudes: Array
    direction_e: Array | None

    @classmethod
    def read(cls, cache: IO[bytes], n: int) -> Known:
        """The next n readings of the cache, as they were written."""
        magnitudes = np.fromfile(cache, count=n)
        direction_e = np.fromfile(cache, dtype=np.float32, count=3 * n).reshape(n, 3)
        unknown = np.isnan(direction_e[0, 0])
        return cls(magnitudes, None if unknown else direction_e.astype(np.float64))

    def write(self, cache: IO[bytes]) -> None:
        """Append to the cache."""
        self.magnitudes.tofile(cache)
        unknown = np.full((len(self.magnitudes), 3), np.nan)
        direction_e = unknown if self.direction_e is None else self.direction_e
        direction_e.astype(np.float32).tofile(cache)


class Scan(NamedTuple):
    """What the first pass found: rows every `stride`-th with what is known there and the seconds
    `since` a switch, seconds between two, what later passes need not read, what told the field."""

    samples: Samples
    known: Known
    since: Array
    stride: int
    step_s: float
    without: tuple[str, ...]
    source: str


def scan_recording(
    recording: Recording, cache: IO[bytes], scalar: bool, settings: Settings, progress: Progress
) -> Scan:
    """The first pass: magnitudes into the cache, and rows for the fit in memory."""
    find_field = _Scalar() if scalar else _Model()
    stride = 1 << max(int(np.ceil(np.log2(max(recording.rows, 1) / MOST))), 0)
    done, count, clean, step = 0, 0, True, 0.0
    switches: Switches | None = None
    kept: list[tuple[Samples, Known, Array]] = []
    last: tuple[Samples, Known, Array] | None = None
    for samples in recording.pieces():
        if samples.time is None:
            raise AgonicError("a fit in flight needs times; the log has none")
        if not step and len(samples) > 1:
            step = float(np.median(np.diff(samples.time)))
        known = find_field(samples)
        taken = select_rows(samples, None, settings.latitude_deg)
        known = known._replace(magnitudes=np.where(taken, known.magnitudes, np.nan))
        known.write(cache)
        switches = switches or Switches(list_dipoles(samples))
        seen = samples, known, switches.measure_since(samples)
        own = np.arange(-done % stride, len(samples), stride)
        kept += [_select(*seen, own)] if len(own) else []
        done += len(samples)
        last = _select(*seen, np.array([-1])) if (done - 1) % stride else None
        clean &= not samples.rejected
        count += int(np.isfinite(known.magnitudes).sum())
        progress("world model", done)
    if not done:
        raise LogError("the record is empty")
    require_enough(np.ones(count, dtype=bool))
    parts, knowns, sinces = zip(*kept, *([last] if last else []), strict=True)
    sizes, directions = zip(*knowns, strict=True)
    return Scan(
        _join(parts),
        Known(np.concatenate(sizes), _concatenate(directions)),
        np.concatenate(sinces),
        stride,
        step,
        TRACK if clean else (),
        find_field.source,
    )


def _select(
    samples: Samples, known: Known, since: Array, rows: Index
) -> tuple[Samples, Known, Array]:
    own = Known(*(None if part is None else part[rows] for part in known))  # type: ignore[arg-type]
    return samples.select(rows), own, since[rows]


def _concatenate(parts: Sequence[Array | None]) -> Array | None:
    """The parts of a column in one; None where it is not in all of them."""
    there = [part for part in parts if part is not None]
    return np.concatenate(there) if len(there) == len(parts) else None


def _join(parts: Sequence[Samples]) -> Samples:
    """Rows of consecutive pieces in one, with the columns that all have."""
    each = [part.columns() for part in parts]
    joined = {name: _concatenate([one.get(name) for one in each]) for name in each[0]}
    disturbers = {name: joined.pop(name) for name in parts[0].disturbers}
    known = {name: values for name, values in disturbers.items() if values is not None}
    return parts[0].with_columns(**joined, disturbers=known)


class _Model:
    """The world model along pieces of a track, the same model for all of them."""

    source = ""

    def __call__(self, samples: Samples) -> Known:
        if samples.latitude_deg is None or samples.longitude_deg is None or samples.epoch is None:
            raise AgonicError(
                f"the field along the track is not known: {describe_missing(samples)}; give "
                "--date, or a scalar instrument"
            )
        if samples.altitude_m is None:
            samples = samples.with_columns(altitude_m=np.zeros(len(samples)))
        if not self.source:
            assert samples.time is not None
            assert samples.epoch is not None
            begun = samples.epoch + timedelta(seconds=float(samples.time[0]))
            self._model = choose_model(float(decimal_year(begun)))
            self.source = f"{self._model.name} along the track"
        reference = self._model.along(samples)
        return Known(reference.magnitudes(len(samples)), find_direction_e(samples, reference))


class _Scalar:
    """The scalar instrument in the record."""

    source = "the scalar instrument in the record"

    def __call__(self, samples: Samples) -> Known:
        if samples.scalar is None:
            raise AgonicError("the record holds no scalar instrument (column scalar_nT)")
        return Known(samples.scalar, None)
