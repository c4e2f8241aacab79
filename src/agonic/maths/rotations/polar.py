"""A matrix as a rotation and a symmetric one, for magnitudes tell nothing of the rotation.

|W d| with W = R S, S = √(WᵀW), is |S d|: what magnitudes determine is S, and R stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.rotations.vectors import skew


class RotationPart(NamedTuple):
    """What magnitudes do not tell of W = rotation @ symmetric, and what was known at the start.

    `covariance` (12, 12) is of the bias, the symmetric matrix's xx yy zz xy xz yz, and the
    rotation, as a rotation vector on the left, rad.
    """

    rotation: Array
    covariance: Array

    def free(self, symmetric: Array, covariance: Array) -> tuple[Array, Array]:
        """W and the covariance (12, 12) of bias, xx yy zz xy xz yz yx zx zy.

        `covariance` (9, 9) is that of bias and symmetric; the rotation keeps its own.
        """
        whole = np.zeros((12, 12))
        whole[:9, :9] = covariance
        whole[9:, 9:] = self.covariance[9:, 9:]
        change = _change(self.rotation, symmetric)
        return self.rotation @ symmetric, change @ whole @ change.T


def split_rotation(
    matrix: Array, covariance: Array | None, gauge: str
) -> tuple[Array, RotationPart]:
    """S (six entries) of a matrix, and the rest; `covariance` is that of the gauge's parameters."""
    rotation, symmetric = polar(matrix)
    whole = np.zeros((12, 12))
    if covariance is not None:
        spread = np.linalg.inv(_change(rotation, symmetric)) @ _to_free(gauge)
        whole = spread @ covariance @ spread.T
    return pack_symmetric(symmetric), RotationPart(rotation, whole)


def _to_free(gauge: str) -> Array:
    """From the parameters of a gauge to those of the free one."""
    return np.asarray(model_basis("full", FREE).T @ model_basis("full", gauge))


def _change(rotation: Array, symmetric: Array) -> Array:
    """∂(bias, free matrix entries)/∂(bias, symmetric's six, rotation vector), (12, 12)."""
    basis = model_basis("full", FREE)[3:, 3:]  # the free entries' places in the matrix
    change = np.eye(12)
    for k in range(6):
        change[3:, 3 + k] = basis.T @ (rotation @ unpack_symmetric(np.eye(6)[k])).ravel()
    for k, generator in enumerate(skew(np.eye(3))):
        change[3:, 9 + k] = basis.T @ (generator @ rotation @ symmetric).ravel()
    return change
