"""The turn that tells a magnitude fit most, and how to make it."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import correction_jacobian, model_basis
from agonic.maths.equation.coverage import level_directions

SMALLEST_DEG = 15.0
"""A part of a turn below this is not worth saying."""

_PARTS = (("roll right", "roll left"), ("nose up", "nose down"), ("turn right", "turn left"))
"""Turns of a body about its axes forward, right and down, positive first."""


def compute_heading_gradient(inclination_deg: float, bias: Array, matrix: Array) -> Array:
    """G (9, 9) of the mean square error of a level heading, trace(C G), magnitude one, rad²."""
    directions, across = level_directions(inclination_deg)
    raw = directions @ np.linalg.inv(matrix).T + bias
    jacobian = correction_jacobian(raw, bias, matrix) @ model_basis("full")
    rows = np.einsum("ni,nij->nj", across, jacobian) / np.cos(np.radians(inclination_deg))
    return np.asarray(rows.T @ rows / len(rows))


def draw_great_circles(present: Array, targets: Array, steps: int = 12) -> tuple[Array, Array]:
    """Great circles from a direction (3,) to others (n, 3): `steps` directions along each, the
    last of them the target, (n, steps, 3), and their lengths (n,), rad."""
    cosine = np.clip(targets @ present, -1.0, 1.0)
    across = targets - cosine[:, None] * present
    size = np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(present, np.eye(3)[int(np.argmin(np.abs(present)))])
    across = np.where(size > 1e-6, across / np.maximum(size, 1e-6), other / np.linalg.norm(other))
    length = np.arccos(cosine)
    angle = length[:, None, None] * (np.arange(1, steps + 1) / steps)[:, None]
    return np.cos(angle) * present + np.sin(angle) * across[:, None, :], length


def compute_gains(
    along: Array,
    bias: Array,
    matrix: Array,
    covariance: Array,
    noise: float,
    inclination_deg: float,
    readings: Array,
) -> Array:
    """By how much readings along the directions of ways (n, t, 3) lessen the heading's variance. Δ
    = tr(G CJᵀ(σ²/k + JCJᵀ)⁻¹JC), (n,), the fall of trace(CG) when at each direction k residuals,
    `readings` (n,), with the gradient j and noise σ are added (Woodbury); for magnitude one."""
    directions = along.reshape(-1, 3)
    raw = directions @ np.linalg.inv(matrix).T + bias
    jacobian = correction_jacobian(raw, bias, matrix) @ model_basis("full")
    j = np.einsum("ni,nij->nj", directions, jacobian).reshape(*along.shape[:2], 9)
    spread = j @ covariance
    room = spread @ np.swapaxes(j, 1, 2)
    gain = float(np.trace(matrix)) / 3
    each = (noise * gain) ** 2 / np.maximum(readings, 1e-9)
    room = room + each[:, None, None] * np.eye(along.shape[1])
    learnt = np.linalg.solve(room, spread)
    g = compute_heading_gradient(inclination_deg, bias, matrix)
    return np.asarray(np.einsum("nti,ij,ntj->n", spread, g, learnt))


def find_turn(present: Array, wanted: Array) -> Array:
    """The least rotation of the sensor, a vector in its own axes, rad, that moves the field's
    direction there from `present` to `wanted` (3,): opposite to the field's own."""
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


def describe_turn(turn: Array) -> str:
    """A turn as a person makes it, in parts about forward, right and down."""
    degrees = np.degrees(turn)
    order = [i for i in np.argsort(-np.abs(degrees)) if abs(degrees[i]) >= SMALLEST_DEG]
    said = [f"{_PARTS[i][int(degrees[i] < 0)]} {round(abs(degrees[i]), -1):.0f}°" for i in order]
    return ", ".join(said) or "hold still"
