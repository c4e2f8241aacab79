"""Writing a calibration to the device that the readings come from, and reading it back."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import msgspec

from agonic.calibration.base import Calibration
from agonic.exports.motioncal import encode_packet, make_packet

ANSWER_S = 4.0
"""How long an answer is waited for."""

_PACKET = ("V x", "V y", "V z", "B", "W xx", "W yy", "W zz", "W xy", "W xz", "W yz")
"""The numbers of a MotionCal packet for the magnetometer, µT and none."""


class Setting(msgspec.Struct, frozen=True):
    """A number in the device: as it is (`None` where it does not tell), as it would be, and as it
    was read back."""

    name: str
    old: float | None
    new: float
    read_back: float | None = None


class Device(Protocol):
    """What can keep a calibration; `name` is "" as long as it is not known."""

    @property
    def name(self) -> str: ...
    def changes(self, calibration: Calibration) -> tuple[list[Setting], tuple[str, ...]]: ...
    def write(
        self, changes: Sequence[Setting], calibration: Calibration
    ) -> Mapping[str, float | None]: ...


class MotionCalDevice:
    """A device that takes the 68 bytes of MotionCal and answers with lines `Cal1:` and `Cal2:`.
    Source: PaulStoffregen/MotionCal, rawdata.c (send_calibration), and the answers of its
    sketches."""

    def __init__(self, write: Callable[[bytes], None], told: dict[str, tuple[float, ...]]) -> None:
        self._write, self._told = write, told

    @property
    def name(self) -> str:
        """What it is called."""
        return "MotionCal device"

    def changes(self, calibration: Calibration) -> tuple[list[Setting], tuple[str, ...]]:
        """The numbers of the packet beside those that the device told."""
        packet, warnings = make_packet(calibration)
        new = (*packet.offset, packet.field, *packet.matrix)
        old = self._read_kept()
        return [Setting(n, old.get(n), v) for n, v in zip(_PACKET, new, strict=True)], warnings

    def write(
        self, changes: Sequence[Setting], calibration: Calibration
    ) -> Mapping[str, float | None]:
        """Send the packet, and wait for the answer."""
        packet, _ = make_packet(calibration)
        self._told.clear()
        self._write(encode_packet(packet))
        until = time.monotonic() + ANSWER_S
        while time.monotonic() < until and not {"Cal1", "Cal2"} <= set(self._told):
            time.sleep(0.05)
        kept = self._read_kept()
        return {change.name: kept.get(change.name) for change in changes}

    def _read_kept(self) -> dict[str, float]:
        """Offsets and matrix in the answers: accelerometer 3, gyroscope 3, V 3, B; W row by row."""
        first, second = self._told.get("Cal1", ()), self._told.get("Cal2", ())
        kept = dict(zip(_PACKET[:4], first[6:10], strict=True)) if len(first) == 10 else {}
        if len(second) == 9:
            kept |= dict(zip(_PACKET[4:], [second[i] for i in (0, 4, 8, 1, 2, 5)], strict=True))
        return kept
