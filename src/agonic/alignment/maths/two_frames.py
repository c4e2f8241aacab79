"""Vectors in two frames: R_mcᵀ W (raw − bias) − R_cn H (reference + offset) and its Jacobian.

R_cn turns north-east-down into the platform's components (measured, by a star sensor or by circle
and levels), R_mc those into the magnetometer's (the wanted rotation), and H the reference's axes
into north, east and down. Rotations change by small rotation vectors on the left, so no angle is
ever singular. What is known of an unknown beforehand is one number, its prior information: 0 where
nothing is, infinite where it is fixed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.maths.rotations.vectors import skew

GROUPS = {
    "alignment": slice(0, 3),
    "reference": slice(3, 6),
    "pier": slice(6, 9),
    "bias": slice(9, 12),
    "matrix": slice(12, 18),
}
"""Where each group of unknowns stands among the eighteen."""
SIZE = 18


class Unknowns(NamedTuple):
    """The two rotations, the offset of the field between the piers, bias and symmetric matrix."""

    rot_mc: Array
    rot_nr: Array
    offset: Array
    bias: Array
    matrix: Array

    def add_step(self, step: Array) -> Unknowns:
        """After a step (18,): rotation vectors on the left, the others added."""
        return Unknowns(
            make_rotation(step[:3]) @ self.rot_mc,
            make_rotation(step[3:6]) @ self.rot_nr,
            self.offset + step[6:9],
            self.bias + step[9:12],
            unpack_symmetric(pack_symmetric(self.matrix) + step[12:18]),
        )


class Measured(NamedTuple):
    """Means of k orientations: fields (k, 3), attitudes (k, 3, 3), standard deviations (k,).

    `attitude_covariance` (k, 3, 3), rad², axes of the platform. `along` (k, 3), axes of the
    platform, where the field is told along one direction alone.
    """

    field: Array
    reference: Array
    rot_cn: Array
    attitude_covariance: Array
    noise: Array
    reference_noise: Array
    along: Array | None = None


def start_unknowns(offset: ArrayLike = (0.0, 0.0, 0.0)) -> Unknowns:
    """Nothing turned, an offset added."""
    added = np.asarray(offset, dtype=np.float64)
    return Unknowns(np.eye(3), np.eye(3), added, np.zeros(3), np.eye(3))


def make_prior(
    solve: Collection[str],
    pier_sd: float | None = None,
    reference_sd_arcsec: float | Sequence[float] | None = None,
) -> Array:
    """Prior information (18,): the groups to solve for are free, all others fixed.

    Pier and axes of the reference that are known with a standard deviation join: what is uncertain
    about them is then in every standard error.
    """
    prior = np.full(SIZE, np.inf)
    for group in solve:
        prior[GROUPS[group]] = 0.0
    known = {"pier": (pier_sd or 0.0) + np.zeros(3)}
    known["reference"] = np.asarray(reference_sd_arcsec or 0.0) * ARCSEC_RAD + np.zeros(3)
    for group, sd in known.items():
        prior[GROUPS[group]][sd > 0] = sd[sd > 0] ** -2
    return prior


def predict_field_c(at: Unknowns, measured: Measured) -> Array:
    """The field (k, 3) in the platform's axes, by reference and attitude."""
    return np.asarray(measured.rot_cn @ at.rot_nr @ (measured.reference + at.offset)[:, :, None])[
        :, :, 0
    ]


def compute_residual(at: Unknowns, measured: Measured) -> tuple[Array, Array]:
    """Residuals (k, 3), nT, axes of the platform, and the Jacobian (k, 3, 18) of a small step."""
    d = measured.field - at.bias
    own, back = d @ at.matrix, at.rot_mc.T
    beside = (measured.reference + at.offset) @ at.rot_nr.T
    jacobian = np.empty((len(d), 3, SIZE))
    jacobian[:, :, :3] = back @ skew(own)
    jacobian[:, :, 3:6] = measured.rot_cn @ skew(beside)
    jacobian[:, :, 6:9] = -measured.rot_cn @ at.rot_nr
    jacobian[:, :, 9:12] = -back @ at.matrix
    for k, unit in enumerate(np.eye(6)):
        jacobian[:, :, 12 + k] = d @ unpack_symmetric(unit) @ at.rot_mc
    return own @ at.rot_mc - predict_field_c(at, measured), jacobian


def compute_covariance(at: Unknowns, measured: Measured) -> Array:
    """Covariance (k, 3, 3) of the residuals, nT²: magnetometer, reference and attitude.

    An attitude that is off by the small rotation ε sees the field v off by ε × v.
    """
    across = skew(predict_field_c(at, measured))
    turned = across @ measured.attitude_covariance @ np.swapaxes(across, 1, 2)
    matrix = at.rot_mc.T @ at.matrix
    own = measured.noise[:, None, None] ** 2 * (matrix @ matrix.T)
    beside = measured.reference_noise[:, None, None] ** 2 * np.eye(3)
    return np.asarray(own + beside + turned)


def compute_whitener(at: Unknowns, measured: Measured) -> Array:
    """What turns residuals into independent ones of sd 1, (k, 3, 3): L⁻¹ of covariances L Lᵀ.

    Where the field is told along one direction alone it is (k, 1, 3): that direction.
    """
    if measured.along is not None:
        return np.asarray(measured.along / measured.noise[:, None])[:, None, :]
    return np.asarray(np.linalg.inv(np.linalg.cholesky(compute_covariance(at, measured))))


def compute_information(at: Unknowns, measured: Measured, *, each: bool = False) -> Array:
    """JᵀC⁻¹J (18, 18) of all unknowns; of `each` orientation (k, 18, 18)."""
    _, jacobian = compute_residual(at, measured)
    white = compute_whitener(at, measured) @ jacobian
    return np.asarray(np.einsum(f"kir,kis->{'k' if each else ''}rs", white, white))


def weigh(information: Array, prior: Array, magnitude: float) -> Array:
    """Information of measurements and prior on the free unknowns, per nT², (m, m)."""
    free = np.isfinite(prior)
    units = find_unit_sizes(magnitude)[free]
    whole = information[np.ix_(free, free)] + np.diag(prior[free])
    return np.asarray(whole / np.outer(units, units))


def invert(information: Array, prior: Array) -> Array:
    """The covariance (18, 18) that information of measurements and prior leaves, 0 where fixed."""
    free = np.isfinite(prior)
    both = np.ix_(free, free)
    covariance = np.zeros((SIZE, SIZE))
    covariance[both] = leastsq.inverse(information[both] + np.diag(prior[free]))
    return covariance


def compute_turn_sd(covariance: Array) -> float:
    """The standard error of a rotation about the axis about which it is known least, rad."""
    turn = covariance[GROUPS["alignment"], GROUPS["alignment"]]
    if not np.isfinite(turn).all():
        return float("inf")
    return float(np.sqrt(np.linalg.eigvalsh(turn)[-1]))


def compute_rotation_vector(matrix: Array) -> Array:
    """The rotation vectors (…, 3) of matrices (…, 3, 3), rad."""
    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())


def find_unit_sizes(magnitude: float) -> Array:
    """How many nT a unit of each unknown moves the field by, (18,): rad and matrix by its size."""
    scale = np.ones(SIZE)
    for group in ("alignment", "reference", "matrix"):
        scale[GROUPS[group]] = magnitude
    return scale
