"""Fields of dipoles and of wires with a current, nT, by their closed forms.

A dipole m at the distance r makes μ₀/4π T(r) m with T = (3 r rᵀ − r² 1)/r⁵, the gradient of
r/r³ with its sign turned: without curl and divergence wherever r is not 0. Iron of the effective
volume α (susceptibility times volume; 3 times the volume of a sphere of soft iron) in a field B has
the dipole α B/μ₀, which adds T α B/4π.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array

NT_M_A = 100.0
"""μ₀/4π in nT m/A: 10⁻⁷ T m/A, to ten digits also since 2019 (CODATA)."""


def dipole_tensor(r: Array) -> Array:
    """T(r) = (3 r rᵀ − r² 1)/r⁵ of vectors (…, 3) from the dipole, m⁻³, as (…, 3, 3)."""
    square = np.einsum("...i,...i->...", r, r)[..., None, None]
    outer = r[..., :, None] * r[..., None, :]
    return np.asarray((3.0 * outer - square * np.eye(3)) / square**2.5)


def dipole_gradient(r: Array) -> Array:
    """∂T_ij/∂r_k (…, 3, 3, 3), m⁻⁴: symmetric in all three, and without any trace."""
    square = np.einsum("...i,...i->...", r, r)[..., None, None, None]
    by_one = np.eye(3) * r[..., None, None]  # δ_jk r_i, its axes to be turned
    mixed = sum(np.moveaxis(by_one, -3, axis) for axis in (-3, -2, -1))
    cubic = np.einsum("...i,...j,...k->...ijk", r, r, r)
    return np.asarray(3.0 * mixed / square**2.5 - 15.0 * cubic / square**3.5)


def wire_field(corners: Array, at: Array) -> Array:
    """What an ampere from corner to corner (k, 3) of a wire adds at places (…, 3), nT.

    Of a straight piece from a to b, with r₁ and r₂ from its ends to the place (Biot and Savart):

        B = μ₀/4π (r₁ + r₂) (r₁ × r₂) / (r₁ r₂ (r₁ r₂ + r₁·r₂))

    Source: Hanson & Hirshman (2002), "Compact expressions for the Biot–Savart fields of a
    filamentary segment", Physics of Plasmas 9, 4410; exact off the wire."""
    away = at[..., None, :] - corners
    size = np.linalg.norm(away, axis=-1)
    one, two, a, b = away[..., :-1, :], away[..., 1:, :], size[..., :-1], size[..., 1:]
    along = a * b * (a * b + np.einsum("...i,...i->...", one, two))
    share = (a + b) / np.maximum(along, np.finfo(float).tiny)
    return np.asarray(NT_M_A * np.einsum("...s,...si->...i", share, np.cross(one, two)))


def list_circle(centre: Array, axis: Array, radius: float, sides: int = 48) -> Array:
    """The corners (sides + 1, 3) of a closed polygon of the area of a circle, right-handed.

    Its moment is that of the circle, and its field within 2 ‰ from half a radius off the wire."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first = first / np.linalg.norm(first)
    second = np.cross(axis, first) / np.linalg.norm(axis)
    step = 2 * np.pi / sides
    turn = step * np.arange(sides + 1)[:, None]
    reach = radius * np.sqrt(step / np.sin(step))
    return np.asarray(centre + reach * (np.cos(turn) * first + np.sin(turn) * second))
