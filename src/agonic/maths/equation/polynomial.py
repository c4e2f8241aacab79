"""Polynomials in a temperature that is centred and scaled to about ±1.

    value(T) = k0 + k1 x + k2 x² + …,   x = (T − centre) / half_range

Powers of T itself would make the normal equations of a cubic over −10…50 °C a million times worse
conditioned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse

MARKED = 0.1
"""The variance of the residuals falls markedly where it falls by more than this share …"""

CHANCE = 1e-3
"""… and chance would make it fall so in fewer cases than this."""


def scale(temperature: ArrayLike, centre: float, half_range: float) -> Array:
    """x = (T − centre)/half_range."""
    return (np.asarray(temperature, dtype=np.float64) - centre) / half_range


def powers(x: ArrayLike, degree: int) -> Array:
    """1, x, x², … x^degree, (…, degree + 1)."""
    return np.asarray(np.asarray(x, dtype=np.float64)[..., None] ** np.arange(degree + 1))


def derivative(x: ArrayLike, degree: int, times: int = 1) -> Array:
    """The derivatives of `powers` by x, (…, degree + 1)."""
    k = np.arange(degree + 1)
    factor = np.prod([k - j for j in range(times)], axis=0, initial=1.0)
    base = np.asarray(x, dtype=np.float64)[..., None]
    return np.asarray(factor * base ** np.maximum(k - times, 0))


def mean_powers(x: ArrayLike, variance: ArrayLike, degree: int) -> Array:
    """The mean of `powers` over values that scatter about x, to second order: φ + φ″ variance/2.

    A bias that is curved over a bin of temperatures has another mean than at the mean temperature:
    with 20 µT of curve over 60 °C by 0.5 nT in bins of 0.5 °C and by 7 nT in bins of 2 °C.
    """
    spread = np.asarray(variance, dtype=np.float64)[..., None]
    return powers(x, degree) + derivative(x, degree, times=2) * spread / 2


class Polynomial(NamedTuple):
    """Coefficients (p,), their covariance (p, p), and the variance of the scaled residuals."""

    coefficients: Array
    covariance: Array
    variance: float

    def at(self, x: ArrayLike) -> Array:
        """The value at x."""
        return np.asarray(powers(x, len(self.coefficients) - 1) @ self.coefficients)

    def sd_at(self, x: ArrayLike) -> Array:
        """The standard error at x."""
        rows = powers(x, len(self.coefficients) - 1)
        return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", rows, self.covariance, rows)))


def fit_polynomial(x: Array, values: Array, sd: Array, degree: int) -> Polynomial:
    """The weighted polynomial through values (n,) with standard errors sd (n,).

    The covariance is that of the stated errors. `variance` is Σ (residual/sd)² / (n − p), one where
    the polynomial and the errors hold, NaN where nothing is left to judge by."""
    rows = powers(x, degree) / sd[:, None]
    covariance = inverse(rows.T @ rows)
    coefficients = covariance @ (rows.T @ (values / sd))
    left = values / sd - rows @ coefficients
    freedom = len(x) - degree - 1
    return Polynomial(
        coefficients, covariance, float(left @ left / freedom) if freedom > 0 else np.nan
    )


def compute_variances(x: Array, values: Array, sd: Array, largest: int) -> Array:
    """The variance of the scaled residuals of each order 0…largest, (c, largest + 1).

    Parameters: values and sd (n, c), a column a coefficient. Orders that leave nothing to judge by
    are NaN.
    """
    return np.array(
        [
            [fit_polynomial(x, v, s, order).variance for order in range(largest + 1)]
            for v, s in zip(values.T, sd.T, strict=True)
        ]
    )


def choose_order(curves: Array, n: int) -> int:
    """The smallest order after which no variance falls markedly any more.

    Parameters: curves (c, k) as `compute_variances` gives them for n values each. An order is too
    small where a higher one lowers the variance of a coefficient by more than `MARKED` and an F
    test (with the number of coefficients taken into account) says that it is not chance.
    """
    orders = int(curves.shape[1])
    for low in range(orders - 1):
        falls = [
            _falls(curve, low, high, n, len(curves))
            for curve in curves
            for high in range(low + 1, orders)
        ]
        if not any(falls):
            return low
    return orders - 1


def _falls(curve: Array, low: int, high: int, n: int, many: int) -> bool:
    """Whether the variance falls markedly from one order to another."""
    v, w, freedom = curve[low], curve[high], n - high - 1
    if freedom < 1 or not np.isfinite(w) or w >= (1 - MARKED) * v:
        return False
    explained = (v * (n - low - 1) - w * freedom) / (high - low)
    return bool(many * fdtrc(high - low, freedom, explained / max(w, 1e-300)) < CHANCE)
