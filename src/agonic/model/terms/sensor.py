"""Terms of the sensor itself: bends, compression, cross-talk, lag, memory, turns; and errors by
direction of whatever cause: spherical harmonics along the field."""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import legvander

from agonic.arrays import Array, Index
from agonic.maths.one_pass import find_length
from agonic.model.term import Errors, Seen, Term, along_time

DEGREES = (3, 6)
"""Below the third a harmonic is a bias or soft iron; sizes fall as ℓ^−1.5 up to the last."""
WITH_HIDDEN = 1.0 + 5 / 2**3 / sum((2 * d + 1) / d**3 for d in range(DEGREES[0], DEGREES[1] + 1))
"""Mean square with the second degree, which soft iron hides, over that which shows, by sizes."""
FEW_DEGREES, FEW_ROWS = 4, 150


def harmonics(unit: Array, last: int) -> Array:
    """Real spherical harmonics (k, n) of the degrees, of rms ℓ^−1.5 over the sphere.

    Of the order m they are the real and imaginary part of (x + iy)^m times the m-th derivative of
    the Legendre polynomial P_ℓ(z).
    """
    orders, by_power = _list_harmonics(last)
    z, turned = unit[:, 2], unit[:, 0] + 1j * unit[:, 1]
    around = np.cumprod(np.vstack([np.ones(len(z)), np.tile(turned, (last, 1))]), axis=0)
    parts = np.vstack([around.real, around.imag])
    return np.asarray((by_power @ np.vander(z, last + 1, increasing=True).T) * parts[orders])


@lru_cache(maxsize=4)
def _list_harmonics(last: int) -> tuple[Index, Array]:
    """The order (k,) of each harmonic, beyond the last of its imaginary part, and what it has of
    each power of z, (k, last + 1)."""
    orders, rows = [], []
    for m in range(last + 1):
        for degree in range(max(m, DEGREES[0]), last + 1):
            ratio = factorial(degree - m) / factorial(degree + m) * (1 if m == 0 else 2)
            powers = Legendre.basis(degree).deriv(m).convert(kind=Polynomial).coef
            row = np.sqrt((2 * degree + 1) * ratio) / degree**1.5 * powers
            for order in (m, m + last + 1) if m else (m,):
                orders.append(order)
                rows.append(np.append(row, np.zeros(last + 1 - len(row))))
    return np.array(orders), np.array(rows)


def by_direction(seen: Seen) -> Errors:
    """The magnitude is off by harmonics of the field's direction in the sensor."""
    last = DEGREES[1] if seen.total >= FEW_ROWS else FEW_DEGREES
    return Errors(harmonics(seen.unit, last)[:, None], apart=False, way=seen.unit.T)


DIRECTION = (
    Term(
        name="direction-dependent error",
        errors=by_direction,
        scale=1e-3,
        source="what is left of fluxgates and magnetoresistors in coils, 50 nT",
        what="readings have an error that depends on the field's direction, of unknown cause",
        move="record away from steel, turning about the sensor itself; see the map of residuals",
        at_rest=True,
        sideways=WITH_HIDDEN,
    ),
)


ORDERS = (2, 3, 4, 5)
"""Legendre orders of a bend along an axis; each is smaller than the one before by 1/(j + 1)."""
MEMORY_SHARE = 200
"""An old field fades within this share of the log, and within three rows at least."""
TURN_ROWS = 1, 5
FEWEST_ROWS = 50
"""Fewer rows tell nothing of a memory or of turns."""


def bend(seen: Seen) -> Errors:
    """Every axis bends by itself: Legendre polynomials of its reading over the largest."""
    each = legvander(np.clip(seen.x.T / seen.reach, -1.0, 1.0), ORDERS[-1])
    return Errors(np.stack([each[..., j] / (j + 1) for j in ORDERS]))


def compress(seen: Seen) -> Errors:
    """The whole vector shrinks with its length: x |x|² and x |x|⁶."""
    square = np.sum(seen.x**2, axis=1) / seen.length**2
    along = seen.x.T / seen.reach
    return Errors(np.stack([along * square, along * square**3]), apart=False)


