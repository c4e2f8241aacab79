"""What server and page say to each other: JSON with a tag, points as bytes."""

from __future__ import annotations

import struct

import msgspec
import numpy as np
from numpy.typing import NDArray

from agonic.live.streams.device import Setting

MAX_REQUEST_BYTES = 4096
"""Bytes of a message from a page."""


class Problem(msgspec.Struct, frozen=True):
    """Something that is wrong, in a sentence."""

    name: str
    text: str


class Number(msgspec.Struct, frozen=True):
    """A row of the table of numbers: now, its standard error, and by the calibration before."""

    name: str
    unit: str
    now: float | None
    sd: float | None = None
    before: float | None = None


class Rose(msgspec.Struct, frozen=True):
    """The way of a vehicle that stays level, by sectors of heading from magnetic north eastwards.

    `counts` of rows and the largest tilt, degrees, in each sector; where the vehicle stands now;
    `wanted` sectors to be passed next, on ground that slopes by `slope_deg`, and the heading error
    `after_deg` then.
    """

    counts: list[int]
    tilts_deg: list[float]
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    wanted: list[int] = []
    slope_deg: float = 0.0
    after_deg: float | None = None


class Sensor(msgspec.Struct, frozen=True):
    """Where one sensor stands.

    `centre` (3) and `shape` (9) bring readings onto the unit sphere; `cells` (80) readings in each
    direction; `present` and `wanted` where the field points in the sensor's axes and should;
    `heading_sd_deg` and `progress` (0…1) are of the calibration so far; `course` the former over
    the time since the first reading, s; `left_out` what became of readings that do not count;
    `method` the word of the fit, `vehicle_sd_deg` the heading's standard error with how the sensor
    sits in the vehicle, where that was fitted, and `rose` the way of a vehicle that stays level.
    """

    name: str
    n: int
    unit: str
    rate_Hz: float
    say: str
    done: bool
    progress: float
    target_deg: float
    centre: list[float]
    shape: list[float]
    cells: list[int]
    heading_sd_deg: float | None = None
    magnitude: float | None = None
    present: list[float] | None = None
    wanted: list[float] | None = None
    problems: list[Problem] = []
    numbers: list[Number] = []
    before: str = ""
    course: list[tuple[float, float]] = []
    left_out: str = ""
    method: str = "ellipsoid"
    vehicle_sd_deg: float | None = None
    rose: Rose | None = None


class Outcome(msgspec.Struct, frozen=True):
    """What was written for one sensor."""

    sensor: str
    verdict: str
    status: str
    files: list[str]
    warnings: list[str] = []


class Hello(msgspec.Struct, frozen=True, tag="hello"):
    """The first message: what is being read, and the corners (720) of the cells."""

    source: str
    folder: str
    corners: list[float]
    reference: str


class Status(msgspec.Struct, frozen=True, tag="status"):
    """Everything that changes, several times a second."""

    version: int
    connected: bool
    ended: bool
    heard: str
    sensors: list[Sensor]
    accepted: int = 0
    outcomes: list[Outcome] = []
    busy: bool = False
    trouble: str = ""
    device: str = ""
    offer: list[Setting] = []
    offered: str = ""
    device_says: str = ""
    notes: list[str] = []


class Accept(msgspec.Struct, frozen=True, tag="accept"):
    """Write the results."""


class Restart(msgspec.Struct, frozen=True, tag="restart"):
    """Forget the readings of a sensor, or of all."""

    sensor: str | None = None


class Offer(msgspec.Struct, frozen=True, tag="offer"):
    """Show what would be written to the device for a sensor."""

    sensor: str


class Write(msgspec.Struct, frozen=True, tag="write"):
    """Write to the device what was offered for a sensor."""

    sensor: str


PageRequest = Accept | Restart | Offer | Write

_decode = msgspec.json.Decoder(PageRequest)
encode = msgspec.json.Encoder().encode


def parse_request(text: str | bytes) -> PageRequest | None:
    """What a page asks for; `None` where it is not one of the messages."""
    try:
        found: PageRequest = _decode.decode(text)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return None
    return found


def describe_read_back(listed: list[Setting]) -> str:
    """What came of writing, in words."""
    missing = [one.name for one in listed if one.read_back is None]
    wrong = [
        one.name
        for one in listed
        if one.read_back is not None and abs(one.read_back - one.new) > 1e-4 + 1e-5 * abs(one.new)
    ]
    if missing:
        return f"written, but the device did not report {', '.join(missing)}: do not rely on it"
    if wrong:
        return f"the device keeps another value of {', '.join(wrong)}: do not rely on it"
    return "written and read back: the device has it"


def encode_points(sensor: int, total: int, sent_at: float, rows: NDArray[np.float32]) -> bytes:
    """Readings (n, 3) of the sensor at that position, the last of which is the `total`-th.
    Little-endian: sensor and total as uint32, when they were made as float64 (Unix time, s), then x
    y z of each as float32."""
    return struct.pack("<IId", sensor, total & 0xFFFFFFFF, sent_at) + rows.tobytes()
