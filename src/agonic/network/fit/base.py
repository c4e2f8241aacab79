"""The affine calibration under a network, where none is given: from vectors, or magnitudes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.thermal import Thermal
from agonic.errors import CoverageError
from agonic.maths.equation.affine import FREE, model_basis, split
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import estimate
from agonic.maths.estimation import leastsq
from agonic.network.maths.robust import solve_with_noise

SOFT_IRON_SD = 0.1
"""Prior on the matrix about one gain, which decides where the readings do not."""


class Ends(NamedTuple):
    """Whose readings, in which unit and axes, into which axes; the same for base and network."""

    sensor: str
    unit_in: str
    frame_in: str
    frame_out: str
    device_id: int | None


class BaseFit(NamedTuple):
    """A base and the standard deviation (nT) that its standard errors rest on; None if given."""

    calibration: Affine | Thermal | None
    noise: float | None = None


def fit_vectors(raw: Array, field: Array, ends: Ends, *, robust: bool) -> BaseFit:
    """The affine calibration from the field (n, 3) of every reading (n, 3).

    raw = A field + c + noise is linear in A and c, and its noise is where it belongs:

        matrix = A⁻¹,   bias = c,   with a prior on A about one gain
    """
    points, centre, size = _centre_and_scale(raw, "readings never change")
    known, middle, strength = _centre_and_scale(field, "known field never changes")
    rows = np.column_stack([known, np.ones(len(raw))])

    def pieces(params: Array) -> Iterator[tuple[Array, Array]]:
        for axis in range(3):
            jacobian = np.zeros((len(raw), 12))
            jacobian[:, 4 * axis : 4 * axis + 4] = rows
            yield rows @ params[4 * axis : 4 * axis + 4] - points[:, axis], jacobian

    wanted = np.eye(3, 4).ravel()
    sds = np.tile([*[SOFT_IRON_SD] * 3, 1e3], 3)

    def prior(params: Array) -> tuple[Array, Array]:
        return (params - wanted) / sds, np.diag(1 / sds)

    solution, noise = solve_with_noise(pieces, wanted, scale=1e-2, prior=prior, robust=robust)
    made = Affine(
        **_invert(solution, centre, size, middle, strength),
        gauge=FREE,
        magnitude=float(np.sqrt(np.mean(middle @ middle + 3 * strength**2))),
        noise=noise.sd * size,
        **ends._asdict(),
    )
    return BaseFit(made, noise.sd * float(np.sqrt(noise.correlation)) * strength)


def _centre_and_scale(values: Array, trouble: str) -> tuple[Array, Array, float]:
    """Values (n, 3) centred and of about one, and how to get back."""
    centre = values.mean(axis=0)
    size = float(np.sqrt(np.mean((values - centre) ** 2)))
    if size == 0.0:
        raise CoverageError(
            f"the {trouble}, so nothing can be learned from them",
            turns="record while the sensor turns, or drive the coil",
        )
    return (values - centre) / size, centre, size


def _invert(
    solution: leastsq.Solution, centre: Array, size: float, middle: Array, strength: float
) -> dict[str, Any]:
    """Bias and matrix from the response, with their covariance.

    Unscaled: A = size/strength A', c = centre + size c' − A middle; then W = A⁻¹ and
    dW = −W dA W, and bias = c.
    """
    rows, onto = solution.params.reshape(3, 4), size / strength
    response = onto * rows[:, :3]
    bias = centre + size * rows[:, 3] - response @ middle
    matrix = np.asarray(np.linalg.inv(response), dtype=np.float64)
    local = np.zeros((12, 12))
    for axis in range(3):
        local[axis, 4 * axis : 4 * axis + 3] = -onto * middle
        local[axis, 4 * axis + 3] = size
        for k in range(3):
            step = -onto * np.outer(matrix[:, axis], matrix[k])
            local[3:, 4 * axis + k] = step.ravel()
    reduced = np.linalg.pinv(model_basis("full", FREE)) @ local
    covariance = reduced @ solution.covariance @ reduced.T
    return {"bias": bias, "matrix": matrix, "covariance": covariance}


def fit_magnitudes(raw: Array, magnitude: Array, ends: Ends, *, robust: bool, seed: int) -> BaseFit:
    """The affine calibration, symmetric, from the magnitude (n,) at every reading (n, 3)."""
    centre = raw.mean(axis=0)
    size, mean = float(np.sqrt(np.mean((raw - centre) ** 2) * 3)), float(magnitude.mean())
    if size == 0.0:
        raise CoverageError("the readings never change", turns="turn the sensor about all axes")
    problem = Problem((raw - centre) / size, magnitude / mean, "full", SOFT_IRON_SD)
    found = estimate(problem, robust=robust, seed=seed)
    point, matrix = split(model_basis("full") @ found.solution.params)
    sizes = np.r_[np.full(3, size), np.full(6, mean / size)]
    noise = found.noise["magnitude"]
    made = Affine(
        bias=centre + size * point,
        matrix=matrix * mean / size,
        covariance=found.solution.covariance * np.outer(sizes, sizes),
        magnitude=mean,
        noise=noise.sd * size,
        **ends._asdict(),
    )
    return BaseFit(made, noise.sd * float(np.sqrt(noise.correlation)) * mean)
