"""Units, frames and sources as they are shown."""

from __future__ import annotations

from agonic.units import RAW

PER = {"current": "per A", "throttle": "at full throttle", "second": "per unit"}
"""What a source on board is counted in."""

FRAMES = {
    "m": "magnetometer",
    "b": "body: forward, right, down",
    "c": "star camera",
    "n": "north, east, down",
    "e": "Earth-fixed",
    "i": "inertial",
}
"""What the letter of a frame stands for."""


def unit_label(unit: str) -> str:
    """A unit as it is shown.

    >>> unit_label("raw")
    'raw units'
    """
    return "raw units" if unit == RAW else unit
