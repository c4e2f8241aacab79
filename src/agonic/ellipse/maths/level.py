"""What a fit in the plane comes to for headings: their standard error, and the circle seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index

SECTORS = 24
"""Of the circle, 15° each."""
FEW = 5 * SECTORS
"""Readings of which chance leaves some sectors empty."""


def compute_heading_sd_deg(matrix: Array, covariance: Array, magnitude: float) -> float:
    """Standard error of a level heading that the calibration makes, rms over all headings.

    heading = atan2(−f_y, f_x), f = W (raw − bias): the error of f across itself over its length.
    Parameters: matrix (2, 2), covariance (5, 5) of bias x y and matrix xx yy xy.
    """
    angle = np.radians(np.arange(0.0, 360.0, 10.0))
    unit = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    across = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    d = magnitude * unit @ np.linalg.inv(matrix)
    row = np.column_stack(
        [
            -across @ matrix,
            across[:, 0] * d[:, 0],
            across[:, 1] * d[:, 1],
            across[:, 0] * d[:, 1] + across[:, 1] * d[:, 0],
        ]
    )
    variance = np.einsum("ni,ij,nj->n", row, covariance, row) / magnitude**2
    return float(np.degrees(np.sqrt(variance.mean())))


def find_sectors(field: Array) -> Index:
    """Readings in each of the sectors of the circle, (24,), by the direction of the field (n, 2).

    Few readings leave sectors empty by chance: they have sectors twice as wide, (12,).

    >>> np.flatnonzero(find_sectors(np.array([[1.0, 0.1], [-1.0, 0.1]]))).tolist()
    [0, 5]
    """
    angle = np.arctan2(field[:, 1], field[:, 0]) % (2 * np.pi)
    many = SECTORS if len(field) >= FEW else SECTORS // 2
    sector = (angle * many / (2 * np.pi)).astype(int) % many
    return np.bincount(sector, minlength=many)


def compute_turns(field: Array) -> tuple[float, float]:
    """How many turns were made to the right and to the left, by the field (n, 2) in time order."""
    heading = np.unwrap(np.arctan2(-field[:, 1], field[:, 0]))
    steps = np.diff(heading[:: max(len(heading) // 200, 1)]) / (2 * np.pi)
    return float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())


def compute_lasting(residuals: Array) -> float:
    """What of residuals (n,) in time order lasts from one to the next, rms; 0 where chance does it.

    The variance less half the mean square of successive differences, which white noise has as
    large (von Neumann 1941); it has to exceed three of its standard errors.
    """
    n = len(residuals)
    if n < 10:
        return 0.0
    variance = float(residuals.var())
    fast = float(np.mean(np.diff(residuals) ** 2)) / 2
    lasting = variance - fast
    return float(np.sqrt(lasting)) if lasting > 3 * variance / np.sqrt(n) else 0.0
