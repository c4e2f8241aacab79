"""The attitudes that would tell most of what a fit leaves open."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inertial.maths.shots import SIGHT, Shots, linearise, split
from agonic.inertial.pair.accuracy import Attitudes, face

TO_ADD = 6
_PITCHES, _AZIMUTHS = (-90.0, -45.0, 0.0, 45.0, 90.0), (0.0, 90.0, 180.0, 270.0)
_ROLLS = tuple(float(roll) for roll in range(-135, 181, 45))
POINTS = {0.0: "north", 90.0: "east", 180.0: "south", 270.0: "west"}
_PITCHED = {
    -90.0: "straight down",
    -45.0: "45° down",
    0.0: "level",
    45.0: "45° up",
    90.0: "straight up",
}


def choose_attitudes(
    unknowns: Array, covariance: Array, theta: Array, body: Array, target: Array
) -> Array:
    """Azimuth, pitch and roll (k, 3), degrees, of the attitudes that lower tr(C T) most, in turn.

    Parameters: unknowns and their covariance, the variances of the noise, the rotation into the
    instrument's axes, and T (q, q): the mean of jᵀj of what is to be known.
    """
    angles = np.array([(a, p, r) for p in _PITCHES for a in _AZIMUTHS for r in _ROLLS])
    jacobian, variance = _observe(unknowns, theta, face(unknowns, body, angles))
    chosen = []
    for _ in range(TO_ADD):
        spread = jacobian @ covariance
        inner = np.linalg.inv(variance + spread @ np.swapaxes(jacobian, 1, 2))
        gain = np.einsum("nij,njk,kl,nil->n", inner, spread, target, spread)
        best = int(np.argmax(gain))
        chosen.append(best)
        covariance = covariance - spread[best].T @ inner[best] @ spread[best]
    return angles[chosen]


def _observe(unknowns: Array, theta: Array, attitudes: Attitudes) -> tuple[Array, Array]:
    """Jacobian (n, 3, q) and variance (n, 3, 3) of shots at attitudes, without any target."""
    bias_a, shape, bias_m, matrix = split(unknowns)
    force = attitudes.up @ np.linalg.inv(shape).T + bias_a
    field = attitudes.field @ np.linalg.inv(matrix).T + bias_m
    shots = Shots(force, field, np.full(len(force), -1))
    found = linearise(shots, unknowns[: SIGHT.stop])
    jacobian = np.zeros((len(force), 3, len(unknowns)))
    jacobian[:, :, : SIGHT.stop] = found.jacobian[:, :3]
    return jacobian, np.einsum("k,knij->nij", theta, found.variances)[:, :3, :3]


def describe_attitude(azimuth: float, pitch: float, roll: float) -> str:
    """An attitude in words.

    >>> describe_attitude(90.0, 0.0, 180.0), describe_attitude(0.0, -45.0, 45.0)
    ('nose east, level, upside down', 'nose north, 45° down, rolled 45° right')
    """
    if abs(pitch) == 90:  # the nose has no azimuth, the upper side has
        return f"nose {_PITCHED[pitch]}, turned by {int(azimuth - np.sign(pitch) * roll) % 360}°"
    side = "left" if roll < 0 else "right"
    rolled = {0.0: "", 180.0: ", upside down"}.get(roll, f", rolled {abs(roll):g}° {side}")
    return f"nose {POINTS[azimuth]}, {_PITCHED[pitch]}{rolled}"
