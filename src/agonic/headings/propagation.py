"""How the errors of a calibration and the noise of its sensor reach one component of the field.

For a row g of ∂heading/∂field, var = g C gᵀ without ever forming the (n, 3, 3) covariances: the
gradient is carried back through the steps of the calibration, and each step adds |Lᵀ a|², where
a = g ∂field/∂parameters and L Lᵀ is the covariance of its parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.interference import Interference
from agonic.calibration.sources import stack_inputs
from agonic.calibration.steps import steps_of
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.maths.equation import polynomial, temperature_model
from agonic.maths.equation.affine import expand_covariates, model_basis


class Step(NamedTuple):
    """A calibration and L (p, k), the root of its covariance; `None` where it has none."""

    calibration: Affine | Thermal | Alignment
    root: Array | None


def list_steps(calibration: Calibration) -> tuple[Step, ...]:
    """The steps of a calibration, each with the root of its covariance."""
    steps = []
    for step in steps_of(calibration):
        if not isinstance(step, Affine | Thermal | Alignment):
            raise AgonicError(
                f"a {step.kind} calibration cannot be used for a compass yet; give an affine, an "
                "interference, one over temperature, an alignment or a chain of them"
            )
        steps.append(Step(step, _root(step)))
    return tuple(steps)


def _root(step: Affine | Thermal | Alignment) -> Array | None:
    """L with L Lᵀ the covariance of what the rows multiply: local numbers, or the turn."""
    known = step.covariance
    if known is None:
        return None
    covariance = np.asarray(known)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.where(sd > 0, sd, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    if isinstance(step, Alignment):
        return np.asarray(root)
    if isinstance(step, Thermal):
        onto = temperature_model.build_layout(step.degree, step.gauge, step.rate is not None)
        return np.asarray(onto @ root)
    local = model_basis("full", step.gauge)
    spread = np.zeros((len(local) + len(root) - local.shape[1], len(root)))
    spread[: len(local), : local.shape[1]] = local
    spread[len(local) :, local.shape[1] :] = np.eye(len(root) - local.shape[1])
    return np.asarray(spread @ root)


def apply_steps(steps: tuple[Step, ...], raw: Array, columns: Mapping[str, Array]) -> list[Array]:
    """The readings (n, 3), what each step makes of them, and at last the field."""
    values = [raw]
    for step in steps:
        values.append(step.calibration.correct(values[-1], **columns))
    return values


def propagate(
    steps: tuple[Step, ...], values: list[Array], columns: Mapping[str, Array], gradient: Array
) -> tuple[Array, Array, Array]:
    """Variance of gradient · field (n,) from the calibration, and from the noise of one reading;
    and the gradient by the reading itself, (3, n).

    `values` as `apply_steps` gives them, gradient (3, n).
    """
    systematic = np.zeros(gradient.shape[1])
    found, by_reading = propagate_parts(steps, values, columns, gradient)
    for parts in found:
        systematic += np.einsum("ij,ij->j", parts, parts)
    known = [step.calibration for step in steps if isinstance(step.calibration, Affine | Thermal)]
    noise = known[0].noise if known else None  # that of the first step, which takes the reading
    variance = (noise or 0.0) ** 2 * np.einsum("ij,ij->j", by_reading, by_reading)
    return systematic, variance, by_reading


def propagate_parts(
    steps: tuple[Step, ...], values: list[Array], columns: Mapping[str, Array], gradient: Array
) -> tuple[list[Array], Array]:
    """What errors of the calibration, each of variance one, add to gradient · field, (k, n) of each
    step that has a covariance, and the gradient by the reading, (3, n); as `propagate`."""
    found = []
    for step, given, made in zip(reversed(steps), values[-2::-1], values[:0:-1], strict=True):
        calibration, root = step
        if isinstance(calibration, Thermal):  # Mᵀ g, with M what the step multiplies by
            matrix = calibration.matrix_at(columns["temperature"])
            before = np.einsum("nji,jn->in", matrix, gradient)
        elif isinstance(calibration, Alignment):
            before = calibration.rotation.as_matrix().T @ gradient
        else:
            before = calibration.matrix.T @ gradient
        if root is not None:
            if isinstance(calibration, Alignment):
                row = np.cross(made.T, gradient, axis=0)  # ∂(g · R f)/∂(rotation vector) = R f × g
            elif isinstance(calibration, Thermal):
                row = _thermal_row(calibration, given, columns, gradient, before)
            else:
                row = _affine_row(calibration, given, columns, gradient, before)
            found.append(root.T @ row)
        gradient = before
    return found, gradient


def _thermal_row(
    step: Thermal, given: Array, columns: Mapping[str, Array], gradient: Array, before: Array
) -> Array:
    """(−Wᵀg, g ⊗ (raw − bias)) ⊗ φ, φ the powers of the temperature and its rate, (12 q, n)."""
    x = polynomial.scale(columns["temperature"], step.centre_C, step.half_range_C)
    bias, rate = step.bias_at(columns["temperature"]), None
    if step.rate is not None:
        rate = columns["temperature_rate"]
        bias = bias + rate[:, None] * step.rate
    reach = (given - bias).T
    local = np.concatenate([-before, (gradient[:, None] * reach[None]).reshape(9, -1)])
    phi = temperature_model.build_covariates(x, 0.0, step.degree, rate)
    return np.asarray(expand_covariates(local.T, phi).T)


def _affine_row(
    step: Affine, given: Array, columns: Mapping[str, Array], gradient: Array, before: Array
) -> Array:
    """∂(g · W (raw − bias − K x))/∂(bias, W, K) = (−Wᵀg, g ⊗ (raw − bias − K x), −Wᵀg ⊗ x)."""
    reach = given.T - step.bias[:, None]
    blocks = [-before]
    if isinstance(step, Interference):
        x = stack_inputs(step.sources, None, columns).T
        reach = reach - step.coefficients @ x
    blocks.append((gradient[:, None] * reach[None]).reshape(9, -1))
    if isinstance(step, Interference):
        blocks.append(-(before[:, None] * x[None]).reshape(3 * len(x), -1))
    return np.concatenate(blocks)


def list_unknowns(steps: tuple[Step, ...], sensor: str) -> tuple[str, ...]:
    """What the standard error of a heading has to leave out, in sentences."""
    affine = [step for step in steps if isinstance(step.calibration, Affine | Thermal)]
    notes = []
    if any(step.root is None for step in affine):
        notes.append(f"the calibration of {sensor} has no covariance: its errors are not in the sd")
    if affine and affine[0].calibration.noise is None:  # type: ignore[union-attr]
        notes.append(f"the noise of {sensor} is not known and not in the sd")
    return tuple(notes)
