"""The standard errors that a campaign will give, from the information matrix of its model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import affine
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.vectors import skew

_EXACT = 1e-6
"""Standard deviation, nT, of the magnitude to which the field is scaled: it fixes the unit."""


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


def expect_errors_by_magnitude(
    fields: Array, basis: Array, readings: Array, noise: float, chamber_sd: float = 0.0
) -> ExpectedErrors:
    """What is to be expected from the magnitude alone.

    The nine coefficients are linear in `basis`; each reading gives the distance from the ellipsoid
    (`affine.magnitude_residual`), so the information is Σ (n/σ²) (J Jᵀ) ⊗ (φ φᵀ) over
    stations and temperatures.

    Parameters
    ----------
    fields : (k, 3) the field in the axes of the sensor at each station, nT. basis : (m, p) φ at
        each temperature. readings : (m,) how many of each station lie there. noise : σ of one, nT.
    chamber_sd : how far, nT, the field of a station may be from that of the others.
    """
    magnitude = np.linalg.norm(fields, axis=1)
    local = affine.magnitude_residual(fields, np.zeros(3), np.eye(3), magnitude)[1]
    nine = np.asarray(local @ affine.model_basis("full"))
    shared = np.zeros((len(fields), len(fields)))
    np.fill_diagonal(shared, 1.0)
    covariance = _compute_covariance(
        nine[:, None], shared[:, None], basis, readings, noise, chamber_sd
    )
    return _evaluate_errors(covariance, np.eye(9), basis, float(magnitude.mean()))


def expect_errors_by_orientations(
    rot_nb: Array,
    field_n: Array,
    basis: Array,
    readings: Array,
    noise: float,
    *,
    fixture_sd_deg: float = 0.0,
    chamber_sd: float = 0.0,
) -> ExpectedErrors:
    """What is to be expected where the turns of the fixture are known, each to `fixture_sd_deg`.

    The residual is W (raw − bias) − Rᵀ F. Unknown beside the coefficients are the chamber's field
    F, of known magnitude, and with a prior the turn of each station and what its field was more;
    errors of the matrix are those of its symmetric part.

    Parameters
    ----------
    rot_nb : (k, 3, 3) from the axes of the box to those of the chamber at each station. field_n :
        (3,) the chamber's field, nT. basis, readings, noise, chamber_sd : as in `magnitude_errors`.
    """
    stations = len(rot_nb)
    fields = np.swapaxes(rot_nb, 1, 2) @ field_n
    local = affine.correction_jacobian(fields, np.zeros(3), np.eye(3))
    turned = np.swapaxes(rot_nb, 1, 2)
    size = float(np.linalg.norm(field_n))
    nuisance = np.zeros((stations, 3, 3 + 6 * stations))
    nuisance[:, :, :3] = -turned
    for k in range(stations):
        nuisance[k, :, 3 + 3 * k : 6 + 3 * k] = np.radians(max(fixture_sd_deg, 1e-6)) * skew(
            fields[k]
        )
        at = 3 + 3 * stations + 3 * k
        nuisance[k, :, at : at + 3] = -chamber_sd * turned[k]
    prior = np.zeros((3 + 6 * stations,) * 2)
    prior[:3, :3] = np.outer(field_n, field_n) / (size * _EXACT) ** 2
    prior[3:, 3:] = np.eye(6 * stations)
    covariance = _compute_covariance(local, nuisance, basis, readings, noise, None, prior)
    symmetric = np.asarray(np.linalg.pinv(affine.model_basis("full")), np.float64)
    return _evaluate_errors(covariance, symmetric, basis, size)


def _compute_covariance(
    local: Array,
    nuisance: Array,
    basis: Array,
    readings: Array,
    noise: float,
    nuisance_sd: float | None,
    prior: Array | None = None,
) -> Array:
    """Covariance of the coefficients (p fastest), with constant nuisance parameters.

    local (k, r, a) and nuisance (k, r, q) are Jacobians of the r residuals of a station.
    """
    if nuisance_sd == 0.0:
        nuisance = nuisance[:, :, :0]
    elif nuisance_sd is not None:
        nuisance = nuisance * nuisance_sd
    weight = readings / noise**2
    grams = [
        np.einsum("kra,krb->ab", left, right)
        for left, right in ((local, local), (local, nuisance), (nuisance, nuisance))
    ]
    second = np.einsum("m,mi,mj->ij", weight, basis, basis)
    first = weight @ basis
    top = np.kron(grams[0], second)
    side = np.kron(grams[1], first[:, None])
    corner = grams[2] * weight.sum() + (np.eye(nuisance.shape[2]) if prior is None else prior)
    information = np.block([[top, side], [side.T, corner]])
    return leastsq.inverse(information)[: len(top), : len(top)]


def _evaluate_errors(
    covariance: Array, chosen: Array, basis: Array, magnitude: float
) -> ExpectedErrors:
    """Standard errors at each temperature of the nine that `chosen` (9, a) makes of all."""
    p = basis.shape[1]
    blocks = covariance.reshape(len(covariance) // p, p, -1, p)
    at = np.einsum("mi,aibj,mj->mab", basis, blocks, basis)
    nine = chosen @ at @ chosen.T
    sd = np.sqrt(np.maximum(np.einsum("maa->ma", nine), 0.0))
    return ExpectedErrors(sd[:, :3], sd[:, 3:] * magnitude)
