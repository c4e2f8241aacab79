"""Errors by direction of whatever cause: spherical harmonics along the field."""

from __future__ import annotations

from math import factorial, prod

import numpy as np

from agonic.arrays import Array
from agonic.model.term import Errors, Seen, Term

DEGREES = (3, 6)
"""Below the third a harmonic is a bias or soft iron; sizes fall as ℓ^−1.5 up to the last."""
WITH_HIDDEN = 1.0 + 5 / 2**3 / sum((2 * d + 1) / d**3 for d in range(DEGREES[0], DEGREES[1] + 1))
"""Mean square with the second degree, which soft iron hides, over that which shows, by sizes."""
FEW_DEGREES, FEW_ROWS = 4, 150


def harmonics(unit: Array, last: int) -> Array:
    """Real spherical harmonics (k, n) of the degrees, of rms ℓ^−1.5 over the sphere.

    Of the order m they are the real and imaginary part of (x + iy)^m times a polynomial of z, by
    (ℓ − m) P_ℓ = (2ℓ − 1) z P_ℓ₋₁ − (ℓ + m − 1) P_ℓ₋₂ from P_m = (2m − 1)!!.
    """
    z, turned = unit[:, 2], unit[:, 0] + 1j * unit[:, 1]
    columns, around = [], np.ones(len(unit), dtype=complex)
    for m in range(last + 1):
        before, now = np.zeros(len(z)), np.full(len(z), float(prod(range(1, 2 * m, 2))))
        for degree in range(m, last + 1):
            if degree > m:
                rise = (2 * degree - 1) * z * now - (degree + m - 1) * before
                before, now = now, rise / (degree - m)
            if degree >= DEGREES[0]:
                ratio = factorial(degree - m) / factorial(degree + m) * (1 if m == 0 else 2)
                size = np.sqrt((2 * degree + 1) * ratio) / degree**1.5 * now
                columns += (
                    [size * around.real]
                    if m == 0
                    else [
                        size * around.real,
                        size * around.imag,
                    ]
                )
        around = around * turned
    return np.stack(columns)


def by_direction(seen: Seen) -> Errors:
    """The magnitude is off by harmonics of the field's direction in the sensor."""
    last = DEGREES[1] if seen.total >= FEW_ROWS else FEW_DEGREES
    return Errors(harmonics(seen.unit, last)[:, None] * seen.unit.T, apart=False)


DIRECTION = (
    Term(
        name="by direction",
        errors=by_direction,
        scale=1e-3,
        source="what is left of fluxgates and magnetoresistors in coils, 50 nT",
        what="readings err by the direction of the field, of which the model knows nothing",
        move="record away from steel, turning about the sensor itself; see the map of residuals",
        at_rest=True,
        sideways=WITH_HIDDEN,
    ),
)
