"""Which headings a deviation curve rests on, what they leave open, and which to add."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.deviation import ROSE_DEG, basis

CELL_DEG = 5.0
CIRCLE_DEG = np.arange(0.0, 360.0, 2.0)


def find_visited(compass_deg: Array) -> Array:
    """The headings that were steered, one for each cell of 5°, however often."""
    heading = np.asarray(compass_deg) % 360.0
    cells = np.minimum((heading // CELL_DEG).astype(np.int64), int(360 / CELL_DEG) - 1)
    counts = np.bincount(cells)
    sums = np.bincount(cells, weights=heading)
    return np.asarray(sums[counts > 0] / counts[counts > 0])


def compute_largest_gap_deg(headings_deg: Array) -> float:
    """The widest arc between neighbouring headings."""
    ordered = np.sort(np.asarray(headings_deg) % 360.0)
    return float(np.diff(np.append(ordered, ordered[0] + 360.0)).max())


def compute_unit_sd(headings_deg: Array, chosen: Mask, at_deg: Array = CIRCLE_DEG) -> Array:
    """Standard error of the level curve over that of one reading, were each heading read once.

    Infinite where the headings leave a term open. `chosen` (5,) marks the level terms.
    """
    rows, at = (basis(h)[:, :5][:, chosen] for h in (headings_deg, at_deg))
    values, vectors = np.linalg.eigh(rows.T @ rows)
    open_ = values < 1e-9 * len(rows)
    along = (at @ vectors) ** 2
    variance = (along[:, ~open_] / values[~open_]).sum(axis=1)
    return np.asarray(np.where(along[:, open_].sum(axis=1) > 1e-9, np.inf, np.sqrt(variance)))


def compute_amplification(headings_deg: Array, chosen: Mask) -> float:
    """The curve's largest standard error over that of as many headings evenly spread; 1 is best."""
    even = np.sqrt(chosen.sum() / len(headings_deg))
    return float(compute_unit_sd(headings_deg, chosen).max() / even)


def find_missing_deg(headings_deg: Array, chosen: Mask, enough: float) -> Array:
    """Headings to add: those of the eight points that were not steered within half a point, and of
    the sixteen those where the curve is known worst, until `compute_amplification` is `enough`."""
    have = np.asarray(headings_deg, dtype=np.float64)
    added = [float(h) for h in ROSE_DEG if _apart_deg(h, have) > 22.5]
    while compute_amplification(np.append(have, added), chosen) > enough and len(added) < 16:
        known = np.append(have, added)
        free = [h for h in np.arange(0.0, 360.0, 22.5) if _apart_deg(h, known) >= 11.25]
        if not free:
            break
        added.append(free[int(np.argmax(compute_unit_sd(known, chosen, np.array(free))))])
    return np.sort(np.array(added))


def _apart_deg(heading_deg: float, others_deg: Array) -> float:
    return float(np.abs(wrap_deg(others_deg - heading_deg)).min())
