"""`Moments`: the 35 numbers that an algebraic fit needs of any amount of data, mergeable."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.equation import moments as kernel
from agonic.readable import Readable
from agonic.units import RAW

_MAGIC = b"AGM1"
_LAYOUT = struct.Struct("<4s8s4d35d")


@dataclass(frozen=True, kw_only=True, eq=False)
class Moments(Readable):
    """Sums of powers of (readings − centre)/scale, up to the fourth.

        Σ x^a y^b z^c,   a + b + c ≤ 4

    Sums of chunks, workers or days: `a + b` moves b to a's centre and adds. Constant memory.

    >>> first = Moments.of([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> (first + Moments.of([[-1.0, 0, 0], [0, -1, 0]])).count
    5
    """

    centre: Array
    scale: float
    sums: Array
    unit: str = "nT"

    @classmethod
    def of(
        cls,
        field: ArrayLike,
        *,
        centre: ArrayLike | None = None,
        scale: float | None = None,
        unit: str = "nT",
    ) -> Moments:
        """Moments of readings `field` (n, 3), about the middle and spread of some if not given.

        Any `centre` (3,) and scale near those of the readings serve; they only keep rounding away.
        """
        rows = np.asarray(field, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3 or not len(rows):
            raise AgonicError(f"moments need readings (n, 3), not {rows.shape}")
        some = rows[:: max(1, len(rows) // 10_000)]
        about = some.mean(axis=0) if centre is None else np.asarray(centre, dtype=np.float64)
        size = scale or float(np.linalg.norm(some - about) / np.sqrt(len(some))) or 1.0
        sums = kernel.accumulate(rows, about, size)
        if not np.isfinite(sums).all():
            raise AgonicError("moments need finite readings; leave out those that are not")
        return cls(centre=about, scale=size, sums=sums, unit=unit)

    def add(self, field: ArrayLike) -> Moments:
        """These moments with more readings `field` (n, 3) added."""
        more = Moments.of(field, centre=self.centre, scale=self.scale, unit=self.unit)
        return replace(self, sums=self.sums + more.sums)

    def __add__(self, other: Moments) -> Moments:
        """The moments of both sets of readings."""
        if other.unit != self.unit:
            raise AgonicError(f"moments in {self.unit} and {other.unit} cannot be added")
        moved = other.rebase(self.centre, self.scale)
        return replace(self, sums=self.sums + moved.sums)

    def rebase(self, centre: ArrayLike, scale: float) -> Moments:
        """The same readings' moments about another `centre` (3,) and scale."""
        about = np.asarray(centre, dtype=np.float64)
        sums = kernel.rebase(self.sums, self.centre, self.scale, about, scale)
        return replace(self, centre=about, scale=scale, sums=sums)

    @property
    def count(self) -> int:
        """How many readings went in."""
        return round(float(self.sums[0]))

    def to_bytes(self) -> bytes:
        """The moments as 324 bytes, little-endian, the same on every machine."""
        unit = self.unit.encode().ljust(8, b"\0")
        return _LAYOUT.pack(_MAGIC, unit, *self.centre, self.scale, *self.sums)

    @classmethod
    def from_bytes(cls, data: bytes) -> Moments:
        """The moments that `to_bytes` wrote."""
        if len(data) != _LAYOUT.size or data[:4] != _MAGIC:
            raise AgonicError(f"these {len(data)} bytes are not moments written by to_bytes")
        _, unit, *numbers = _LAYOUT.unpack(data)
        return cls(
            centre=np.array(numbers[:3]),
            scale=numbers[3],
            sums=np.array(numbers[4:]),
            unit=unit.rstrip(b"\0").decode() or RAW,
        )
