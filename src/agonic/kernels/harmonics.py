"""The field of a spherical harmonic model, in Earth-fixed axes, right at the poles too.

The potential V = a Σ (a/r)ⁿ⁺¹ (gₙᵐ cos mλ + hₙᵐ sin mλ) Pₙᵐ(sin φ) is a sum of solid harmonics, and
the gradient of a solid harmonic of degree n is a sum of three of degree n + 1 (Cunningham 1970,
doi 10.1007/BF01229505). So the coefficients are turned into those of the Cartesian components of
−∇V once, and what remains for each point is a recursion in x, y, z without angle or singularity.

With (x, y, z) the position over r², s = 1/r², r in units of a, the harmonics V + iW are scaled so
that each has the leading coefficient 1 in z:

    T₀⁰ = √s,    Tₙⁿ = (x + iy) Tₙ₋₁ⁿ⁻¹,    Tₙᵐ = z Tₙ₋₁ᵐ − γ s Tₙ₋₂ᵐ,
    γ = ((n−1)² − m²) / ((2n−1)(2n−3)).
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from math import isqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK_PRODUCTS = 2**18
"""Multiplications in one matrix product: the working rows fit the L2 cache (1 MB), and BLAS libraries
do not yet start threads, so that a point costs the same on a busy machine."""
COMPILE_FROM = 20_000
"""Points from which the compiled loop is used; below, importing the compiler costs more."""


def field_coefficients(g: Array, h: Array) -> Array:
    """Coefficients of the field B = −∇V in Earth-fixed axes, of Gauss coefficients.

    Parameters: g, h (N+1, N+1), Schmidt semi-normalised, by degree and order, nT (or nT/year).
    Returns (K, 3), K = (N+2)(N+3): row n(n+1) + 2m holds the x, y, z parts that multiply Re Tₙᵐ, and
    the next row those that multiply Im Tₙᵐ.

    Source: Cunningham (1970); as written, Montenbruck and Gill (2000), Satellite Orbits, eq. 3.33,
    with the factors of the normalisation.

    >>> g = np.array([[0.0, 0.0], [-30000.0, 0.0]])  # an axial dipole, field at its north pole
    >>> synthesise(np.array([[0.0], [0.0], [1.0]]), field_coefficients(g, 0 * g)).ravel()
    array([    0.,     0., -60000.])
    """
    top = len(g)
    n, m = np.arange(top)[:, None], np.arange(top)
    up = np.where(m == 0, np.sqrt(0.5), 0.5) * np.sqrt((n + m + 1) * (n + m + 2))
    down = np.where(m == 1, np.sqrt(0.5), 0.5) * np.sqrt((n - m + 1) * (n - m + 2))
    level = np.sqrt(np.maximum((n + 1) ** 2 - m**2, 0))
    table = np.zeros((top + 1, top + 1, 2, 3))
    real, imaginary = table[1:, :, 0], table[1:, :, 1]
    real[:, 1:, 0] += up * g
    real[:, 1:, 1] -= up * h
    imaginary[:, 1:, 0] += up * h
    imaginary[:, 1:, 1] += up * g
    real[:, :-2, 0] -= (down * g)[:, 1:]
    real[:, :-2, 1] -= (down * h)[:, 1:]
    imaginary[:, :-2, 0] -= (down * h)[:, 1:]
    imaginary[:, :-2, 1] += (down * g)[:, 1:]
    real[:, :-1, 2] = level * g
    imaginary[:, :-1, 2] = level * h
    table *= _leading_coefficients(top)[:, :, None, None]
    return np.asarray(table[np.tril_indices(top + 1)].reshape(-1, 3))


def synthesise(position: Array, coefficients: Array) -> Array:
    """The sums Σ coefficients · T over all harmonics, at points.

    Parameters: position (3, n), Earth-fixed, in units of the reference radius; coefficients (K, j),
    columns of `field_coefficients`, as many as wanted (field and secular variation: six).
    Returns (j, n). Compiled when numba is there and the points are many.
    """
    points = position.shape[1]
    width = (isqrt(4 * len(coefficients) + 1) - 1) // 2  # K = width (width + 1)
    block = max(1, BLOCK_PRODUCTS // (2 * width * coefficients.shape[1]))
    accumulate = (_compiled() if points >= COMPILE_FROM else None) or _accumulate
    sums = np.zeros((coefficients.shape[1], points))
    rows = np.zeros((0,))
    for start in range(0, points, block):
        part = np.ascontiguousarray(position[:, start : start + block])
        if rows.shape[-1] != 2 * part.shape[1]:
            rows = np.zeros((3, width, 2 * part.shape[1]))
        sums[:, start : start + block] = accumulate(part, coefficients, rows)
    return sums


def _leading_coefficients(top: int) -> Array:
    """The leading coefficient in z of each Schmidt semi-normalised harmonic, (top+1, top+1)."""
    leading = np.zeros((top + 1, top + 1))
    leading[0, 0] = 1.0
    for n in range(1, top + 1):
        m = np.arange(n)
        leading[n, :n] = leading[n - 1, :n] * (2 * n - 1) / np.sqrt(n**2 - m**2)
        leading[n, n] = leading[n - 1, n - 1] * (np.sqrt((2 * n - 1) / (2 * n)) if n > 1 else 1.0)
    return leading


def _accumulate(position: Array, coefficients: Array, rows: Array) -> Array:
    """One block of `synthesise`; `rows` (3, width, 2n) holds three degrees, Re T beside Im T.

    The same source is run by NumPy and compiled by numba, so it keeps to what both understand.
    """
    points = position.shape[1]
    s = 1.0 / (position[0] ** 2 + position[1] ** 2 + position[2] ** 2)
    x, y = position[0] * s, position[1] * s
    z = np.concatenate((position[2] * s, position[2] * s))
    rows[0, 0, :points] = np.sqrt(s)
    rows[0, 0, points:] = 0.0
    s = np.concatenate((s, s))
    sums = np.zeros((coefficients.shape[1], points))
    for n in range(1, rows.shape[1]):
        now, before, earlier = rows[n % 3], rows[(n - 1) % 3], rows[(n - 2) % 3]
        for m in range(n):
            gamma = ((n - 1) ** 2 - m**2) / ((2 * n - 1) * (2 * n - 3))
            _step(before[m], z, earlier[m], s, gamma, now[m])
        real, imaginary = before[n - 1, :points], before[n - 1, points:]
        _step(real, x, imaginary, y, 1.0, now[n, :points])
        _step(imaginary, x, real, y, -1.0, now[n, points:])
        degree = coefficients[n * (n + 1) : (n + 1) * (n + 2)]
        sums += np.dot(degree.T, now[: n + 1].reshape(2 * n + 2, points))
    return sums


def _step(u: Array, x: Array, v: Array, y: Array, gamma: float, out: Array) -> None:
    """out = u x − γ v y, all (n,): the one formula of the recursion."""
    second = v * y
    second *= gamma
    np.multiply(u, x, out=out)
    out -= second


def _step_by_element(u: Array, x: Array, v: Array, y: Array, gamma: float, out: Array) -> None:
    """`_step` as the compiler wants it: without the intermediate array, and vectorised by it."""
    for i in range(out.size):
        out[i] = u[i] * x[i] - gamma * v[i] * y[i]


@functools.cache
def _compiled() -> Callable[[Array, Array, Array], Array] | None:
    """`_accumulate` compiled by numba, or `None` without it."""
    try:
        numba = importlib.import_module("numba")
        extending = importlib.import_module("numba.extending")
    except ImportError:
        return None
    extending.overload(_step, strict=False)(lambda *arguments: _step_by_element)
    compiled: Callable[[Array, Array, Array], Array] = numba.njit(cache=True)(_accumulate)
    return compiled
