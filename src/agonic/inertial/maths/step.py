"""One step of Gauss and Newton on parameters and attitudes, the attitudes eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal, invert, solve
from agonic.maths.rotations.track import Sums

_FAR = 0.05  # rad: the square of a turn is no longer small
_FARTHEST = 1e3  # of the size of a parameter
_LOOSE = 1e-6  # what is known of a state beforehand, over 1/rad²


class Step(NamedTuple):
    """A step of parameters and states, with what of them stays open."""

    params: Array
    states: Array
    covariance: Array
    information: Array
    spread: Tridiagonal
    scores: Array
    by_params: Array

    @property
    def sds(self) -> Array:
        """Standard errors of the parameters."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def solve_step(
    groups: Sequence[Sums], variances: Array, prior: leastsq.Prior, params: Array
) -> Step:
    """One step of Gauss and Newton, the states eliminated.

    Raises `LinAlgError` where it leads out of all calibrations.
    """
    first, *others = (g.scale(1.0 / v) for g, v in zip(groups, variances, strict=True))
    total = first
    for group in others:
        total = total.add(group)
    states = Tridiagonal(total.states.diagonal + _LOOSE * np.eye(3), total.states.below)
    gradient = total.gradient
    found = solve(states, np.concatenate([total.mixed, gradient[:, :, None]], axis=2))
    by_params, alone = -found[:, :, :-1], -found[:, :, -1]
    residuals, jacobian = prior(params)
    information = total.params + np.tensordot(total.mixed, by_params, axes=([0, 1], [0, 1]))
    pull = total.own.sum(axis=0) + np.einsum("nip,ni->p", total.mixed, alone)
    covariance = leastsq.inverse(information + jacobian.T @ jacobian)
    step = -covariance @ (pull + jacobian.T @ residuals)
    if not np.abs(step).max() < _FARTHEST:
        raise np.linalg.LinAlgError("the steps leave every possible calibration")
    before = np.einsum("nip,ni->np", by_params, total.before)
    after = np.einsum("nip,ni->np", np.roll(by_params, -1, axis=0), total.after)
    scores = total.own + before + after
    move = alone + by_params @ step
    return Step(step, move, covariance, information, invert(states), scores, by_params)


def reduce_to_params(group: Sums, by_params: Array) -> Array:
    """What a group tells of the parameters where the states follow them, (p, p)."""
    moved = _multiply(group.states, by_params) + group.mixed
    along = np.tensordot(by_params, moved, axes=([0, 1], [0, 1]))
    return np.asarray(
        along + np.tensordot(group.mixed, by_params, axes=([0, 1], [0, 1])) + group.params
    )


def predict_cost(group: Sums, step: Step) -> float:
    """Σ w r² of a group after a step, to second order; before it where it turns too far."""
    move, by = step.states, step.params
    if np.abs(move).max() > _FAR:
        return group.cost
    along = 2 * group.gradient + _multiply(group.states, move[:, :, None])[:, :, 0]
    along = along + 2 * group.mixed @ by
    own = (2 * group.own.sum(axis=0) + group.params @ by) @ by
    return float(group.cost + np.sum(move * along) + own)


def _multiply(matrix: Tridiagonal, right: Array) -> Array:
    """H right of right sides (N, b, c)."""
    found = matrix.diagonal @ right
    found[1:] += matrix.below @ right[:-1]
    found[:-1] += np.swapaxes(matrix.below, 1, 2) @ right[1:]
    return np.asarray(found)
