"""What is running, moved on by an affine step: as far as a window says, and no further.

    field' = field + P [field/F, 1],   P = [P_m, p] (3, 4) nT

with a prior on P about zero, so that what the window does not show stays as it was. Of an
affine base, matrix and bias become

    W' = (I + P_m/F) W,   b' = b − W'⁻¹ p

A network without a base has nothing to take the step: far from a few readings its weights say
anything, and only training them tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import overload

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.calibration.retraining import Running, Window
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise import Noise
from agonic.network.maths.robust import solve_with_noise

# entries of P that are one: six symmetric ones and the constants, as a magnitude shows no turn
_SYMMETRIC = ([0], [5], [10], [1, 4], [2, 8], [6, 9], [3], [7], [11])


def can_move(running: Running) -> bool:
    """Whether there is a plain affine to take the step, alone or under a network; a base that
    depends on temperature or sources is kept as it is."""
    return type(running.base if isinstance(running, Network) else running) is Affine


@overload
def move(running: Affine, window: Window, *, bias_sd: float, matrix_sd: float) -> Affine: ...
@overload
def move(running: Network, window: Window, *, bias_sd: float, matrix_sd: float) -> Network: ...


def move(
    running: Affine | Network, window: Window, *, bias_sd: float, matrix_sd: float
) -> Affine | Network:
    """What is running with the affine step that the window calls for; of an affine base also the
    covariance.

    Parameters
    ----------
    running : something `can_move`. window : readings with the known field (k, 3) or magnitude
        (k, 1). bias_sd, matrix_sd : prior standard deviations of the step, as shares of the field.
    """
    if isinstance(running, Network):
        columns = {name: window.columns[name] for name in running.needs}
        field, _ = running.evaluated(window.raw, columns)
    else:
        field = running.correct(window.raw)
    strength = float(np.sqrt(np.mean((field**2).sum(axis=1))))
    x = np.column_stack([field / strength, np.ones(len(field))])
    vector = window.wanted.shape[1] == 3
    basis = np.eye(12) if vector else _symmetric_basis()
    pieces = _pieces(field, x, window.wanted, basis)
    solution, noise = _solve(pieces, basis, strength, bias_sd, matrix_sd)
    base = running.base if isinstance(running, Network) else running
    assert isinstance(base, Affine)
    covariance = basis @ solution.covariance @ basis.T
    base = _compose(base, basis @ solution.params, covariance, strength, noise.sd)
    return replace(running, base=base) if isinstance(running, Network) else base


def _symmetric_basis() -> Array:
    basis = np.zeros((12, 9))
    for column, rows in enumerate(_SYMMETRIC):
        basis[rows, column] = 1.0
    return basis


def _pieces(u: Array, x: Array, wanted: Array, basis: Array) -> leastsq.Pieces:
    """Residuals of an axis after the other, or of the magnitude, with their Jacobian."""

    def of_vectors(params: Array) -> Iterator[tuple[Array, Array]]:
        field = u + x @ (basis @ params).reshape(3, 4).T
        for axis in range(3):
            jacobian = np.zeros((len(u), 12))
            jacobian[:, 4 * axis : 4 * axis + 4] = x
            yield field[:, axis] - wanted[:, axis], jacobian @ basis

    def of_magnitudes(params: Array) -> Iterator[tuple[Array, Array]]:
        field = u + x @ (basis @ params).reshape(3, 4).T
        length = np.linalg.norm(field, axis=1)
        along = field / length[:, None]
        jacobian = (along[:, :, None] * x[:, None, :]).reshape(len(u), 12)
        yield length - wanted[:, 0], jacobian @ basis

    return of_vectors if wanted.shape[1] == 3 else of_magnitudes


def _solve(
    pieces: leastsq.Pieces, basis: Array, strength: float, bias_sd: float, matrix_sd: float
) -> tuple[leastsq.Solution, Noise]:
    """The step, and the noise of a residual."""
    sds = basis.T @ np.tile(strength * np.array([*[matrix_sd] * 3, bias_sd]), 3)
    sds /= basis.sum(axis=0)
    zero = np.zeros(len(sds))

    def prior(params: Array) -> tuple[Array, Array]:
        return params / sds, np.diag(1 / sds)

    first = np.concatenate([residual for residual, _ in pieces(zero)])
    scale = max(leastsq.robust_scale(first), 1e-6)
    return solve_with_noise(pieces, zero, scale=scale, prior=prior)


def _compose(
    base: Affine, params: Array, covariance: Array, strength: float, noise: float
) -> Affine:
    """Bias and matrix after the move; with dP: dW' = dP_m W/F, db' = W'⁻¹ (dW' W'⁻¹ p − dp)."""
    rows = params.reshape(3, 4)
    matrix = (np.eye(3) + rows[:, :3] / strength) @ base.matrix
    back = np.linalg.inv(matrix)
    shift = back @ rows[:, 3]
    local = np.zeros((12, 12))
    for axis in range(3):
        for k in range(3):
            step = np.outer(np.eye(3)[axis], base.matrix[k]) / strength
            local[3:, 4 * axis + k] = step.ravel()
            local[:3, 4 * axis + k] = back @ (step @ shift)
        local[:3, 4 * axis + 3] = -back[:, axis]
    reduced = np.linalg.pinv(model_basis("full", FREE)) @ local
    gain = float(np.cbrt(abs(np.linalg.det(matrix))))
    return replace(
        base,
        bias=base.bias - shift,
        matrix=matrix,
        gauge=FREE,
        model="full",
        covariance=reduced @ covariance @ reduced.T,
        noise=noise / gain,
    )
