"""The reading of an absolute scalar magnetometer, beside the vector that it is to teach."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array

MOST_OF_THE_ROWS = 0.5
"""With the scalar instrument on in so many of the rows, the others are given up for it."""
SAME = 1e-3
"""nT; a magnitude this near to that of the vector was computed from it."""


def compare_scalar(field: Array, scalar: Array) -> tuple[Array, Array | None, tuple[str, ...]]:
    """The field (n, 3) and the scalar reading (n,), both nT, as they can stand beside each other.

    A reading that is not above zero is none. Rows without one lose their field where most rows
    have one, which is worth more than they are; else the scalar column is left out. So is one
    that is the magnitude of the vector itself.

    >>> field = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0], [0.0, 0.0, 2.0]])
    >>> _, scalar, notes = compare_scalar(field, np.array([5.1, 9.9, 0.0]))
    >>> scalar.tolist(), notes
    ([5.1, 9.9, nan], ('no scalar reading in 1 of 3 rows: left out',))
    >>> compare_scalar(field, np.array([5.0, 10.0, 2.0]))[1:]
    (None, ('F is the magnitude of the vector, not the reading of a scalar instrument',))
    """
    readings = np.asarray(np.isfinite(field).all(axis=1))
    known = np.isfinite(scalar) & (scalar > 0)
    both = readings & known
    if not both.any():
        return field, None, ()
    if np.abs(np.linalg.norm(field[both], axis=1) - scalar[both]).max() < SAME:
        note = "F is the magnitude of the vector, not the reading of a scalar instrument"
        return field, None, (note,)
    if both.all():
        return field, scalar, ()
    missing = int((readings & ~known).sum())
    said = f"no scalar reading in {missing} of {readings.sum()} rows"
    if both.sum() < MOST_OF_THE_ROWS * readings.sum():
        return field, None, (f"{said}: the scalar column was left out",)
    kept = np.where(both[:, None], field, np.nan)
    return kept, np.where(known, scalar, np.nan), (f"{said}: left out",) if missing else ()
