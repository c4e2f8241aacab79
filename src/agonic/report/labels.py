"""Units, frames and sources as they are shown."""

from __future__ import annotations

import re

from agonic.units import RAW

TIMING = r"[@~].*"
"""How late a source is recorded, or through which filter: behind its name."""
PER = {
    "A": "per A",
    "W": "per W",
    "Am2": "per A m²",
    "duty": "at full duty",
    "throttle": "at full throttle",
}
"""What a source on board is counted in, by the end of its name."""

FRAMES = {
    "m": "magnetometer",
    "b": "body: forward, right, down",
    "c": "star camera",
    "n": "north, east, down",
    "e": "Earth-fixed",
    "i": "inertial",
}
"""What the letter of a frame stands for."""


def per_label(source: str) -> str:
    """What the coefficient of a source is for."""
    column, power, _ = re.sub(TIMING, "", source).partition("^")
    if ">" in source:
        return "while on"
    unit = column.rsplit("_", 1)[-1]
    bounded = unit in ("duty", "throttle")
    return f"per unit of {source}" if power and not bounded else PER.get(unit, "per unit")


def unit_label(unit: str) -> str:
    """A unit as it is shown."""
    return "raw units" if unit == RAW else unit
