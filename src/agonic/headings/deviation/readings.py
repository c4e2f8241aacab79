"""The readings of a swing as arrays that fit together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError, CoverageError
from agonic.maths.rotations import deviation as kernel


class SwingReadings(NamedTuple):
    """The finite rows: compass (n,), reference − compass (n,), roll and pitch (n, 0…2)."""

    compass: Array
    difference: Array
    tilt: Array
    declination: float
    left_out: int

    @property
    def rows(self) -> Array:
        """The basis of every term, (n, 9)."""
        roll, pitch = np.hstack([self.tilt, np.zeros((len(self.tilt), 2))])[:, :2].T
        return kernel.basis(self.compass, roll, pitch)

    @property
    def heeled(self) -> Mask:
        """Whether there was any roll, any pitch, (2,)."""
        return np.hstack([self.tilt.any(axis=0), [False, False]])[:2]

    @property
    def rounding_deg(self) -> float:
        """Standard deviation of the rounding of a difference, from its decimals: q / √12.

        A step q of more than 1° cannot be told from headings that were steered by multiples of it.
        """
        for step in (1.0, 0.5, 0.1, 0.01):
            parts = self.difference / step
            # what is left of decimals in double precision
            if np.abs(parts - np.round(parts)).max() < 1e-6:
                return float(step / np.sqrt(12.0))
        return 0.0

    @property
    def columns(self) -> Array:
        """Everything that went in, for its hash."""
        return np.column_stack([self.compass, self.difference, self.tilt])


def select_complete(
    compass_deg: ArrayLike,
    reference_deg: ArrayLike,
    heel: ArrayLike | None,
    declination_deg: ArrayLike | None,
) -> SwingReadings:
    """The readings that are complete, or a clear error."""
    compass, reference = (
        np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (compass_deg, reference_deg)
    )
    if compass.ndim != 1 or compass.shape != reference.shape:
        raise AgonicError(
            f"compass and reference headings must be (n,) alike, not {compass.shape} and "
            f"{reference.shape}"
        )
    declination = np.asarray(0.0 if declination_deg is None else declination_deg, dtype=np.float64)
    if not (np.abs(declination) <= 180.0).all():
        raise AgonicError("declination_deg must lie within ±180°, east positive")
    if declination.shape not in ((), compass.shape):
        raise AgonicError(f"declination_deg must be one or (n,), not {declination.shape}")
    tilt = np.empty((len(compass), 0)) if heel is None else np.asarray(heel, dtype=np.float64)
    tilt = tilt[:, None] if tilt.ndim == 1 else tilt
    if tilt.ndim != 2 or len(tilt) != len(compass) or tilt.shape[1] > 2:
        raise AgonicError(
            f"heel has shape {tilt.shape}; give roll (n,), or roll and pitch (n, 2), for "
            f"{len(compass)} headings"
        )
    reference = reference - declination
    good = np.isfinite(np.column_stack([compass, reference, tilt])).all(axis=1)
    if not good.any():
        raise CoverageError(
            "there is no complete reading", turns="note compass and reference on eight headings"
        )
    return SwingReadings(
        compass[good] % 360.0,
        (reference - compass)[good],
        tilt[good],
        float(declination.mean()),
        int((~good).sum()),
    )
