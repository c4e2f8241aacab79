"""What may have changed in an instrument since its calibration, and what it does to headings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.inertial.maths.shots import observe
from agonic.inertial.pair.fit import list_directions
from agonic.maths.equation.affine import model_basis
from agonic.maths.rotations.vectors import skew
from agonic.units import STANDARD_GRAVITY_M_S2

AHEAD = np.eye(3)[0]


class Suspect(NamedTuple):
    """Three numbers that may have changed: ∂residuals (r, 3), and ∂azimuth of x (k, 3), rad."""

    name: str
    unit: str
    by: Array
    moved: Array


class Change(NamedTuple):
    """A change that would explain the shots: what, how large (3,), and its sd.

    `turns_deg` is what it does to headings within 60° of level, rms; `chance` the probability that
    no change explains as much by it.
    """

    name: str
    size: Array
    sd: Array
    unit: str
    turns_deg: float
    chance: float


def list_suspects(
    by_setup: Array, accelerometer: Affine, magnetometer: Affine, dip: float
) -> tuple[Suspect, ...]:
    """The bias of each sensor, and the turn between the two.

    Parameters: ∂residuals/∂(parameters of both) (r, 24), the two calibrations, and the dip, rad.
    """
    rot_nb = Rotation.from_euler("ZYX", list_directions(), degrees=True)
    up = rot_nb.apply([0.0, 0.0, -1.0], inverse=True)
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True)
    channels = observe(up, field, AHEAD)
    by_up, by_field = channels.by_up[:, 4], channels.by_field[:, 4]
    size, degree = float(magnetometer.magnitude or 1.0), np.radians(1.0)
    turns = np.stack([(skew(axis) @ magnetometer.matrix).ravel() for axis in np.eye(3)], axis=1)
    onto = model_basis("full", magnetometer.gauge)[3:, 3:].T @ turns * degree
    return (
        Suspect(
            "the magnetometer's bias",
            magnetometer.unit_in,
            by_setup[:, 12:15],
            -by_field @ magnetometer.matrix / size,
        ),
        Suspect(
            "the accelerometer's bias",
            "m/s²",
            by_setup[:, :3],
            -by_up @ accelerometer.matrix / STANDARD_GRAVITY_M_S2,
        ),
        Suspect(
            "the turn between the sensors",
            "°",
            by_setup[:, 15:] @ onto,
            np.cross(field, by_field) * degree,
        ),
    )


def estimate_change(suspect: Suspect, projector: Array, residuals: Array) -> Change:
    """The change at its best: (HᵀPH)⁻¹HᵀPy, and what it explains, a χ² of three."""
    spread = _invert(suspect, projector)
    # residuals are what the setup assumes against the truth: the truth is the other way
    size = -spread @ (suspect.by.T @ projector @ residuals)
    gain = -float(residuals @ projector @ suspect.by @ size)
    return Change(
        name=suspect.name,
        size=size,
        sd=np.sqrt(np.diag(spread)),
        unit=suspect.unit,
        turns_deg=float(np.degrees(np.sqrt(np.mean((suspect.moved @ size) ** 2)))),
        chance=float(chdtrc(3, gain)),
    )


def find_seen_deg(suspect: Suspect, projector: Array) -> float:
    """Three standard errors of the change, as it turns headings, rms degrees."""
    spread = _invert(suspect, projector)
    variance = np.einsum("ki,ij,kj->k", suspect.moved, spread, suspect.moved)
    return float(3 * np.degrees(np.sqrt(variance.mean())))


def _invert(suspect: Suspect, projector: Array) -> Array:
    information = suspect.by.T @ projector @ suspect.by
    return np.asarray(np.linalg.pinv(information, rcond=1e-10, hermitian=True))
