"""The turn that teaches a magnitude fit most, and how to make it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.kernels.affine import correction_jacobian, model_basis
from agonic.kernels.coverage import level_directions

Array = NDArray[np.float64]

SMALLEST_DEG = 15.0
"""A part of a turn below this is not worth saying."""

_PARTS = (("roll right", "roll left"), ("nose up", "nose down"), ("turn right", "turn left"))
"""Turns of a body about its axes forward, right and down, positive first."""


def heading_gradient(inclination_deg: float, bias: Array, matrix: Array) -> Array:
    """G (9, 9) of the mean square error of a level heading, trace(C G), magnitude one, rad².

    Parameters are bias x y z, then matrix xx yy zz xy xz yz.
    """
    directions, across = level_directions(inclination_deg)
    raw = directions @ np.linalg.inv(matrix).T + bias
    jacobian = correction_jacobian(raw, bias, matrix) @ model_basis("full")
    rows = np.einsum("ni,nij->nj", across, jacobian) / np.cos(np.radians(inclination_deg))
    return np.asarray(rows.T @ rows / len(rows))


def gains(
    directions: Array, bias: Array, matrix: Array, covariance: Array, noise: float,
    inclination_deg: float, readings: float = 25.0,
) -> Array:  # fmt: skip
    """By how much so many readings along each direction (n, 3) lessen the heading's variance, (n,).

    Δ = (Cj)ᵀG(Cj)/(σ²/k + jᵀCj), the fall of trace(CG) when k residuals with the gradient j and
    noise σ are added (Sherman–Morrison); all for magnitude one.
    """
    raw = directions @ np.linalg.inv(matrix).T + bias
    jacobian = correction_jacobian(raw, bias, matrix) @ model_basis("full")
    j = np.einsum("ni,nij->nj", directions, jacobian)
    spread = j @ covariance
    g = heading_gradient(inclination_deg, bias, matrix)
    gain = float(np.trace(matrix)) / 3
    room = (noise * gain) ** 2 / readings + np.einsum("ni,ni->n", spread, j)
    return np.asarray(np.einsum("ni,ij,nj->n", spread, g, spread) / room)


def turn_between(present: Array, wanted: Array) -> Array:
    """The least rotation of the sensor, a vector in its own axes, rad, that moves the field's
    direction there from `present` to `wanted` (3,): opposite to the field's own.

    >>> np.degrees(turn_between(np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))).round(6) + 0.0
    array([ 0., 90.,  0.])
    """
    u = present / np.linalg.norm(present)
    v = wanted / np.linalg.norm(wanted)
    axis = np.cross(v, u)
    sine, cosine = float(np.linalg.norm(axis)), float(u @ v)
    if sine < 1e-6:  # already there, or opposite, where any axis across will do
        if cosine > 0:
            return np.zeros(3)
        axis = np.cross(u, np.eye(3)[int(np.argmin(np.abs(u)))])
        return np.asarray(np.pi * axis / np.linalg.norm(axis))
    return np.asarray(axis / sine * np.arctan2(sine, cosine))


def words(turn: Array) -> str:
    """A turn as a person makes it, in parts about forward, right and down.

    >>> words(np.radians([0.0, -62.0, 30.0]))
    'nose down 60°, turn right 30°'
    """
    degrees = np.degrees(turn)
    order = [i for i in np.argsort(-np.abs(degrees)) if abs(degrees[i]) >= SMALLEST_DEG]
    said = [f"{_PARTS[i][int(degrees[i] < 0)]} {round(abs(degrees[i]), -1):.0f}°" for i in order]
    return ", ".join(said) or "hold still"
