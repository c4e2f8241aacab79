"""What a source tells: readings, and how it is getting on."""

from __future__ import annotations

from typing import NamedTuple

from agonic.arrays import Array


class Chunk(NamedTuple):
    """Readings of one sensor: `time` (n,) s, `field` (n, 3) in `unit`, in the axes `frame`.

    `motion` (n, 6) is what an inertial unit told with them: acceleration, m/s², and rotation rate,
    rad/s, NaN where it did not; `own` (n,) the device's own clock, s, NaN where it told none.
    """

    sensor: str
    time: Array
    field: Array
    unit: str
    frame: str = "m"
    device_id: int | None = None
    motion: Array | None = None
    own: Array | None = None


class Notice(NamedTuple):
    """How a source is getting on, in words; `connected` whether readings can come."""

    connected: bool
    text: str
    ended: bool = False


class Words(NamedTuple):
    """Lines of another kind than readings, of one sender, without the mark that told them."""

    origin: str
    lines: list[str]


Event = Chunk | Notice | Words
