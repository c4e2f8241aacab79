"""What the ground calibration itself is uncertain by, as errors of the field it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, apply
from agonic.calibration.chain import Chain, contains_ground
from agonic.calibration.steps import steps_of
from agonic.calibration.thermal import Thermal
from agonic.maths.equation import polynomial
from agonic.maths.equation.affine import model_basis
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.vectors import skew
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
    return any(getattr(step, "covariance", None) is not None for step in steps_of(ground))


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


def find_order(ground: Calibration | None) -> int:
    """The order over temperature of the errors that a ground calibration states; 0 for none."""
    steps = () if ground is None else steps_of(ground)
    return max(
        (of.degree for of in steps if isinstance(of, Thermal) and of.covariance is not None),
        default=0,
    )


def compute_ground_covariance(ground: Calibration, temperatures_C: Array) -> Array:
    """Covariance (12 t, 12 t) of the errors of the ground calibration, as the flight meets them.

    Where the true field is (1 + S)(1 + Ω) u − e for the field u by the ground, those of each
    temperature (t,) in turn: xx yy zz xy xz yz of S, the rotation vector of Ω, rad, which
    magnitudes do not tell, and e, in the ground's unit. Zero where the ground states no covariance.

    A step k behind others adds dW_k W_k⁻¹ and W_k db_k, and carries the errors before it as
    W_k dM W_k⁻¹ and W_k e.
    """
    t = len(temperatures_C)
    whole = np.zeros((12 * t, 12 * t))
    for step in steps_of(ground):
        if isinstance(step, Thermal):
            matrices = [step.at(float(one)).matrix for one in temperatures_C]
        else:
            turn = getattr(step, "rotation", None)
            plain = np.eye(3) if turn is None else turn.as_matrix()
            matrices = [getattr(step, "matrix", plain)] * t
        carried = block_diag(*(block_diag(np.kron(w, np.linalg.inv(w).T), w) for w in matrices))
        whole = carried @ whole @ carried.T
        if contains_ground(step):
            whole = np.zeros_like(whole)
        if isinstance(step, (Affine, Thermal)) and step.covariance is not None:
            own = _differentiate(step, temperatures_C, matrices)
            whole += own @ step.covariance[: own.shape[1], : own.shape[1]] @ own.T
    onto = np.kron(np.eye(t), SHAPE)
    return np.asarray(onto @ whole @ onto.T)


def _differentiate(step: Affine | Thermal, temperatures_C: Array, matrices: list[Array]) -> Array:
    """Nine entries of the matrix and the error e of a step at each temperature by its parameters
    of bias and matrix, (12 t, parameters)."""
    basis, powers = model_basis("full", step.gauge), np.ones((len(matrices), 1))
    if isinstance(step, Thermal):
        x = polynomial.scale(temperatures_C, step.centre_C, step.half_range_C)
        powers = polynomial.powers(x, step.degree)
    rows = []
    for w, power in zip(matrices, powers, strict=True):
        entries = np.kron(np.eye(3), np.linalg.inv(w).T) @ basis[3:]
        rows.append(np.kron(np.vstack([entries, w @ basis[:3]]), power))
    return np.vstack(rows)


_ENTRIES = np.eye(9).reshape(9, 3, 3)
SHAPE = block_diag(
    np.vstack(
        [
            pack_symmetric((_ENTRIES + _ENTRIES.swapaxes(1, 2)) / 2).T,
            skew(np.eye(3)).reshape(3, 9) / 2,
        ]
    ),
    np.eye(3),
)
"""From nine entries and e to xx yy zz xy xz yz of the symmetric part, the turn, and e, (12, 12)."""
