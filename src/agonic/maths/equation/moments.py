"""The 35 moments Σ x^a y^b z^c, a+b+c ≤ 4: all that an algebraic ellipsoid fit needs to keep.

They add, so two chunks, two workers or two days merge by a sum once they share centre and scale.
Order: by the products of `MONOMIALS`, the ten monomials of a quadric; `EXPONENTS` lists (a, b, c).
"""

from __future__ import annotations

from itertools import product
from math import comb

import numpy as np

from agonic.arrays import Array

MONOMIALS = (
    (2, 0, 0),
    (0, 2, 0),
    (0, 0, 2),
    (0, 1, 1),
    (1, 0, 1),
    (1, 1, 0),
    (1, 0, 0),
    (0, 1, 0),
    (0, 0, 1),
    (0, 0, 0),
)
"""x² y² z² yz xz xy x y z 1, the order of Li & Griffiths (2004)."""

EXPONENTS = tuple(
    sorted({e for e in product(range(5), repeat=3) if sum(e) <= 4}, key=lambda e: (sum(e), e))
)
"""The exponents (a, b, c) of the 35 moments, by degree."""

_INDEX = {exponents: k for k, exponents in enumerate(EXPONENTS)}

GRAM_INDEX = np.array(
    [[_INDEX[tuple(np.add(p, q).tolist())] for q in MONOMIALS] for p in MONOMIALS]
)
"""Where in the 35 the scatter of monomial i times monomial j is found, (10, 10)."""

_FIRST = np.array([np.flatnonzero(GRAM_INDEX.ravel() == k)[0] for k in range(35)])
_ROWS = 4096  # a block of monomials, 10 × 4096 doubles, stays in the cache


def accumulate(points: Array, centre: Array, scale: float) -> Array:
    """The moments (35,) of (points − centre)/scale, from points (n, 3)."""
    gram = np.zeros((10, 10))
    block = np.ones((10, min(_ROWS, len(points))))
    for start in range(0, len(points), _ROWS):
        rows = points[start : start + _ROWS]
        m = block[:, : len(rows)]
        np.divide((rows - centre).T, scale, out=m[6:9])
        np.multiply(m[6:9], m[6:9], out=m[0:3])
        np.multiply(m[7], m[8], out=m[3])
        np.multiply(m[6], m[8], out=m[4])
        np.multiply(m[6], m[7], out=m[5])
        gram += m @ m.T
    return np.asarray(gram.ravel()[_FIRST])


def powers(points: Array, centre: Array, scale: float) -> Array:
    """The terms (n, 35) of the moments of each point by itself."""
    u = (points - centre) / scale
    x, y, z = u.T
    m = np.stack([x * x, y * y, z * z, y * z, x * z, x * y, x, y, z, np.ones_like(x)], axis=1)
    first, second = np.divmod(_FIRST, 10)
    return np.asarray(m[:, first] * m[:, second])


def rebase(moments: Array, centre: Array, scale: float, to_centre: Array, to_scale: float) -> Array:
    """The same moments about another centre and scale: u' = (s u + c − c')/s', multiplied out."""
    ratio, shift = scale / to_scale, (centre - to_centre) / to_scale
    axis = np.zeros((3, 5, 5))  # axis[i, a, j]: coefficient of u_i^j in u'_i^a
    for i in range(3):
        for a in range(5):
            for j in range(a + 1):
                axis[i, a, j] = comb(a, j) * ratio**j * shift[i] ** (a - j)
    e = np.array(EXPONENTS)
    matrix = np.ones((35, 35))
    for i in range(3):
        matrix *= axis[i][e[:, i][:, None], e[:, i][None, :]]
    return np.asarray(matrix @ moments)


def compute_denoised_gram(moments: Array) -> tuple[Array, Array, Array]:
    """Ψ₀, Ψ₁, Ψ₂ (…, 10, 10) of Ψ(σ²) = Ψ₀ − σ² Ψ₁ + σ⁴ Ψ₂, the scatter with noise taken out.

    Each power is replaced by the polynomial whose expectation under N(0, σ²) noise is the power of
    the true value: x² − σ², x³ − 3xσ², x⁴ − 6x²σ² + 3σ⁴ (Kukush, Markovsky & Van Huffel 2004).
    """
    parts = (moments @ part.T for part in _DENOISE)
    first, second, third = (np.asarray(part[..., GRAM_INDEX]) for part in parts)
    return first, second, third


def _denoising() -> Array:
    """The three maps (3, 35, 35) from moments to the coefficients of 1, −σ², σ⁴."""
    hermite: dict[int, dict[int, dict[int, float]]] = {
        0: {0: {0: 1}},
        1: {0: {1: 1}},
        2: {0: {2: 1}, 1: {0: -1}},
        3: {0: {3: 1}, 1: {1: -3}},
        4: {0: {4: 1}, 1: {2: -6}, 2: {0: 3}},
    }  # power → power of σ² → power of x → coefficient
    maps = np.zeros((3, 35, 35))
    for k, powers in enumerate(EXPONENTS):
        choices = [
            [(s, p, c) for s, terms in hermite[a].items() for p, c in terms.items()] for a in powers
        ]
        for x, y, z in product(*choices):
            order = x[0] + y[0] + z[0]
            target = _INDEX[(x[1], y[1], z[1])]
            maps[order, k, target] += (-1) ** order * x[2] * y[2] * z[2]
    return maps


_DENOISE = _denoising()
