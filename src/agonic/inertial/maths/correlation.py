"""The covariance of the joint estimate where what is left of readings goes together in time.

The attitudes follow the parameters by X = ∂x/∂θ, so a reading depends on these by J + J_x X. Errors
that last in the axes of the sensor scatter the gradient as products of residuals show them
(`noise_with_memory`): a bias takes up all of them, a matrix only what turns with the field. Seen
are residuals along the field alone, for those across it the free attitude takes up. Where these
show nothing, sums of all scores over longer times tell by how much the whole scatters more.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inertial.maths.factors import Felt, choose_free, compare_readings
from agonic.inertial.maths.step import Step, reduce_to_params
from agonic.maths.equation.channels import Problem
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.batch_means import compute_scatter
from agonic.maths.estimation.noise.noise_with_memory import (
    STRETCHES,
    Stretches,
    find_memory,
    sum_scatter,
)
from agonic.maths.rotations.track import Sums

FEWEST = 8
"""Batches that tell a scatter."""
_BLOCK = 4096
_TOLD = 1e-6  # of the information along the best known direction


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
    known = values > _TOLD * values[-1]
    white = (scores / size) @ (axes[:, known] / np.sqrt(values[known]))
    return compute_scatter(white, np.eye(int(known.sum())), fewest=FEWEST).correlation


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
