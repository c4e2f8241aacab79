"""Gravity as a reference: the angle between the field and the vertical is the same everywhere.

At rest an accelerometer reads the vertical. With d the direction of down in its axes, m the field
in the magnetometer's and R from these to those,

    d · R (m − b) = Z

in every orientation, Z the vertical intensity of the place: vectors in two frames of which one
component is told. Z is the field that nothing but the orientations tells, down; b, a bias that the
magnetometer still has, may be sought as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.alignment.maths.solution import solve
from agonic.alignment.maths.two_frames import GROUPS, Measured, invert, make_prior
from agonic.arrays import Array
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.rotations.mounting import right_angles

VERTICAL = GROUPS["pier"].stop - 1
"""Place of Z among the unknowns of vectors in two frames."""
STARTS = 4
"""Right angles that are started from: of 120 random turns the first or second led to the best."""
NOISE = 1e-3
"""Share of the field by which steps are weighed; the residuals tell the noise itself."""


class GravityEstimate(NamedTuple):
    """R (3, 3), Z, b (3,), the covariance (7, 7) of turn, Z, b, and residuals (k,)."""

    rotation: Array
    vertical: float
    bias: Array
    covariance: Array
    residuals: Array
    freedom: int


def estimate(
    down: Array, field: Array, *, bias: bool = False, gravity: Array | None = None
) -> GravityEstimate:
    """R, Z and perhaps b of k orientations, from whichever of the 24 right angles fits best.

    Parameters: down (k, 3) unit vectors, field (k, 3), the size of gravity (k,) that was read. The
    noise follows from the residuals, and is no less than the sizes of field and gravity scatter by,
    which are the same everywhere too: six orientations leave two residuals, small by chance. The
    covariance is widened by Student's t of the residuals' freedom.
    """
    size = float(np.linalg.norm(field, axis=1).mean())
    measured = _measure(down, field / size)
    prior = make_prior({"alignment", *(("bias",) if bias else ())})
    prior[VERTICAL] = 0.0
    found = min(
        (
            solve(measured, prior, (0.0, 0.0, z), rot_bm.T)
            for rot_bm, z in _starts(down, field / size)
        ),
        key=lambda one: one.chi2,
    )
    at, rotation = found.unknowns, found.unknowns.rot_mc.T
    residuals = (down * ((field / size - at.bias) @ at.rot_mc)).sum(axis=1) - at.offset[2]
    variance = float(residuals @ residuals) / found.freedom if found.freedom > 0 else np.nan
    variance = max(variance, _scatter_of_sizes(field / size - at.bias, at.offset[2], gravity))
    variance *= compute_widening(found.freedom) ** 2
    # turns are counted about the axes of the accelerometer, and the other way round
    onto = np.zeros((7, 18))
    onto[:3, GROUPS["alignment"]] = -rotation
    onto[3, VERTICAL] = size
    onto[4:, GROUPS["bias"]] = size * np.eye(3)
    covariance = onto @ invert(found.information, prior) @ onto.T * variance / NOISE**2
    return GravityEstimate(
        rotation,
        float(at.offset[2] * size),
        at.bias * size,
        covariance,
        residuals * size,
        found.freedom,
    )


def _measure(down: Array, field: Array) -> Measured:
    """Vectors in two frames, of the field's attitude only down known, and only along it read."""
    attitude = np.zeros((len(down), 3, 3))
    attitude[:, :, 2] = down
    none = np.zeros(len(down))
    return Measured(
        field, np.zeros_like(field), attitude, np.zeros_like(attitude), none + NOISE, none, down
    )


def _starts(down: Array, field: Array) -> list[tuple[Array, float]]:
    """The right angles by which the vertical field varies least, and what it is by them."""
    vertical = (down @ right_angles() * field).sum(axis=-1)
    best = np.argsort(vertical.var(axis=1))[:STARTS]
    return [(right_angles()[k], float(vertical[k].mean())) for k in best]


def _scatter_of_sizes(field: Array, vertical: float, gravity: Array | None) -> float:
    """Variance that the sizes of field (k, 3) and gravity (k,) show the vertical field to have: by
    its own errors, and by those of the tilt times the horizontal field."""
    sizes = np.linalg.norm(field, axis=1)
    scatter = float(sizes.var(ddof=1))
    if gravity is not None:
        horizontal = max(float(np.mean(sizes**2)) - vertical**2, 0.0)
        scatter += horizontal * float(np.var(gravity / gravity.mean(), ddof=1))
    return scatter
