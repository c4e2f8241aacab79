"""The standard errors that a campaign will give, from the information matrix of its model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import affine
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.vectors import skew

_EXACT = 1e-6
"""Standard deviation, nT, of the magnitude to which the field is scaled: it fixes the unit. Also
the smallest of a turn, degrees."""


class ExpectedErrors(NamedTuple):
    """Standard errors at each temperature, nT: bias x y z (m, 3), matrix × field (m, 6)."""

    bias_sd: Array
    matrix_sd: Array

    @property
    def bias(self) -> float:
        """The rms over range and axes."""
        return float(np.sqrt(np.mean(self.bias_sd**2)))

    @property
    def matrix(self) -> float:
        """The rms over range and the entries xx yy zz xy xz yz."""
        return float(np.sqrt(np.mean(self.matrix_sd**2)))


def expect_errors(
    rot_nb: Array,
    field_n: Array,
    basis: Array,
    readings: Array,
    noise: float,
    *,
    fixture_sd_deg: float | None,
    chamber_sd: float = 0.0,
) -> ExpectedErrors:
    """What is to be expected of stations whose turns are known to `fixture_sd_deg`, or where that
    is None of the magnitude alone: of residuals along the field.

    The residual is W (raw − bias) − Rᵀ F, its coefficients linear in `basis` (m, p) at each
    temperature, where (m,) `readings` of a station lie, with `noise`. Unknown beside them are the
    chamber's field F, of known magnitude, and with a prior the turn of each station (k, 3, 3) and
    what its field was more, to `chamber_sd`. The errors of the matrix are those of its symmetric
    part. The information is Σ (n/σ²) (J Jᵀ) ⊗ (φ φᵀ) over stations and temperatures.
    """
    stations, size = len(rot_nb), float(np.linalg.norm(field_n))
    turned = np.swapaxes(rot_nb, 1, 2)
    fields = turned @ field_n
    local = affine.correction_jacobian(fields, np.zeros(3), np.eye(3))
    beside = np.zeros((stations, 3, 3 + 6 * stations))
    beside[:, :, :3] = -turned
    for k in range(stations):
        at = 3 + 6 * k
        beside[k, :, at : at + 3] = np.radians(max(fixture_sd_deg or 0.0, _EXACT)) * skew(fields[k])
        beside[k, :, at + 3 : at + 6] = -chamber_sd * turned[k]
    if fixture_sd_deg is None:
        local, beside = (fields[:, None] @ each / size for each in (local, beside))
    weight, a, p = readings / noise**2, local.shape[2], basis.shape[1]
    of_all, across, of_beside = (
        np.einsum("kra,krb->ab", left, right)
        for left, right in ((local, local), (local, beside), (beside, beside))
    )
    side = np.kron(across, (weight @ basis)[:, None])
    corner = of_beside * weight.sum() + np.eye(len(of_beside))
    corner[:3, :3] += np.outer(field_n, field_n) / (size * _EXACT) ** 2
    corner[:3, :3] += np.eye(3) * (size**-2.0 - 1.0)  # of its direction little is known
    weak = np.repeat([size**-2.0, 1.0], [3, a - 3])
    top = np.kron(of_all, (basis * weight[:, None]).T @ basis) + np.diag(np.repeat(weak, p))
    covariance = leastsq.inverse(np.block([[top, side], [side.T, corner]]))
    blocks = covariance[: a * p, : a * p].reshape(a, p, a, p)
    symmetric = np.asarray(np.linalg.pinv(affine.model_basis("full")), np.float64)
    nine = symmetric @ np.einsum("mi,aibj,mj->mab", basis, blocks, basis) @ symmetric.T
    sd = np.sqrt(np.maximum(np.einsum("maa->ma", nine), 0.0))
    return ExpectedErrors(sd[:, :3], sd[:, 3:] * size)
