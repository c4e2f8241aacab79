"""`Connection`: a wire and what understands it, connected again whenever it is cut."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from threading import Event as Flag
from typing import TYPE_CHECKING

import numpy as np

from agonic.errors import AgonicError
from agonic.live.streams.device import Device, MotionCalDevice
from agonic.live.streams.events import Chunk, Clock, Event, Notice, Words
from agonic.live.streams.links import Link, Packet
from agonic.live.streams.rows import LineParser, Reading

if TYPE_CHECKING:
    from agonic.live.streams.vehicle import Vehicle

LINE_BYTES = 4096
"""Bytes of a line; longer ones are passed over."""


SHOWN_CHARACTERS = 60
"""Characters of a line that is shown."""


PATIENCE_S = 1.0
"""How often it is said what cannot be read."""


class Lines:
    """Cuts a stream of bytes into lines and reads them; `suffix` tells senders apart. Lines that
    begin with `mark` are words for others: they are passed on as they are. What cannot be read is
    counted, and told with the last of it and the reason."""

    def __init__(self, unit: str, suffix: str = "", mark: str | None = None) -> None:
        self.rows = LineParser(unit=unit)
        self._unit, self._suffix = unit, suffix
        self._mark = None if mark is None else mark.encode()
        self._rest, self._skipping = b"", False
        self._unread, self._good, self._why, self._said_at = 0, 0, "", -np.inf
        self._clock = Clock()

    def feed(self, data: bytes, now: float) -> list[Event]:
        """The readings in bytes that came at `now`, s, and what could not be read."""
        lines = self._cut(data)
        found: dict[str, list[Reading]] = {}
        words: list[str] = []
        for line in lines:
            if self._mark is not None and line.startswith(self._mark):
                words.append(line[len(self._mark) :].decode("utf-8", "replace").strip())
                continue
            try:
                rows = self.rows.read(line.decode("utf-8", "replace"))
            except (AgonicError, OverflowError) as error:
                self._count(f"{_make_printable(line)} ({error})")
                continue
            self._good += len(rows)
            for row in rows:
                found.setdefault(row.sensor, []).append(row)
        events: list[Event] = [self._chunk(rows, now) for rows in found.values()]
        if words:
            events.append(Words(self._suffix, words))
        return events + self._tell_unread(now)

    def _cut(self, data: bytes) -> list[bytes]:
        """Whole lines; what is too long is passed over to its end."""
        joined = self._rest + data.replace(b"\r", b"\n")
        *lines, self._rest = joined.split(b"\n")
        if self._skipping and lines:
            lines, self._skipping = lines[1:], False
        if len(self._rest) > LINE_BYTES:
            if not self._skipping:
                self._count(f"{_make_printable(self._rest)} (no end of line in {LINE_BYTES} bytes)")
            self._rest, self._skipping = b"", True
        elif self._skipping:
            self._rest = b""
        return [line for line in lines if len(line) <= LINE_BYTES]

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
        return [Notice(True, f"{unread} lines could not be read, the last: {self._why}")]

    def _chunk(self, rows: list[Reading], now: float) -> Chunk:
        time = self._clock.times([row.time for row in rows], now, rows[0].sensor)
        unit = rows[0].unit or self._unit
        name = rows[0].sensor + self._suffix
        field = np.array([row.field for row in rows])
        motion = np.array([row.motion or (np.nan,) * 6 for row in rows])
        own = np.array([np.nan if row.time is None else row.time for row in rows])
        return Chunk(name, time, field, unit, motion=motion, own=own)


def _make_printable(line: bytes) -> str:
    """The start of a line as text that can be printed."""
    text = line[:SHOWN_CHARACTERS].decode("ascii", "backslashreplace")
    shown = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)[:SHOWN_CHARACTERS]
    return f"“{shown}”"


MOST_SENDERS = 8


class LineDecoder:
    """Lines of text, from one sender or a few."""

    stack = ""

    def __init__(self, unit: str, mark: str | None = None) -> None:
        self._unit, self._mark = unit, mark
        self.senders: dict[str, Lines] = {}

        self._write: Callable[[bytes], None] = lambda _: None

    @property
    def device(self) -> Device | None:
        """The device at the other end, where it is one that speaks MotionCal's protocol."""
        for lines in list(self.senders.values())[:1]:
            if lines.rows.motioncal:
                return MotionCalDevice(self._write, lines.rows.told)
        return None

    def begin(self, write: Callable[[bytes], None]) -> None:
        """A new connection: half a line of the old one is forgotten."""
        self.senders, self._write = {}, write

    def feed(self, received: Packet, now: float) -> list[Event]:
        """The readings in what was received."""
        lines = self.senders.get(received.origin)
        if lines is None:
            if len(self.senders) >= MOST_SENDERS:
                return [
                    Notice(True, f"more than {MOST_SENDERS} senders: {received.origin} is ignored")
                ]
            suffix = f" from {received.origin}" if self.senders else ""
            lines = self.senders[received.origin] = Lines(self._unit, suffix, self._mark)
        return lines.feed(received.data + (b"\n" if received.whole else b""), now)


class Connection:
    """A source over a wire."""

    lasting = True

    def __init__(self, link: Link, decoder: LineDecoder | Vehicle) -> None:
        self.link, self.decoder = link, decoder
        self.name = link.name
        self._heard = 0.0

    @property
    def stack(self) -> str:
        """The autopilot at the other end, or ""."""
        return self.decoder.stack

    @property
    def device(self) -> Device | None:
        """What a calibration can be written to at the other end."""
        return self.decoder.device

    def events(self, stop: Flag) -> Iterator[Event]:
        """Readings and words until `stop` is set."""
        lost = False
        while not stop.is_set():
            try:
                self.link.open()
                yield Notice(True, f"connected to {self.name}")
                self.decoder.begin(self.link.write)
                lost = False
                yield from self._listen(stop)
            except EOFError:
                yield Notice(False, f"{self.name} has ended", ended=True)
                return
            except OSError as error:
                if not lost:
                    known = error.errno is not None and error.errno > 0  # not of a host's name
                    reason = os.strerror(error.errno or 0) if known else error.strerror or error
                    yield Notice(False, f"no connection to {self.name} ({reason}); trying again")
                lost = True
                stop.wait(0.5)
            finally:
                self.link.close()

    def _listen(self, stop: Flag) -> Iterator[Event]:
        began = self._heard = time.monotonic()
        silent, rows, second = False, 0, began
        while not stop.is_set():
            received = self.link.read()
            now = time.monotonic()
            if received is None:
                if now - self._heard > 3.0 and not silent:
                    silent = True
                    yield Notice(True, f"{self.name} is silent{self.link.hint}")
                received = Packet(b"")
            else:
                self._heard, silent = now, False
            for event in self.decoder.feed(received, now):
                rows += len(event.time) if isinstance(event, Chunk) else 0
                yield event
            if now - second > 1.0:
                rows, second = 0, now
            elif rows > 5000:  # let the sender wait
                stop.wait(max(0.0, second + 1.0 - now))
