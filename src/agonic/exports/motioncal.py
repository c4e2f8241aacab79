"""MotionCal, Adafruit and NXPMotionSense: the 68-byte calibration packet.

    field = invW (raw − V),   microtesla, sensor axes

    75 54 | 16 float32: accelerometer 3, gyroscope 3, V 3, B, invW xx yy zz xy xz yz | CRC-16

all little-endian; the CRC (polynomial A001 reflected, start FFFF) over the 68 bytes is zero.
Source: PaulStoffregen/MotionCal, rawdata.c (`send_calibration`), visualize.c
(`apply_calibration`).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.steps import find_magnitude
from agonic.exports.convert import Export, hold_sources, take_symmetric
from agonic.exports.temperature import hold_temperature
from agonic.units import NANOTESLA_PER, RAW

SIGNATURE = b"\x75\x54"
PACKET_BYTES = 68
COUNT_NT = 100.0  # nT, UT_PER_COUNT of rawdata.c
FIELD_UT = 50.0  # µT, MotionCal's own default for B


@dataclass(frozen=True, kw_only=True)
class Packet:
    """The magnetometer's part of a packet: V (3) µT, B µT, and invW xx yy zz xy xz yz (6)."""

    offset: tuple[float, ...]
    field: float
    matrix: tuple[float, ...]


def write_motioncal(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write the packet that makes a MotionCal device apply a calibration.

    Parameters: `calibration`; `path` of the file; `temperature_C`. Send the bytes to the device's
    serial port. Accelerometer and gyroscope offsets are zero, as MotionCal sends them.
    `temperature_C` is where a calibration is held that changes with temperature. Counts are taken
    for tenths of a microtesla, as MotionCal does. Raises `UnitError` where the field has no unit.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3), magnitude=48000.0)
    >>> with TemporaryDirectory() as folder:
    ...     export = write_motioncal(mag, folder + "/mag.bin")
    ...     data = export.path.read_bytes()
    >>> struct.unpack("<4f", data[26:42]), len(data)
    ((3.0, 0.0, 0.0, 48.0), 68)
    """
    one, lost = hold_temperature(calibration, temperature_C)
    packet, warnings = make_packet(one)
    warnings = (*lost, *warnings)
    written = write_atomically(path, encode_packet(packet))
    return Export(path=written, target="motioncal", warnings=warnings)


def make_packet(calibration: Calibration) -> tuple[Packet, tuple[str, ...]]:
    """The numbers of the packet, and warnings."""
    calibration, held = hold_sources(calibration)
    calibration, counted = _convert_counts(calibration)
    bias, six, warnings = take_symmetric(calibration, calibration.frame_in, unit="microtesla")
    warnings += (*held, *counted)
    magnitude = find_magnitude(calibration)
    if magnitude is None:
        warnings += (
            f"the field magnitude is not known: {FIELD_UT:.0f} uT was written for B, which only "
            "serves the device to notice disturbed readings",
        )
        field = FIELD_UT
    else:
        field = magnitude / NANOTESLA_PER["uT"]
    offset = tuple((bias / NANOTESLA_PER["uT"]).tolist())
    return Packet(offset=offset, field=field, matrix=tuple(six.tolist())), warnings


def _convert_counts(calibration: Calibration) -> tuple[Calibration, tuple[str, ...]]:
    """A calibration from counts into a known field as one from nT, and what was assumed."""
    from_counts = calibration.unit_in == RAW and calibration.unit_out != RAW
    if not from_counts or not isinstance(calibration, Affine):
        return calibration, ()
    gain = float(np.trace(calibration.matrix)) / 3
    said = (
        f"counts were taken for tenths of a microtesla ({COUNT_NT:.0f} nT), as MotionCal takes "
        f"those that a board sends it; by the field one is {gain:.3g} nT"
    )
    made = Affine(
        bias=COUNT_NT * calibration.bias,
        matrix=calibration.matrix / COUNT_NT,
        magnitude=calibration.magnitude,
        frame_in=calibration.frame_in,
        frame_out=calibration.frame_out,
    )
    return made, (said,)


def encode_packet(packet: Packet) -> bytes:
    """The 68 bytes of a packet."""
    values = (0.0,) * 6 + packet.offset + (packet.field,) + packet.matrix
    body = SIGNATURE + struct.pack("<16f", *values)
    return body + struct.pack("<H", compute_crc16(body))


def compute_crc16(data: bytes) -> int:
    """CRC-16/MODBUS: polynomial A001 (reflected), start FFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc
