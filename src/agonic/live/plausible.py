"""Readings that no magnetometer gives: left out at the door, before they can spoil a sum."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.units import RAW

LARGEST_nT = 1e8
"""0.1 T: beyond the range of every magnetometer, Hall sensors included."""

LARGEST_COUNT = 2.0**31
"""Of a converter of 32 bits."""

FAR = 3.0
"""Times the usual distance from the midst of all boxes; a whole sphere is at one, an arc below
two."""

FEW = 0.02
"""Of the readings: more that lie far off are no stray ones."""


def find_plausible(field: Array, unit: str) -> Mask:
    """Which readings (n, 3), in nT or raw counts, a sensor can have given: finite, within what any
    measures, and not exactly zero on all axes, which is a sensor that has not begun.

    >>> find_plausible(np.array([[2e4, 0, 4e4], [4.5e15, 12, 3], [0, 0, 0]]), "nT")
    array([ True, False, False])
    """
    largest = LARGEST_COUNT if unit == RAW else LARGEST_nT
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(field) < largest).all(axis=1) & (field != 0).any(axis=1))


def find_stray(middles: Array, counts: Array) -> Mask:
    """Which boxes (k,) lie far from all others and hold few readings: garbled numbers and spikes.

    A fit by moments begins at the best sphere through all of them, which a single reading ten
    times as far as the others would carry away.

    >>> circle = np.linspace(0, 6, 40)[:, None]
    >>> boxes = np.column_stack([np.cos(circle), np.sin(circle), 0 * circle])
    >>> find_stray(np.vstack([boxes, [[6.0, 0, 0]]]), np.ones(41)).nonzero()
    (array([40]),)
    """
    distance = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    far = distance > FAR * np.median(distance)
    few = counts[far].sum() <= max(FEW * counts.sum(), 2)
    return np.asarray(far & few)
