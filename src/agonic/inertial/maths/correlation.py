"""A step of the joint estimate, and its covariance where what is left of readings lasts in time.

A step is one of Gauss and Newton on parameters and attitudes, the attitudes eliminated.

The attitudes follow the parameters by X = ∂x/∂θ, so a reading depends on these by J + J_x X. Errors
that last in the axes of the sensor scatter the gradient as products of residuals show them
(`noise_with_memory`): a bias takes up all of them, a matrix only what turns with the field. Seen
are residuals along the field alone, for those across it the free attitude takes up. Where these
show nothing, sums of all scores over longer times tell by how much the whole scatters more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.inertial.maths.factors import Felt, choose_free, compare_readings
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import TOLD
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal, invert
from agonic.maths.estimation.filters.smoother import Sums, eliminate
from agonic.maths.estimation.noise.batch_means import measure_correlation
from agonic.maths.estimation.noise.noise_with_memory import (
    STRETCHES,
    Stretches,
    find_memory,
    sum_scatter,
)

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
    total = total._replace(diagonal=total.diagonal + _LOOSE * np.eye(3))
    by_params, alone, information, pull, *_ = eliminate(total)
    residuals, jacobian = prior(params)
    covariance = leastsq.inverse(information + jacobian.T @ jacobian)
    step = -covariance @ (pull + jacobian.T @ residuals)
    if not np.abs(step).max() < _FARTHEST:
        raise np.linalg.LinAlgError("the steps leave every possible calibration")
    before = np.einsum("nip,ni->np", by_params, total.before)
    after = np.einsum("nip,ni->np", np.roll(by_params, -1, axis=0), total.after)
    scores = total.own + before + after
    move = alone + by_params @ step
    return Step(step, move, covariance, information, invert(total.states), scores, by_params)


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


_BLOCK = 4096


def allow_for_correlation(
    problem: Problem,
    felt: Felt,
    attitudes: Array,
    params: Array,
    weights: Array,
    readings: Sums,
    variance: float,
    step: Step,
    prior: Array,
) -> Array:
    """The covariance where residuals go together in time: the larger of two views of it."""
    known, before = prior.T @ prior, step.covariance
    length = find_length(step.scores, step.information)
    alike = leastsq.inverse(step.information / length + known)
    lasting = find_lasting_errors(
        problem, felt, attitudes, params, weights, np.sqrt(variance), step.by_params, before
    )
    if lasting is None:
        return alike
    white, added = lasting
    own = reduce_to_params(readings, step.by_params) / variance
    apart = before @ (step.information + (white - 1.0) * own + known) @ before + added
    precision = step.information + known
    return max(alike, apart, key=lambda found: float(np.sum(found * precision)))


def find_length(scores: Array, information: Array) -> float:
    """By how much sums of scores (k, p) over longer times scatter more than white noise would."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, axes = np.linalg.eigh(information / np.outer(size, size))
    known = values > TOLD * values[-1]
    white = (scores / size) @ (axes[:, known] / np.sqrt(values[known]))
    return measure_correlation(white, np.eye(int(known.sum())))


def find_lasting_errors(
    problem: Problem,
    felt: Felt,
    attitudes: Array,
    params: Array,
    weights: Array,
    noise_sd: float,
    by_params: Array,
    covariance: Array,
) -> tuple[float, Array] | None:
    """The variance of white readings beside errors that last in the axes of the sensor, and what
    these add to the covariance (p, p); `None` where products of residuals show none.

    Parameters: attitudes (n, 3, 3), weights (n,) and noise of the readings; how the states follow
    the parameters (N, 3, p); the covariance (p, p) of the estimate for white noise.
    """
    track, n = felt.track, len(attitudes)
    root = np.linalg.cholesky(covariance)
    each = -(-n // STRETCHES)
    block = each * max(_BLOCK // each, 1)
    along, holds = [], []
    for start in range(0, n, block):
        rows = slice(start, start + block)
        left, by_state, direct = compare_readings(
            problem.subset(rows), attitudes[rows], felt.rate[rows], params, felt
        )
        before, share = track.interval[rows], track.share[rows, None, None]
        after = np.minimum(before + 1, len(by_params) - 1)
        moved = (1.0 - share) * by_params[before] + share * by_params[after]
        whole = ((direct + by_state @ moved) @ root) / noise_sd
        out = choose_free(by_state)
        seen = np.einsum("ni,ni->n", out, left) / noise_sd
        told = np.einsum("ni,nip->np", out, whole)
        along.append(Stretches.of(seen, told, weights[rows], out, each))
        weighted = whole * weights[rows, None, None]
        holds.append(np.add.reduceat(weighted, np.arange(0, len(left), each), axis=0))
    sums = Stretches(*(np.concatenate(of) for of in zip(*along, strict=True)))
    memory = find_memory(sums, np.eye(len(root)), (slice(0, 3),))
    if memory is None:
        return None
    scatter = sum_scatter(np.concatenate(holds), memory.each)
    return memory.white, np.asarray(root @ scatter @ root.T)
