"""What the ground calibration itself is uncertain by, as errors of the field it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, apply
from agonic.calibration.chain import Chain
from agonic.calibration.steps import steps_of
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.polar import split_rotation
from agonic.samples import Samples
from agonic.units import RAW

NO_MAGNITUDE = "none:"
"""How the reference of a fit without a known magnitude begins in its provenance."""


def find_ground_affine(ground: Calibration | None, temperature_C: float) -> Affine | None:
    """The ground calibration at a temperature as one affine; None without one."""
    held = ground.at(temperature_C) if isinstance(ground, (Thermal, Chain)) else ground
    whole = held.composed if isinstance(held, Chain) else held
    return whole if isinstance(whole, Affine) else None


def states_covariance(ground: Calibration) -> bool:
    """Whether any step of the calibration says how well its matrix is known."""
    return any(_covariance(step, 0.0) is not None for step in steps_of(ground))


def has_free_scale(ground: Calibration) -> bool:
    """Whether only a convention sets the scale of the ground calibration, for lack of a magnitude.

    Its provenance says so, or it gives counts.
    """
    told = [str(step.provenance.settings.get("reference", "")) for step in steps_of(ground)]
    return ground.unit_out == RAW or any(one.startswith(NO_MAGNITUDE) for one in told)


def bring_to_nT(ground: Calibration, samples: Samples, wanted: Array, used: Mask) -> Calibration:
    """A ground calibration that gives counts as one that gives nT, by the lengths of the field.

    Parameters: samples before it, `wanted` (n,) or (1,) nT, the rows `used` (n,).
    """
    if ground.unit_out != RAW or not isinstance(ground, (Affine, Thermal)):
        return ground
    found = find_length(apply(ground, samples).field[used])
    factor = median(np.broadcast_to(wanted, len(samples))[used] / np.maximum(found, 1e-300))
    by = np.array([factor if name.startswith("matrix") else 1.0 for name in ground.parameters])
    known = None if ground.covariance is None else ground.covariance * np.outer(by, by)
    return replace(ground, matrix=factor * ground.matrix, covariance=known, unit_out="nT")


def compute_shape_covariance(ground: Calibration, temperature_C: float) -> Array:
    """Covariance (9, 9) of the errors of the ground's matrix, as the flight meets them.

    Where the true matrix is (1 + S)(1 + Ω) W, of xx yy zz xy xz yz of S, then of the rotation
    vector of Ω, rad, which magnitudes do not tell. Zero where the ground states no covariance.

    A step k behind others adds dW_k W_k⁻¹ and carries the errors before it as W_k dM W_k⁻¹.
    """
    whole = np.zeros((9, 9))
    for step in steps_of(ground):
        held = step.at(temperature_C) if isinstance(step, Thermal) else step
        matrix = held.matrix if isinstance(held, Affine) else None
        if matrix is None:
            rotation = getattr(held, "rotation", None)
            matrix = np.eye(3) if rotation is None else rotation.as_matrix()
        inverse = np.linalg.inv(matrix)
        carried = np.kron(matrix, inverse.T)
        whole = carried @ whole @ carried.T
        covariance = _covariance(step, temperature_C)
        if covariance is not None:
            assert isinstance(held, Affine)
            own = np.kron(np.eye(3), inverse.T) @ model_basis("full", held.gauge)[3:, 3:]
            whole += own @ covariance @ own.T
    free = np.zeros((12, 12))
    onto = model_basis("full", FREE)[3:, 3:].T
    free[3:, 3:] = onto @ whole @ onto.T
    return split_rotation(np.eye(3), free, FREE)[1].covariance[3:, 3:]


def _covariance(step: Calibration, temperature_C: float) -> Array | None:
    """That of the matrix entries of a step in its gauge, (6, 6) or (9, 9); None if not known."""
    held = step.at(temperature_C) if isinstance(step, Thermal) else step
    if not isinstance(held, Affine) or held.covariance is None:
        return None
    entries = 3 + model_basis("full", held.gauge)[3:, 3:].shape[1]
    return held.covariance[3:entries, 3:entries]
