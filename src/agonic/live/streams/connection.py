"""`Connection`: a wire and what understands it, connected again whenever it is cut."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from threading import Event as Flag
from typing import Protocol

from agonic.live.streams.device import Device, MotionCalDevice
from agonic.live.streams.events import Chunk, Event, Notice
from agonic.live.streams.lines import MOST_LINES_S, Lines
from agonic.live.streams.links import Link, Packet

RETRY_S = 0.5
"""Between two attempts to connect."""

SILENCE_S = 3.0
"""Without a byte for so long it is said."""

MOST_SENDERS = 8


class Decoder(Protocol):
    """What makes readings of bytes."""

    stack: str

    @property
    def device(self) -> Device | None: ...
    def begin(self, write: Callable[[bytes], None]) -> None: ...
    def feed(self, received: Packet, now: float) -> list[Event]: ...


class LineDecoder:
    """Lines of text, from one sender or a few."""

    stack = ""

    def __init__(self, unit: str) -> None:
        self._unit = unit
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
                    Notice(True, f"more than {MOST_SENDERS} senders: {received.origin} is left")
                ]
            suffix = f" from {received.origin}" if self.senders else ""
            lines = self.senders[received.origin] = Lines(self._unit, suffix)
        return lines.feed(received.data + (b"\n" if received.whole else b""), now)


class Connection:
    """A source over a wire."""

    lasting = True

    def __init__(self, link: Link, decoder: Decoder) -> None:
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
            except OSError as error:
                if not lost:
                    known = error.errno is not None and error.errno > 0  # not of a host's name
                    reason = os.strerror(error.errno or 0) if known else error.strerror or error
                    yield Notice(False, f"no connection to {self.name} ({reason}); trying again")
                lost = True
                stop.wait(RETRY_S)
            finally:
                self.link.close()

    def _listen(self, stop: Flag) -> Iterator[Event]:
        began = self._heard = time.monotonic()
        silent, rows, second = False, 0, began
        while not stop.is_set():
            received = self.link.read()
            now = time.monotonic()
            if received is None:
                if now - self._heard > SILENCE_S and not silent:
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
            elif rows > MOST_LINES_S:  # let the sender wait
                stop.wait(max(0.0, second + 1.0 - now))
