"""Readings summed up in boxes of equal size: any time of turning a sensor, in bounded room.

A box keeps how often it was visited and the 35 moments of its readings, so that a sensor at rest
fills one box and cannot drown the others. The boxes of readings on an ellipsoid are few; where they
become too many their edge doubles and eight become one, which only adds their moments. What is kept
depends on the readings and their order, never on how they were cut in chunks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index
from agonic.maths.equation import moments

Keys = NDArray[np.int64]

MAX_BOXES = 768
"""Boxes that are kept at most; a full turn about all axes then fills a hundred or more."""

FAR_BOX = 2**20
"""Boxes from the origin that are told apart; what lies further is taken for so far."""


class Voxels(NamedTuple):
    """Boxes of an edge: their indices `keys` (k, 3), and the moments `sums` (k, 35) of readings.
    The moments are those of (reading − centre)/scale."""

    edge: float
    centre: Array
    scale: float
    keys: Keys
    sums: Array

    @property
    def counts(self) -> Array:
        """How many readings each box holds, (k,)."""
        return np.asarray(self.sums[:, 0])

    @property
    def middles(self) -> Array:
        """The mean reading of each box, (k, 3)."""
        first = [moments.EXPONENTS.index(e) for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        return np.asarray(self.centre + self.scale * self.sums[:, first] / self.counts[:, None])


def begin(first: Array, edge: float) -> Voxels:
    """No boxes yet, about the first reading (3,); `edge` is best far too small."""
    size = max(float(np.linalg.norm(first)), edge)
    return Voxels(edge, first, size, np.empty((0, 3), np.int64), np.empty((0, 35)))


def add_readings(voxels: Voxels, readings: Array, most: int = MAX_BOXES) -> tuple[Voxels, Array]:
    """The boxes with readings (n, 3) put in, and the how-many-eth of its box each was, (n,)."""
    rows = np.asarray(readings, dtype=np.float64)
    places = [np.empty(0)]
    while len(rows):
        taken = _count_fitting(voxels, rows, most)
        voxels, place = _put(voxels, rows[:taken])
        places.append(place)
        rows = rows[taken:]
        while len(voxels.keys) > most:
            voxels = _double(voxels)
    return voxels, np.concatenate(places)


def compute_keys(voxels: Voxels, readings: Array) -> Keys:
    """The boxes (n, 3) in which readings lie."""
    return np.floor(np.clip(readings / voxels.edge, -FAR_BOX, FAR_BOX - 1)).astype(np.int64)


def _encode(keys: Keys) -> NDArray[np.int64]:
    """One number for each key, which is much faster to compare than three."""
    shifted = keys + FAR_BOX
    return np.asarray((shifted[:, 0] << 42) | (shifted[:, 1] << 21) | shifted[:, 2])


def _count_fitting(voxels: Voxels, rows: Array, most: int) -> int:
    """How many rows can be put in before there are more boxes than `most`."""
    keys = np.concatenate([voxels.keys, compute_keys(voxels, rows)])
    _, first = np.unique(_encode(keys), return_index=True)
    if len(first) <= most:
        return len(rows)
    return int(np.sort(first)[most]) - len(voxels.keys) + 1


def _put(voxels: Voxels, rows: Array) -> tuple[Voxels, Array]:
    terms = moments.powers(rows, voxels.centre, voxels.scale)
    keys = np.concatenate([voxels.keys, compute_keys(voxels, rows)])
    box, chosen = _number_boxes(keys)
    sums = _sum(box, np.concatenate([voxels.sums, terms]), len(chosen))
    before = np.zeros(len(chosen))
    before[: len(voxels.keys)] = voxels.counts
    mine = box[len(voxels.keys) :]
    place = before[mine] + 1 + _count_earlier(mine)
    return voxels._replace(keys=keys[chosen], sums=sums), place


def _double(voxels: Voxels) -> Voxels:
    """The boxes merged into those of twice the edge."""
    keys = voxels.keys // 2
    box, chosen = _number_boxes(keys)
    sums = _sum(box, voxels.sums, len(chosen))
    return voxels._replace(edge=2 * voxels.edge, keys=keys[chosen], sums=sums)


def _number_boxes(keys: Keys) -> tuple[Index, Index]:
    """The number of the box of each key, counted as they came, and the first key of each box."""
    _, first, inverse = np.unique(_encode(keys), return_index=True, return_inverse=True)
    order = np.argsort(first)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    return number[inverse.ravel()], first[order]


def _sum(box: Index, sums: Array, boxes: int) -> Array:
    """The moments (n, 35) of each box, added one after the other, as they came."""
    place = (35 * box[:, None] + np.arange(35)).ravel()
    return np.asarray(np.bincount(place, sums.ravel(), 35 * boxes).reshape(boxes, 35))


def _count_earlier(box: Index) -> Array:
    """How many rows before each one fell into the same box."""
    order = np.argsort(box, kind="stable")
    first = np.searchsorted(box[order], box[order])
    earlier = np.empty(len(box))
    earlier[order] = np.arange(len(box)) - first
    return earlier
