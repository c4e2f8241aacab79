"""What the numbers of a calibration come to: scale factors, angles between axes, powers of T.

With A = matrix⁻¹, whose rows a_i are what the axes of the sensor respond to, the scale factor of
axis i is |a_i| and the non-orthogonality of two axes arcsin(û_i·û_j), û = a/|a|. Standard errors
follow from dA = −A dW A.

|matrix (raw − bias)| = F is an ellipsoid about the bias. With matrixᵀ matrix = Σ λ_i v_i v_iᵀ its
half axes are F/√λ_i along v_i. Unequal gains alone leave it upright, its axes along those of the
sensor; soft iron across the axes, and sensor axes that are not square, tilt it. Standard errors
follow from

    dλ_i = v_iᵀ dQ v_i,   dv_i = Σ_j v_j (v_jᵀ dQ v_i)/(λ_i − λ_j),   Q = matrixᵀ matrix
"""

from __future__ import annotations

from itertools import permutations
from math import comb
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import model_basis

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
    lost = ~(np.abs(np.linalg.det(matrix)) > 1e-12 * largest)
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


Shape = Literal["sphere", "upright", "tilted"]
MAX_CHANCE = 0.01
"""Cross terms, or unequal half axes, that would be this improbable by chance are there."""


class RawEllipsoid(NamedTuple):
    """The ellipsoid of raw readings in a field of the calibration's magnitude.

    `half_axes` (3,) and their standard errors, in the unit of the readings, that nearest the
    sensor's x first; `axes` (3, 3) their directions, a row each; `tilt_deg` (3,) how far each lies
    off the sensor's x, y and z; `p_upright` and `p_sphere` how probable what is seen would be if
    it were upright, or a sphere.
    """

    shape: Shape
    half_axes: Array
    half_axes_sd: Array
    axes: Array
    tilt_deg: Array
    tilt_sd_deg: Array
    p_upright: float
    p_sphere: float


def find_raw_ellipsoid(calibration: Affine) -> RawEllipsoid | None:
    """The ellipsoid that an affine calibration makes a sphere of; None without its covariance. Of a
    model that was chosen as a sphere or as diagonal the shape is that; else the cross terms of Q,
    and the differences of its diagonal, are tested against their covariance (Wald)."""
    matrix = calibration.matrix
    if calibration.covariance is None or not np.isfinite(matrix).all():
        return None
    quadric = matrix.T @ matrix
    values, vectors = np.linalg.eigh(quadric)
    if not values[0] > 1e-12 * values[-1]:
        return None
    ways = map(list, permutations(range(3)))
    order = max(ways, key=lambda at: float(np.abs(np.diag(vectors[:, at])).prod()))
    values, vectors = values[order], vectors[:, order]
    vectors = vectors * np.where(np.diag(vectors) < 0, -1.0, 1.0)
    entries = model_basis("full", calibration.gauge)[3:, 3:].T.reshape(-1, 3, 3)
    by = np.swapaxes(entries, 1, 2) @ matrix + matrix.T @ entries  # dQ of each free entry
    covariance = calibration.covariance[3 : 3 + len(entries), 3 : 3 + len(entries)]
    tilt, tilt_sd = _find_tilt(values, vectors, by, covariance)
    size = (calibration.magnitude or 1.0) / np.sqrt(values)
    stretched = -0.5 * size / values * np.einsum("ai,kab,bi->ki", vectors, by, vectors)
    p_upright, p_sphere = (
        _test(_pick(quadric, whole), _pick(by, whole), covariance) for whole in (False, True)
    )
    return RawEllipsoid(
        shape=_name_shape(calibration, p_upright, p_sphere),
        half_axes=size,
        half_axes_sd=_propagate(stretched, covariance),
        axes=vectors.T,
        tilt_deg=np.degrees(tilt),
        tilt_sd_deg=np.degrees(tilt_sd),
        p_upright=p_upright,
        p_sphere=p_sphere,
    )


def _find_tilt(values: Array, vectors: Array, by: Array, covariance: Array) -> tuple[Array, Array]:
    """How far each axis lies off that of the sensor (3,), rad, and the standard errors."""
    gaps = values[:, None] - values  # λ_i − λ_j
    np.fill_diagonal(gaps, np.inf)
    gaps = np.where(np.abs(gaps) < 1e-12 * values.max(), 1e-12 * values.max(), gaps)
    turned = np.einsum("aj,kab,bi->kij", vectors, by, vectors) / gaps  # along v_j, of v_i
    moved = np.einsum("kij,aj->kia", turned, vectors)
    cosine = np.clip(np.diag(vectors), 0.0, 1.0)
    tilt = np.arccos(cosine)
    across = vectors.T - cosine[:, None] * np.eye(3)  # from the sensor's axis to this one
    length = np.linalg.norm(across, axis=1)
    known = length > 1e-9
    along = np.einsum("kia,ia->ki", moved, across / np.where(known, length, 1.0)[:, None])
    # the part of dv square to the sensor's axis is dθ cos θ
    sds = _propagate(along / np.maximum(cosine, 1e-9), covariance)
    spread = np.einsum("kia,kl,lia->i", moved, covariance, moved)
    return tilt, np.where(known, sds, np.sqrt(np.maximum(spread, 0.0) / 2.0))


def _pick(quadric: Array, whole: bool) -> Array:
    """What is zero of an upright ellipsoid (…, 3), or `whole` of a sphere (…, 5)."""
    across = [quadric[..., a, b] for a, b in PAIRS]
    along = [quadric[..., a, a] - quadric[..., a + 1, a + 1] for a in range(2)]
    return np.stack([*across, *(along if whole else [])], axis=-1)


def _test(value: Array, jacobian: Array, covariance: Array) -> float:
    """How probable values (c,) or larger ones are by chance; Jacobian (k, c)."""
    spread = jacobian.T @ covariance @ jacobian
    return float(chdtrc(len(value), value @ np.linalg.pinv(spread) @ value))


def _name_shape(calibration: Affine, p_upright: float, p_sphere: float) -> Shape:
    if calibration.model == "sphere" or p_sphere > MAX_CHANCE:
        return "sphere"
    if calibration.model == "diagonal" or p_upright > MAX_CHANCE:
        return "upright"
    return "tilted"
