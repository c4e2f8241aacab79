"""The residual of a session, W (raw − bias) − R_mc R_cn H (reference + offset), and its Jacobian.

R_mc turns star sensor components into the magnetometer's (the wanted rotation), R_cn
north-east-down into the star sensor's (measured), and H the reference's axes into north, east and
down. Rotations change by small rotation vectors on the left, so no angle is ever singular.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.rotations.attitude import make_rotation
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


class Given(NamedTuple):
    """Observations of k orientations: fields (k, 3), attitudes (k, 3, 3), standard deviations (k,).

    `star_covariance` (k, 3, 3), rad², star sensor axes.
    """

    field: Array
    reference: Array
    rot_cn: Array
    star_covariance: Array
    noise: Array
    reference_noise: Array


def start_unknowns() -> Unknowns:
    """Nothing turned, nothing added."""
    return Unknowns(np.eye(3), np.eye(3), np.zeros(3), np.zeros(3), np.eye(3))


def predict_field_c(at: Unknowns, given: Given) -> Array:
    """The field (k, 3) that the star sensor would read, were it a magnetometer."""
    return np.asarray(given.rot_cn @ at.rot_nr @ (given.reference + at.offset)[:, :, None])[:, :, 0]


def compute_residual(at: Unknowns, given: Given) -> tuple[Array, Array]:
    """Residuals (k, 3), nT, magnetometer axes, and the Jacobian (k, 3, 18) of a small step."""
    d = given.field - at.bias
    expected = predict_field_c(at, given) @ at.rot_mc.T
    onto_m = at.rot_mc @ given.rot_cn
    beside = (given.reference + at.offset) @ at.rot_nr.T
    jacobian = np.empty((len(d), 3, SIZE))
    jacobian[:, :, :3] = skew(expected)
    jacobian[:, :, 3:6] = onto_m @ skew(beside)
    jacobian[:, :, 6:9] = -onto_m @ at.rot_nr
    jacobian[:, :, 9:12] = -at.matrix
    for k, unit in enumerate(np.eye(6)):
        jacobian[:, :, 12 + k] = d @ unpack_symmetric(unit)
    return d @ at.matrix - expected, jacobian


def compute_covariance(at: Unknowns, given: Given) -> Array:
    """Covariance (k, 3, 3) of the residuals, nT²: magnetometer, reference and attitude.

    An attitude that is off by the small rotation ε sees the field v off by ε × v.
    """
    across = at.rot_mc @ skew(predict_field_c(at, given))
    stars = across @ given.star_covariance @ np.swapaxes(across, 1, 2)
    own = given.noise[:, None, None] ** 2 * (at.matrix @ at.matrix)
    beside = given.reference_noise[:, None, None] ** 2 * np.eye(3)
    return np.asarray(own + beside + stars)


def compute_whitener(covariance: Array) -> Array:
    """L⁻¹ (k, 3, 3) of covariances L Lᵀ: what turns residuals into independent ones of sd 1."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))


def compute_information(at: Unknowns, given: Given) -> Array:
    """JᵀC⁻¹J (18, 18) of all unknowns."""
    _, jacobian = compute_residual(at, given)
    white = compute_whitener(compute_covariance(at, given)) @ jacobian
    return np.asarray(np.einsum("kir,kis->rs", white, white))


def find_unit_sizes(magnitude: float) -> Array:
    """How many nT a unit of each unknown moves the field by, (18,): rad and matrix by its size."""
    scale = np.ones(SIZE)
    for group in ("alignment", "reference", "matrix"):
        scale[GROUPS[group]] = magnitude
    return scale
