"""What the numbers of a calibration come to: scale factors, angles between axes, powers of T.

With A = matrix⁻¹, whose rows a_i are what the axes of the sensor respond to, the scale factor of
axis i is |a_i| and the non-orthogonality of two axes arcsin(û_i·û_j), û = a/|a|. Standard errors
follow from dA = −A dW A.
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import model_basis

_SINGULAR = 1e-12  # of the cube of the largest entry: a determinant that is none
PAIRS = ((0, 1), (0, 2), (1, 2))
"""The pairs of axes whose angle is given: xy, xz, yz."""


class Decomposition(NamedTuple):
    """Scale factors (…, 3) in raw units per nT, and non-orthogonality (…, 3) of xy, xz, yz in
    degrees, with their standard errors; NaN where the calibration has no covariance, or at that
    temperature no inverse."""

    scale_factors: Array
    scale_factors_sd: Array
    nonorthogonality_deg: Array
    nonorthogonality_sd_deg: Array


def decompose(calibration: Affine) -> Decomposition:
    """Scale factors and angles of an affine calibration."""
    covariance = calibration.covariance
    own = None if covariance is None else covariance[3 : 12 if calibration.gauge == "free" else 9]
    return _decompose(
        calibration.matrix, None if own is None else own[:, 3 : 3 + len(own)], calibration.gauge
    )


def decompose_at(calibration: Thermal, temperature_C: Array) -> Decomposition:
    """Scale factors and angles of a thermal calibration at temperatures (…), °C."""
    covariance = None
    if calibration.covariance is not None:
        covariance = calibration.covariance_at(temperature_C)[..., 3:, 3:]
    return _decompose(calibration.matrix_at(temperature_C), covariance, calibration.gauge)


def _decompose(matrix: Array, covariance: Array | None, gauge: str) -> Decomposition:
    """Of matrices (…, 3, 3) with the covariance (…, k, k) of their free entries."""
    largest = np.max(np.abs(matrix), axis=(-2, -1)) ** 3
    lost = ~(np.abs(np.linalg.det(matrix)) > _SINGULAR * largest)
    response = np.linalg.inv(np.where(lost[..., None, None], np.eye(3), matrix))
    response = np.where(lost[..., None, None], np.nan, response)
    size = np.linalg.norm(response, axis=-1)
    unit = response / size[..., None]
    cosine = np.stack([np.sum(unit[..., i, :] * unit[..., j, :], axis=-1) for i, j in PAIRS], -1)
    angle = np.degrees(np.arcsin(cosine))
    if covariance is None:
        nothing = np.full(size.shape, np.nan)
        return Decomposition(size, nothing, angle, nothing)
    entries = model_basis("full", gauge)[3:, 3:].T.reshape(-1, 3, 3)
    moved = -np.einsum("...ij,kjl,...lm->...kim", response, entries, response)
    along = np.einsum("...kim,...im->...ki", moved, unit)
    turned = (moved - along[..., None] * unit[..., None, :, :]) / size[..., None, :, None]
    by_angle = np.stack(
        [
            np.einsum("...km,...m->...k", turned[..., i, :], unit[..., j, :])
            + np.einsum("...km,...m->...k", turned[..., j, :], unit[..., i, :])
            for i, j in PAIRS
        ],
        axis=-1,
    )
    by_angle = np.degrees(by_angle / np.sqrt(1.0 - cosine**2)[..., None, :])
    return Decomposition(
        size, _propagate(along, covariance), angle, _propagate(by_angle, covariance)
    )


def _propagate(jacobian: Array, covariance: Array) -> Array:
    """Standard errors (…, 3) by a Jacobian (…, k, 3)."""
    variance = np.einsum("...ki,...kl,...li->...i", jacobian, covariance, jacobian)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def expand_in_temperature(calibration: Thermal) -> tuple[Array, Array | None]:
    """k₀, k₁, … of bias and matrix in powers of T itself, °C, as published: (a, p), and their sd.

        W(T) = k₀ + k₁ T + k₂ T² + …

    Rows are in the order of `Affine.parameters`; the calibration holds powers of
    (T − centre)/half range, which lose no digits.
    """
    p, centre, half = calibration.degree + 1, calibration.centre_C, calibration.half_range_C
    onto = np.zeros((p, p))  # from powers of x to those of T
    for k in range(p):
        for j in range(k + 1):
            onto[j, k] = comb(k, j) * (-centre) ** (k - j) / half**k
    basis = model_basis("full", calibration.gauge)
    local = np.column_stack([calibration.bias, calibration.matrix.reshape(p, 9)])
    values = local @ np.linalg.pinv(basis).T  # (p, a)
    sd = None
    if calibration.covariance is not None:
        a = values.shape[1]
        whole = calibration.covariance[: a * p, : a * p].reshape(a, p, a, p)
        sd = np.sqrt(np.maximum(np.einsum("jk,akal,jl->aj", onto, whole, onto), 0.0))
    return (onto @ values).T, sd
