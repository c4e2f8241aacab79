"""The steps of whatever calibrates readings: a chain's, or the one that a calibration is."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias, TypeVar

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.deviation import Deviation
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.equation.affine import join, model_basis
from agonic.provenance import Provenance

AnyCalibration: TypeAlias = Affine | Thermal | Network | Alignment | Chain
"""Every calibration of readings that is saved, exported and loaded; an `Affine` may be an
`Interference`."""


def require_calibration(value: object) -> AnyCalibration:
    """The value itself, or an `AgonicError` that says what to give instead."""
    if isinstance(value, AnyCalibration):
        return value
    if isinstance(value, Deviation):
        raise AgonicError(
            "a deviation card corrects headings and a calibration of readings is needed; name the "
            "card in a setup beside the calibration of its compass"
        )
    if "calibration" in getattr(value, "__dataclass_fields__", ()):
        raise AgonicError("a Fit was given and a calibration is needed: give fit.calibration")
    raise AgonicError(
        f"a {type(value).__name__} was given and a calibration is needed: "
        "an Affine, a Thermal, a Network, an Alignment or a Chain of them"
    )


def steps_of(calibration: Calibration) -> tuple[Affine | Thermal | Network | Alignment, ...]:
    """The steps of a chain, or the one that a calibration is."""
    known = require_calibration(calibration)
    return known.steps if isinstance(known, Chain) else (known,)


Step = TypeVar("Step", Affine, Interference, Thermal, Network, Alignment)


def find_step(calibration: Calibration, kind: type[Step]) -> Step | None:
    """The first step of a calibration that is of a kind, or `None`."""
    return next((step for step in steps_of(calibration) if isinstance(step, kind)), None)


def list_origins(calibration: AnyCalibration | Deviation) -> list[Provenance]:
    """Where a calibration, and each of its steps, came from."""
    steps = calibration.steps if isinstance(calibration, Chain) else ()
    return [calibration.provenance, *(step.provenance for step in steps)]


def find_magnitude(calibration: Calibration) -> float | None:
    """The field magnitude that the last step with one was scaled to, in `unit_out`, if known."""
    magnitudes = [
        step.magnitude for step in steps_of(calibration) if isinstance(step, Affine | Thermal)
    ]
    return magnitudes[-1] if magnitudes else None


def compose(calibration: Calibration) -> Affine:
    """A whole calibration as one step, an `Interference` where it takes sources into account."""
    known = require_calibration(calibration)
    if not isinstance(known, Affine | Chain):
        known = Chain(steps=(known,))
    one = known.composed if isinstance(known, Chain) else known
    if np.linalg.matrix_rank(one.matrix) < 3:
        raise AgonicError("the matrix of this calibration is singular; it cannot be exported")
    return one


def compute_composed_covariance(calibration: Calibration) -> Array | None:
    """Covariance (12, 12) of bias x y z and matrix xx xy … zz of `compose`; `None` where unknown.

        C = Σ d dᵀ,   d = (f(θ + l) − f(θ − l)) / 2

    over the columns l of a square root of each step's own covariance: all steps are taken to be
    independent. It is known where every step is an `Affine` or an `Alignment` that carries one; a
    current or throttle in a step stays at zero.

    Source: Julier & Uhlmann (1997), A new extension of the Kalman filter to nonlinear systems.
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
        from scipy.spatial.transform import Rotation  # slow to load

        return replace(step, rotation=Rotation.from_rotvec(root) * step.rotation)
    if isinstance(step, Affine):
        return replace(step, bias=step.bias + root[:3], matrix=step.matrix + root[3:].reshape(3, 3))
    raise AgonicError(f"a {type(step).__name__} has no twelve numbers")


def _compose_numbers(steps: tuple[Calibration, ...]) -> Array:
    one = compose(Chain(steps=steps))  # type: ignore[arg-type]
    return join(one.bias, one.matrix)
