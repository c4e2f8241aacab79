"""Errors by direction of whatever cause: spherical harmonics along the field."""

from __future__ import annotations

import numpy as np
from scipy.special import sph_harm_y

from agonic.arrays import Array
from agonic.model.term import Errors, Seen, Term

DEGREES = (3, 6)
"""Below the third a harmonic is a bias or soft iron; sizes fall as ℓ^−1.5 up to the last."""
FEW_DEGREES, FEW_ROWS = 4, 150


def harmonics(unit: Array, last: int) -> Array:
    """Real spherical harmonics of the degrees (n, k), of rms ℓ^−1.5 over the sphere."""
    theta, phi = np.arccos(np.clip(unit[:, 2], -1.0, 1.0)), np.arctan2(unit[:, 1], unit[:, 0])
    columns = []
    for degree in range(DEGREES[0], last + 1):
        size = np.sqrt(4 * np.pi) / degree**1.5
        for order in range(degree + 1):
            y = sph_harm_y(degree, order, theta, phi) * size
            columns += [y.real] if order == 0 else [np.sqrt(2) * y.real, np.sqrt(2) * y.imag]
    return np.stack(columns, axis=1)


def by_direction(seen: Seen) -> Errors:
    """The magnitude is off by harmonics of the field's direction in the sensor."""
    last = DEGREES[1] if seen.total >= FEW_ROWS else FEW_DEGREES
    return Errors(harmonics(seen.unit, last)[:, :, None] * seen.unit[:, None, :], apart=False)


DIRECTION = (
    Term(
        name="by direction",
        errors=by_direction,
        scale=1e-3,
        odds=0.05,
        source="what is left of fluxgates and magnetoresistors in coils, 50 nT",
        what="readings err by the direction of the field, of which the model knows nothing",
        move="record away from steel, turning about the sensor itself; see the map of residuals",
        at_rest=True,
        sideways=True,
    ),
)
