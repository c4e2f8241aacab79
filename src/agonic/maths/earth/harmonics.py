"""The field of a spherical harmonic model, in Earth-fixed axes, right at the poles too.

The potential V = a Σ (a/r)ⁿ⁺¹ (gₙᵐ cos mλ + hₙᵐ sin mλ) Pₙᵐ(sin φ) is a sum of solid harmonics, and
the gradient of a solid harmonic of degree n is a sum of three of degree n + 1 (Cunningham 1970,
doi 10.1007/BF01229495). So the coefficients are turned into those of the Cartesian components of
−∇V once, and what remains for each point is a recursion in x, y, z without angle or singularity.

With (x, y, z) the position over r², s = 1/r², and r in units of a, each harmonic is

    Tₙᵐ = √s (x + iy)ᵐ Λₙᵐ,    Λₘᵐ = 1,  Λₘ₊₁ᵐ = z,    Λₙᵐ = z Λₙ₋₁ᵐ − γ s Λₙ₋₂ᵐ,
    γ = ((n−1)² − m²) / ((2n−1)(2n−3)),

scaled to leading coefficient 1 in z. The sum over n is a matrix product for each m; only its result
is turned by (x + iy)ᵐ.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from math import isqrt

import numpy as np

from agonic.arrays import Array

BLOCK_PRODUCTS = 2**18
"""Multiplications in one matrix product: below this BLAS libraries do not start threads, so that a
point costs the same on a busy machine, and the working rows stay in the cache."""


def field_coefficients(g: Array, h: Array) -> Array:
    """Coefficients of the field B = −∇V in Earth-fixed axes, of Gauss coefficients.

    Parameters: g, h (N+1, N+1), Schmidt semi-normalised, by degree and order, nT (or nT/year).
    Returns (k, 2, 3), k = (N+2)(N+3)/2: order by order, and degree by degree within, what the x, y
    and z components take of Re Tₙᵐ and of Im Tₙᵐ.

    Source: Cunningham (1970); as written, Montenbruck and Gill (2000), Satellite Orbits, eq. 3.33,
    with the factors of the normalisation."""
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
    return np.asarray(table.swapaxes(0, 1)[np.triu_indices(top + 1)])


def synthesise(position: Array, coefficients: Array, *, compiled: bool = False) -> Array:
    """The sums Σ coefficients · T over all harmonics, at points.

    Parameters: position (3, n), Earth-fixed, in units of the reference radius; coefficients
    (k, 2, j) as of `field_coefficients`, with as many columns as wanted (field and secular
    variation: six); compiled asks for numba, used where it is installed, a second to start.
    Returns (j, n).
    """
    points, columns = position.shape[1], coefficients.shape[2]
    width = (isqrt(8 * len(coefficients) + 1) - 1) // 2  # k = width (width + 1) / 2
    block = max(1, BLOCK_PRODUCTS // (2 * columns * width))
    accumulate = (_compile() if compiled else None) or _accumulate
    sums = np.empty((columns, points))
    table = coefficients.reshape(len(coefficients), 2 * columns)
    for start in range(0, points, block):
        part = np.ascontiguousarray(position[:, start : start + block])
        sums[:, start : start + block] = accumulate(part, table, width)
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


def _accumulate(position: Array, table: Array, width: int) -> Array:
    """One block of `synthesise`; `table` (k, 2j) has the parts of Re T, then those of Im T.

    The same source is run by NumPy and compiled by numba, so it keeps to what both understand.
    """
    points, columns = position.shape[1], table.shape[1] // 2
    s = 1.0 / (position[0] ** 2 + position[1] ** 2 + position[2] ** 2)
    x, y, z = position[0] * s, position[1] * s, position[2] * s
    ladder = np.ones((width, points))
    ladder[1] = z
    turn = np.zeros((2, 2, points))
    turn[0, 0] = np.sqrt(s)
    turned, sums = np.empty((columns, points)), np.zeros((columns, points))
    first = 0
    for m in range(width):
        for n in range(m + 2, width):
            gamma = ((n - 1) ** 2 - m**2) / ((2 * n - 1) * (2 * n - 3))
            _step(ladder[n - m - 1], z, ladder[n - m - 2], s, gamma, ladder[n - m])
        last = first + width - m
        parts = np.dot(table[first:last].T, ladder[: width - m])
        real, imaginary = turn[m % 2, 0], turn[m % 2, 1]
        for j in range(columns):
            _step(parts[j], real, parts[columns + j], imaginary, -1.0, turned[j])
        sums += turned
        _step(real, x, imaginary, y, 1.0, turn[(m + 1) % 2, 0])
        _step(imaginary, x, real, y, -1.0, turn[(m + 1) % 2, 1])
        first = last
    return sums


def _step(u: Array, x: Array, v: Array, y: Array, gamma: float, out: Array) -> None:
    """out = u x − γ v y, all (n,); the whole recursion is made of it."""
    second = v * y
    second *= gamma
    np.multiply(u, x, out=out)
    out -= second


def _step_by_element(u: Array, x: Array, v: Array, y: Array, gamma: float, out: Array) -> None:
    """`_step` as the compiler wants it: without the intermediate array, and vectorised by it."""
    for i in range(out.size):
        out[i] = u[i] * x[i] - gamma * v[i] * y[i]


@functools.cache
def _compile() -> Callable[[Array, Array, int], Array] | None:
    """`_accumulate` compiled by numba, or `None` without it."""
    try:
        numba = importlib.import_module("numba")
        extending = importlib.import_module("numba.extending")
    except ImportError:
        return None
    extending.overload(_step, strict=False)(lambda *arguments: _step_by_element)
    kernel: Callable[[Array, Array, int], Array]
    try:
        kernel = numba.njit(cache=True)(_accumulate)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(_accumulate)
    return kernel
