"""What exported files say at their head, and how they write numbers of single precision."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable

import numpy as np

from agonic.calibration.base import Calibration
from agonic.calibration.encoding import encode
from agonic.calibration.steps import steps_of


def write_banner(
    calibration: Calibration, formula: str, warnings: Iterable[str] = ()
) -> tuple[str, ...]:
    """Comment lines, plain ASCII: what the file is, its equation, origin and warnings."""
    origins = [calibration.provenance, *(step.provenance for step in steps_of(calibration))]
    inputs = dict.fromkeys(i for origin in origins for i in origin.inputs)
    methods = dict.fromkeys(key for origin in origins for key in origin.method)
    software, created = origins[0].software, origins[0].created
    lines = (
        f"Calibration of magnetometer {calibration.sensor}, {software}, {created}",
        f"Calibration: {calibration.equation}, "
        f"axes {calibration.frame_in} to {calibration.frame_out}",
        f"This file: {formula}",
        *(f"Input: {i.name}, {i.count} rows, SHA-256 {i.sha256}" for i in inputs),
        *(f"Method: {key}" for key in methods),
        f"SHA-256 of the calibration file: {hashlib.sha256(encode(calibration)).hexdigest()}",
        *(f"Warning: {warning}" for warning in warnings),
    )
    return tuple(map(_write_ascii, lines))


def _write_ascii(text: str) -> str:
    """A line that any compiler and ground station reads."""
    text = re.sub(r"(?<=\d)°", " deg", text)
    for sign, plain in (("°", "deg "), ("…", ".."), ("−", "-")):
        text = text.replace(sign, plain)
    return " ".join(text.split()).encode("ascii", "backslashreplace").decode()


def format_float32(value: float) -> str:
    """The shortest decimal that reads back as the same float32."""
    return np.format_float_positional(np.float32(value + 0.0), unique=True, trim="0")
