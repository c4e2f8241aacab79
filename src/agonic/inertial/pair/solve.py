"""The unknowns, the noise of each sensor, and the shots that do not fit; and the estimate back in
units: a calibration of each sensor, both in the same axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.errors import ConvergenceError
from agonic.inertial.maths.shots import SIGHT, linearise, split
from agonic.inertial.maths.variance_components import (
    Linear,
    Weighted,
    adjust_covariance,
    estimate_variances,
    weigh,
)
from agonic.inertial.pair.problem import EXPECTED_NOISE, Problem, hold_sight
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation.noise.student import compute_widening
from agonic.provenance import Provenance
from agonic.samples import Samples
from agonic.units import ACCELERATION, STANDARD_GRAVITY_M_S2

RARE = 0.01
"""A shot is left out where chance would make one of them all so odd this often."""
MOST_LEFT_OUT = 0.25
CANDIDATES = 6
_ROUNDS, _FEW = 60, 4
_NEAR, _THERE = 0.1, 1e-4
"""Squares of a step, in standard errors: from where on the noise is worth its time, and the end."""


class Solution(NamedTuple):
    """Unknowns (q,), noise (3,) as sds, what the last round saw, and which shots (k,) counted."""

    unknowns: Array
    noise: Array
    linear: Linear
    weighted: Weighted
    kept: Index


def solve(problem: Problem) -> Solution:
    """The most probable unknowns, without the shots that the others contradict."""
    kept = np.arange(len(problem.shots.force))
    solution = _iterate(problem, kept, problem.start, EXPECTED_NOISE**2)
    while len(kept) > (1 - MOST_LEFT_OUT) * len(problem.shots.force):
        worst = find_outlier(solution)
        if worst is None:
            break
        kept = np.delete(kept, worst)
        solution = _iterate(problem, kept, solution.unknowns, solution.noise**2)
    return solution


def _iterate(problem: Problem, kept: Index, unknowns: Array, theta: Array) -> Solution:
    """Gauss–Newton, with the noise estimated anew at each step."""
    shots, prior, size = problem.shots.select(kept), problem.prior, 1.0
    for _ in range(_ROUNDS):
        pull = prior.information @ (unknowns - prior.mean)
        known = prior.information + hold_sight(unknowns)
        linear = Linear(*linearise(shots, unknowns), known, pull)
        few = {"rounds": _FEW} if size > _NEAR else {}
        theta = estimate_variances(linear, theta, EXPECTED_NOISE**2, **few)
        weighted = weigh(linear, theta)
        unknowns = unknowns + weighted.step * min(1.0, 0.5 / float(np.abs(weighted.step).max()))
        unknowns[SIGHT] /= np.linalg.norm(unknowns[SIGHT])
        size = float(weighted.step @ (weighted.information + linear.prior) @ weighted.step)
        if size < _THERE:
            return Solution(unknowns, np.sqrt(theta), linear, weighted, kept)
    raise ConvergenceError(
        "the two calibrations did not settle; are all shots of one instrument, at rest, in one "
        "place?"
    )


def find_outlier(solution: Solution) -> int | None:
    """The shot whose residuals the other shots make least probable, if chance hardly made them.
    Each of the likeliest is left out, the noise is estimated without it, and what it then shows is
    compared with what the others let one expect: an F of its residuals and their freedom."""
    theta, linear = solution.noise**2, solution.linear
    n = len(linear.residuals)
    odd = [_weigh_shot(solution.weighted, own, i) for i, own in enumerate(linear.there)]
    best: tuple[float, int] | None = None
    for i in np.argsort(odd)[:CANDIDATES]:
        others = linear.select(np.arange(n) != i)
        without = estimate_variances(others, theta, EXPECTED_NOISE**2)
        statistic, count = _predict(linear, others, without, int(i))
        freedom = max(weigh(others, without).freedom, 1.0)
        chance = float(fdtrc(count, freedom, statistic / count))
        if best is None or chance < best[0]:
            best = chance, int(i)
    return best[1] if best is not None and best[0] * n < RARE else None


def _weigh_shot(weighed: Weighted, own: Mask, i: int) -> float:
    """The probability of a shot's residuals among the others, noise as it is."""
    z, block = weighed.whitened[i][own], weighed.free[i][np.ix_(own, own)]
    square = float(z @ np.linalg.pinv(block, rcond=1e-9, hermitian=True) @ z)
    return float(chdtrc(int(own.sum()), square))


def _predict(linear: Linear, others: Linear, theta: Array, i: int) -> tuple[float, int]:
    """χ² of a shot's residuals at what the others tell, and how many they are."""
    own = linear.there[i]
    found = weigh(others, theta)
    jacobian = linear.jacobian[i][own]
    left = linear.residuals[i][own] + jacobian @ found.step
    variance = np.einsum("k,kij->ij", theta, linear.variances[:, i])[np.ix_(own, own)]
    spread = variance + jacobian @ found.covariance @ jacobian.T
    return float(left @ np.linalg.solve(spread, left)), int(own.sum())


def compare_shots(problem: Problem, solution: Solution) -> Array:
    """The residuals (n, 5) of all shots at the solution, in units of their standard deviations."""
    found = linearise(problem.shots, solution.unknowns)
    theta = solution.noise**2
    variance = np.einsum("k,knij->nij", theta, found.variances)
    spread = found.jacobian @ solution.weighted.covariance @ np.swapaxes(found.jacobian, 1, 2)
    out = ~np.isin(np.arange(len(found.residuals)), solution.kept)
    total = variance + np.where(out[:, None, None], spread, -spread)
    least, square = (np.diagonal(one, axis1=1, axis2=2) for one in (0.01 * variance, total))
    sd = np.where(found.there, np.sqrt(np.maximum(square, least)), 1.0)
    return np.where(found.there, found.residuals / sd, np.nan)


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
    """The rotation (3, 3) into axes whose x is the sight and whose z stays as near as it can."""
    ahead = sight / np.linalg.norm(sight)
    down = np.array([0.0, 0.0, 1.0]) if abs(ahead[2]) < 0.9 else np.array([-1.0, 0.0, 0.0])
    right = np.cross(down, ahead)
    right /= np.linalg.norm(right)
    return np.stack([ahead, right, np.cross(ahead, right)])


def _differentiate(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences: the functions here are smooth, and products of their unknowns."""
    columns = [(function(at + d) - function(at - d)) / (2 * step) for d in step * np.eye(len(at))]
    return np.stack(columns, axis=1)
