"""`Log`: what a reader found in a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NotRequired, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.provenance import Input
from agonic.readable import Readable
from agonic.samples import Logged, Samples

_allowed: ContextVar[bool] = ContextVar("allowed", default=False)


@contextmanager
def allow_two_axes() -> Iterator[None]:
    """Read magnetometers of x and y alone, in logs that hold no other, while this lasts."""
    token = _allowed.set(True)
    try:
        yield
    finally:
        _allowed.reset(token)


def are_two_axes_allowed() -> bool:
    """Whether magnetometers of x and y alone are read."""
    return _allowed.get()


if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

TORN = "the last line ends in the middle"
"""Note on a text whose last line was left out, and the reason why it counts as rejected."""


def compute_rate_Hz(time: ArrayLike) -> float | None:
    """Rows per second between the first time and the last, where there are two and they differ."""
    t = np.asarray(time, dtype=np.float64)
    span = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    return (len(t) - 1) / span if span > 0 and np.isfinite(span) else None


@dataclass(frozen=True, kw_only=True)
class Stream:
    """Something else that the file holds: its name, rows, and rate in Hz where it has times."""

    name: str
    rows: int
    rate_Hz: float | None = None

    @classmethod
    def at(cls, name: str, rows: int, time: Array | None) -> Stream:
        """A stream of `rows` rows; its rate follows from their times (s), if there are any."""
        return cls(name=name, rows=rows, rate_Hz=None if time is None else compute_rate_Hz(time))


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """What an autopilot's sensor measured, as far as its log tells, and what was done to it.

    `field` (n, 3) in `unit` and the axes of `frame`, free of the correction that `logged` holds;
    `corrected` says that a correction is still in it, which the log does not tell. `rotation_bm`
    turns components in that frame into body axes; `None` where it is not known.
    """

    field: Array
    unit: str = "nT"
    frame: str = "b"
    rotation_bm: Rotation | None = None
    logged: Logged | None = None
    device_id: int | None = None
    corrected: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Log(Readable):
    """A file that was read: a `Samples` for each magnetometer, and what else is there.

    `format` names the kind of file ("ArduPilot dataflash"); `stack` is where exports go
    ("ardupilot", "px4" or ""); `notes` are sentences on oddities of the file itself (truncated,
    gaps in the clock, times that were restored).
    """

    path: Path
    format: str
    source: Input
    sensors: tuple[Samples, ...]
    stack: str = ""
    streams: tuple[Stream, ...] = field(default_factory=tuple)
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        facts: Facts,
        sensors: Iterable[Samples],
        streams: Iterable[Stream] = (),
        notes: Iterable[str] = (),
        stack: str = "",
    ) -> Log:
        """The log of a file with these facts; `notes` come after those that are facts."""
        return cls(
            path=facts["path"],
            format=facts["format"],
            source=facts["source"],
            sensors=tuple(sensors),
            stack=stack,
            streams=tuple(streams),
            notes=(*facts.get("notes", ()), *notes),
        )

    def sensor(self, which: str | int) -> Samples:
        """The sensor of that name, or at that position from 0; `LogError` names those there are."""
        names = [samples.name for samples in self.sensors]
        if which in names:
            return self.sensors[names.index(str(which))]
        if str(which).isdecimal() and int(which) < len(names):
            return self.sensors[int(which)]
        raise LogError(f"no sensor {which!r}; there are {', '.join(names)}", path=self.path)


Table = Mapping[str, NDArray[Any]]
"""Columns by header: numbers, moments or texts, (n,) each."""


class About(TypedDict):
    """What a reader says of a file with tables: `others` are headers that were not read, `notes`
    are on the file, `remarks` on each of its magnetometers."""

    format: str
    others: NotRequired[Iterable[str]]
    notes: NotRequired[tuple[str, ...]]
    remarks: NotRequired[tuple[str, ...]]


class Facts(About):
    """What is known of a file beside the tables in it: `unit` is that of the field where no header
    names one."""

    path: Path
    source: Input
    unit: NotRequired[str | None]
