"""How sure the twelve numbers are that a whole calibration amounts to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.steps import compose, steps_of
from agonic.errors import AgonicError
from agonic.maths.equation.affine import join, model_basis


def compute_composed_covariance(calibration: Calibration) -> Array | None:
    """Covariance (12, 12) of bias x y z and matrix xx xy … zz of `compose`; `None` where unknown.

        C = Σ d dᵀ,   d = (f(θ + l) − f(θ − l)) / 2

    over the columns l of a square root of each step's own covariance: all steps are taken to be
    independent. It is known where every step is an `Affine` or an `Alignment` that carries one; a
    current or throttle in a step stays at zero.

    Source: Julier & Uhlmann (1997), A new extension of the Kalman filter to nonlinear systems.

    >>> mag = Affine(bias=[1, 2, 3], matrix=np.eye(3), covariance=np.diag([4.0, 9, 16] + [0.0] * 6))
    >>> np.sqrt(np.diag(compute_composed_covariance(mag)))[:3].tolist()
    [2.0, 3.0, 4.0]
    """
    steps = steps_of(calibration)
    covariance = np.zeros((12, 12))
    for place, step in enumerate(steps):
        roots = _find_roots(step)
        if roots is None:
            return None
        for root in roots:
            either = [
                _compose_numbers((*steps[:place], _move(step, sign * root), *steps[place + 1 :]))
                for sign in (1.0, -1.0)
            ]
            difference = (either[0] - either[1]) / 2
            covariance += np.outer(difference, difference)
    return covariance


def _find_roots(step: Calibration) -> Array | None:
    """Rows whose outer products add up to a step's covariance: of its twelve numbers, or turn."""
    if not isinstance(step, Affine | Alignment):
        return None
    covariance = step.covariance
    if covariance is None:
        return None
    if isinstance(step, Affine):
        basis = model_basis("full", step.gauge)
        m = basis.shape[1]
        covariance = basis @ covariance[:m, :m] @ basis.T
    values, vectors = np.linalg.eigh(covariance)
    known = values > 0
    return np.asarray((vectors[:, known] * np.sqrt(values[known])).T)


def _move(step: Calibration, root: Array) -> Calibration:
    """A step with its numbers changed by a root."""
    if isinstance(step, Alignment):
        return replace(step, rotation=Rotation.from_rotvec(root) * step.rotation)
    if isinstance(step, Affine):
        return replace(step, bias=step.bias + root[:3], matrix=step.matrix + root[3:].reshape(3, 3))
    raise AgonicError(f"a {type(step).__name__} has no twelve numbers")


def _compose_numbers(steps: tuple[Calibration, ...]) -> Array:
    one = compose(Chain(steps=steps))  # type: ignore[arg-type]
    return join(one.bias, one.matrix)
