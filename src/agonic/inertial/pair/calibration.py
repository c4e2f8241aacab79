"""The estimate back in units: a calibration of each sensor, both in the same axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.inertial.maths.shots import SIGHT, split
from agonic.inertial.maths.variance_components import adjust_covariance
from agonic.inertial.pair.problem import Problem
from agonic.inertial.pair.solve import Solution
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation.noise.student import compute_widening
from agonic.provenance import Provenance
from agonic.samples import Samples
from agonic.units import ACCELERATION, STANDARD_GRAVITY_M_S2

METHOD = ("kok-2016", "zhou-hu-zhou-lange-2019", "kenward-roger-1997")


class Pair(NamedTuple):
    """Calibrations of accelerometer and magnetometer, and the covariance (24, 24) of both."""

    accelerometer: Affine
    magnetometer: Affine
    covariance: Array


def widen(solution: Solution) -> Array:
    """The covariance (q, q), as wide as the few shots that told the noise make it."""
    covariance = adjust_covariance(solution.linear, solution.noise**2)
    return covariance * compute_widening(solution.weighted.freedom) ** 2


def make_pair(
    samples: Samples,
    problem: Problem,
    solution: Solution,
    magnitude: float | None,
    sighted: bool,
    provenance: Provenance,
) -> Pair:
    """The calibrations in body axes: x along the sight, or without one the accelerometer's own."""
    scale, unknowns = problem.scale, solution.unknowns
    size = _field_size(problem, unknowns, magnitude)

    def convert(p: Array) -> Array:
        """The twelve numbers of each sensor."""
        bias_a, shape, bias_m, matrix = split(p)
        body = point_ahead(p[SIGHT]) if sighted else np.eye(3)
        parts = (
            bias_a * scale.gravity,
            (body @ shape).ravel() * (STANDARD_GRAVITY_M_S2 / scale.gravity),
            scale.centre + scale.size * bias_m,
            (body @ matrix).ravel() * (size / scale.size),
        )
        return np.concatenate(parts)

    change = _differentiate(convert, unknowns)
    free = model_basis("full", FREE)
    onto = np.kron(np.eye(2), free.T)
    covariance = onto @ change @ widen(solution) @ change.T @ onto.T
    values = convert(unknowns)
    assert samples.acceleration is not None
    accelerometer = Affine(
        bias=values[:3],
        matrix=values[3:12].reshape(3, 3),
        covariance=covariance[:12, :12],
        unit_in=ACCELERATION,
        unit_out=ACCELERATION,
        gauge=FREE,
        magnitude=STANDARD_GRAVITY_M_S2,
        noise=float(solution.noise[0] * abs(scale.gravity)),
        sensor=f"{samples.name} accelerometer",
        frame_out="b",
        validity=Validity(largest_reading=float(np.abs(samples.acceleration).max())),
        provenance=provenance,
    )
    magnetometer = Affine(
        bias=values[12:15],
        matrix=values[15:].reshape(3, 3),
        covariance=covariance[12:, 12:],
        unit_in=samples.unit,
        unit_out="nT" if magnitude is not None else samples.unit,
        gauge=FREE,
        magnitude=size,
        noise=float(solution.noise[1] * scale.size),
        sensor=samples.name,
        device_id=samples.device_id,
        frame_out="b",
        validity=Validity.of(samples),
        provenance=provenance,
    )
    return Pair(accelerometer, magnetometer, covariance)


def _field_size(problem: Problem, unknowns: Array, magnitude: float | None) -> float:
    """What length one of the field stands for: known, or so that volumes are kept."""
    if magnitude is not None:
        return magnitude
    matrix = split(unknowns)[3]
    return float(problem.scale.size / abs(np.linalg.det(matrix)) ** (1 / 3))


def point_ahead(sight: Array) -> Array:
    """The rotation (3, 3) into axes whose x is the sight and whose z stays as near as it can.

    >>> point_ahead(np.array([0.0, 1.0, 0.0])) @ [1.0, 2.0, 3.0]
    array([ 2., -1.,  3.])
    """
    ahead = sight / np.linalg.norm(sight)
    down = np.array([0.0, 0.0, 1.0]) if abs(ahead[2]) < 0.9 else np.array([-1.0, 0.0, 0.0])
    right = np.cross(down, ahead)
    right /= np.linalg.norm(right)
    return np.stack([ahead, right, np.cross(ahead, right)])


def _differentiate(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences: the functions here are smooth, and products of their unknowns."""
    columns = [(function(at + d) - function(at - d)) / (2 * step) for d in step * np.eye(len(at))]
    return np.stack(columns, axis=1)
