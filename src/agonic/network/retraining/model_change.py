"""What is running, moved on by an affine step: as far as a window says, and no further.

    field' = field + P [field/F, 1],   P = [P_m, p] (3, 4) nT

with a prior on P about zero, so that what the window does not show stays as it was. Of an
affine base, matrix and bias become

    W' = (I + P_m/F) W,   b' = b − W'⁻¹ p

and of a thermal one so do the matrices of all powers, and the bias of the power 0 by W' at the
window's mean temperature: the shape over temperature is kept. A network without a base has nothing
to take the step: far from a few readings its weights say anything, and only training them tells.

What magnitudes of an orbit say of the matrix is less than the errors of the reference: taught by
them, P_m is zero and the bias alone moves, as in `fit_inflight`.
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
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import FREE, model_basis
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise, robust_scale
from agonic.network.maths.robust import solve_with_noise

_CONSTANTS = [3, 7, 11]
"""The places of p in P, row by row."""


def can_move(running: Running) -> bool:
    """Whether there is a plain affine or a thermal calibration to take the step, alone or under a
    network; a base that depends on sources is kept as it is."""
    return type(running.base if isinstance(running, Network) else running) in (Affine, Thermal)


@overload
def move(running: Affine, window: Window, *, bias_sd: float, matrix_sd: float) -> Affine: ...
@overload
def move(running: Thermal, window: Window, *, bias_sd: float, matrix_sd: float) -> Thermal: ...
@overload
def move(running: Network, window: Window, *, bias_sd: float, matrix_sd: float) -> Network: ...


def move(running: Running, window: Window, *, bias_sd: float, matrix_sd: float) -> Running:
    """What is running with the affine step that the window calls for; of an affine base also the
    covariance.

    Parameters
    ----------
    running : something `can_move`. window : readings with the known field (k, 3) or magnitude
        (k, 1). bias_sd, matrix_sd : prior standard deviations of the step, as shares of the field.
    """
    columns = {name: window.columns[name] for name in running.needs}
    if isinstance(running, Network):
        field, _ = running.evaluated(window.raw, columns)
    else:
        field = running.correct(window.raw, **columns)
    strength = float(np.sqrt(np.mean((field**2).sum(axis=1))))
    x = np.column_stack([field / strength, np.ones(len(field))])
    vector = window.wanted.shape[1] == 3
    basis = np.eye(12) if vector else np.eye(12)[:, _CONSTANTS]
    pieces = _pieces(field, x, window.wanted, basis)
    solution, noise = _solve(pieces, basis, strength, bias_sd, matrix_sd)
    base = running.base if isinstance(running, Network) else running
    params, covariance = basis @ solution.params, basis @ solution.covariance @ basis.T
    if isinstance(base, Thermal):
        middle = base.at(float(np.mean(window.columns["temperature"])))
        moved = _compose(middle, params, covariance, strength, noise.sd)
        base = _move_thermal(base, middle, moved)
    else:
        assert isinstance(base, Affine)
        base = _compose(base, params, covariance, strength, noise.sd)
    return replace(running, base=base) if isinstance(running, Network) else base


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
    scale = max(robust_scale(first), 1e-6)
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


def _move_thermal(base: Thermal, before: Affine, after: Affine) -> Thermal:
    """A thermal calibration moved as it was found to be at one temperature.

    Its own covariance stays, the matrix free of symmetry now, and the step's is that of power 0.
    """
    gain = after.matrix @ np.linalg.inv(before.matrix)
    bias = np.array(base.bias)
    bias[0] += after.bias - before.bias
    return replace(
        base,
        bias=bias,
        matrix=gain @ base.matrix,
        gauge=FREE,
        covariance=_widen(base, after.covariance),
        noise=after.noise,
    )


def _widen(base: Thermal, step: Array | None) -> Array | None:
    """The covariance of a thermal calibration in the gauge free, with that of a step (12, 12)."""
    if base.covariance is None or step is None:
        return None
    powers, rates = base.degree + 1, 0 if base.rate is None else 3
    onto = np.linalg.pinv(model_basis("full", FREE)) @ model_basis("full", base.gauge)
    wide = np.kron(onto, np.eye(powers))
    whole = np.zeros((len(wide) + rates, wide.shape[1] + rates))
    whole[: len(wide), : wide.shape[1]] = wide
    whole[len(wide) :, wide.shape[1] :] = np.eye(rates)
    covariance = whole @ base.covariance @ whole.T
    at = powers * np.arange(len(step))
    covariance[np.ix_(at, at)] += step
    return np.asarray(covariance)