def cross(seen: Seen) -> Errors:
    """Each axis holds something of the products and squares of the others: x_j x_k."""
    x = seen.x.T / seen.reach
    squares = [x[[1, 2, 0]] ** 2, x[[2, 0, 1]] ** 2]
    products = [np.broadcast_to(x[j] * x[k], x.shape) for j, k in ((0, 1), (0, 2), (1, 2))]
    return Errors(np.stack([*squares, *products]))


def lag(seen: Seen) -> Errors | None:
    """The readings are late: dx/dt of each axis over its rms."""
    if len(seen.x) < 3:
        return None
    slope = np.zeros((3, len(seen.x)))
    slope[:, 1:-1] = (seen.x[2:] - seen.x[:-2]).T / 2
    return Errors(_over_rms(slope)[None])


def memory(seen: Seen) -> Errors | None:
    """The readings hold something of those before them, an average that fades."""
    n = len(seen.x)
    if n < FEWEST_ROWS:
        return None
    share, x = 1.0 / max(3.0, n / MEMORY_SHARE), (seen.x - seen.x[0]).T
    fading = np.fft.rfft(share * (1.0 - share) ** np.arange(n), 2 * n)
    old = np.fft.irfft(np.fft.rfft(x, 2 * n) * fading, 2 * n)[:, :n] - x
    return Errors(_over_rms(old)[None])


def turning(seen: Seen) -> Errors | None:
    """A bias that goes with how fast the field turns in the sensor, over one row and over several,
    by its rms."""
    n = len(seen.x)
    if n < FEWEST_ROWS:
        return None
    rates = np.zeros((len(TURN_ROWS), n))
    for k, rows in enumerate(TURN_ROWS):
        apart = seen.unit[2 * rows :] - seen.unit[: -2 * rows]
        rates[k, rows:-rows] = find_length(apart)
    return along_time(rates / (np.sqrt(np.mean(rates**2, axis=1, keepdims=True)) + 1e-12))


def _over_rms(values: Array) -> Array:
    return np.asarray(values / (np.sqrt(np.mean(values**2)) + 1e-12))


SENSOR = (
    Term(
        name="non-linearity",
        errors=bend,
        scale=1e-3,
        source="linearity of 0.1 % of the range in data sheets (HMC5883L, LIS3MDL, RM3100)",
        what="the sensor is not linear",
        move="take iron away from it, choose a wider range, or calibrate it with a network "
        "(agonic fit network)",
        at_rest=True,
    ),
    Term(
        name="saturation",
        errors=compress,
        scale=1e-3,
        odds=0.01,
        most=100.0,
        source="as a bend of one axis",
        what="the sensor saturates: its gain falls where the field on it is strong",
        move="take iron and magnets away from it, or choose a wider range",
        at_rest=True,
    ),
    Term(
        name="cross-axis error",
        errors=cross,
        scale=1e-3,
        odds=0.02,
        source="cross-field error of 0.2 % of the range, magnetoresistors (HMC1001)",
        what="the reading of an axis depends on the field across it",
        move="choose a sensor with set and reset, or a wider range",
        at_rest=True,
    ),
    Term(
        name="lag",
        errors=lag,
        scale=2e-3,
        source="a filter of the sensor delays by a row or less",
        what="the readings lag while the sensor turns",
        move="turn it slowly, or take the delay out (agonic fit latency)",
        diluted=True,
    ),
    Term(
        name="filter or hysteresis",
        errors=memory,
        scale=1e-3,
        source="hysteresis of 0.05 to 0.1 % of the range in data sheets",
        what="readings depend on those before them (a filter, interpolated rows, hysteresis)",
        move="turn it slowly; if that changes nothing, take soft iron away from the sensor",
        diluted=True,
    ),
    Term(
        name="turn-rate error",
        errors=turning,
        scale=1e-3,
        source="motor currents of a vehicle while it turns",
        what="a disturbance follows the turn rate of the vehicle (the current of its motors)",
        move="record the currents beside the field and calibrate with them, or turn it by hand",
        diluted=True,
    ),
)
