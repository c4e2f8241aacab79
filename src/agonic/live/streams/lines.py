"""`Lines`: bytes as they come, cut into lines and read, in bounded room."""

from __future__ import annotations

import numpy as np

from agonic.errors import AgonicError
from agonic.live.streams.clock import Clock
from agonic.live.streams.events import Chunk, Event, Notice
from agonic.live.streams.rows import LineParser, Reading

LONGEST = 4096
"""Bytes of a line; longer ones are passed over."""

MOST_LINES_S = 5000
"""Lines a second that are read."""

SHOWN = 60
"""Characters of a line that is shown."""

_STILL = (np.nan,) * 6
"""Of a reading without accelerometer and gyro."""

PATIENCE_S = 1.0
"""How often it is said what cannot be read."""


class Lines:
    """Cuts a stream of bytes into lines and reads them; `suffix` tells senders apart.

    What cannot be read is counted, and told with the last of it and the reason.
    """

    def __init__(self, unit: str, suffix: str = "") -> None:
        self.rows = LineParser(unit=unit)
        self._unit, self._suffix = unit, suffix
        self._rest, self._skipping = b"", False
        self._unread, self._good, self._why, self._said_at = 0, 0, "", -np.inf
        self._clock = Clock()

    def feed(self, data: bytes, now: float) -> list[Event]:
        """The readings in bytes that came at `now`, s, and what could not be read."""
        lines = self._cut(data)
        found: dict[str, list[Reading]] = {}
        for line in lines:
            try:
                rows = self.rows.read(line.decode("utf-8", "replace"))
            except (AgonicError, OverflowError) as error:
                self._count(f"{_make_printable(line)} ({error})")
                continue
            self._good += len(rows)
            for row in rows:
                found.setdefault(row.sensor, []).append(row)
        events: list[Event] = [self._chunk(rows, now) for rows in found.values()]
        return events + self._tell_unread(now)

    def _cut(self, data: bytes) -> list[bytes]:
        """Whole lines; what is too long is passed over to its end."""
        joined = self._rest + data.replace(b"\r", b"\n")
        *lines, self._rest = joined.split(b"\n")
        if self._skipping and lines:
            lines, self._skipping = lines[1:], False
        if len(self._rest) > LONGEST:
            if not self._skipping:
                self._count(f"{_make_printable(self._rest)} (no end of line in {LONGEST} bytes)")
            self._rest, self._skipping = b"", True
        elif self._skipping:
            self._rest = b""
        return [line for line in lines if len(line) <= LONGEST]

    def _count(self, what: str) -> None:
        self._unread, self._why = self._unread + 1, what

    def _tell_unread(self, now: float) -> list[Event]:
        """What was not read, when it is more than a stray line, at most once a second."""
        if now - self._said_at < PATIENCE_S:
            return []
        unread, good, self._unread, self._good = self._unread, self._good, 0, 0
        self._said_at = now
        if unread <= 1 + 0.1 * good:
            return []
        return [Notice(True, f"hears {unread} lines that it cannot read, the last: {self._why}")]

    def _chunk(self, rows: list[Reading], now: float) -> Chunk:
        time = self._clock.times([row.time for row in rows], now, rows[0].sensor)
        unit = rows[0].unit or self._unit
        name = rows[0].sensor + self._suffix
        field = np.array([row.field for row in rows])
        motion = np.array([row.motion or _STILL for row in rows])
        return Chunk(name, time, field, unit, motion=motion)


def _make_printable(line: bytes) -> str:
    """The start of a line as text that can be printed."""
    text = line[:SHOWN].decode("ascii", "backslashreplace")
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)[:SHOWN]
    return f"“{shown}”"
