"""`BlockSums`: normal equations of blocks of time, from which each is foretold by the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.problem import find_terms, normalise
from agonic.attitude.settings import Settings
from agonic.attitude.solve import estimate_beside
from agonic.maths.equation.affine import FREE, SYMMETRIC, expand_covariates
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.one_pass import median
from agonic.reference import Reference
from agonic.samples import Samples

BLOCKS = 8
HUBER = 1.345
NORMAL_MEDIAN = 0.6745
MOST_ROWS = 20_000
_ROUNDS = 4


class Log(NamedTuple):
    """A recording, what is known of its field, and how it is fitted; the rows that are `usable`.

    `estimates` keeps the fit with each set of sources, for many candidates are tried beside it.
    """

    samples: Samples
    reference: Reference
    channels: tuple[str, ...]
    settings: Settings
    usable: Mask
    estimates: dict[tuple[str, ...], Estimate]


class BlockSums(NamedTuple):
    """Normal equations of each block of time: information (B, p, p), scores (B, p), squares (B,).

    `prior` (p, p); `of` names the set of sources that each parameter belongs to, () for those of
    the fit itself.
    """

    information: Array
    scores: Array
    squares: Array
    prior: Array
    of: tuple[tuple[str, ...], ...]

    def measure(self, sets: Sequence[tuple[str, ...]]) -> Array:
        """What is left in each block, (B,), by the fits of the others with sets of sources."""
        keep = np.array([not own or own in sets for own in self.of])
        information, scores = self.information[:, keep][:, :, keep], self.scores[:, keep]
        others = 1.0 - np.eye(len(scores))
        whole = np.tensordot(others, information, 1) + self.prior[np.ix_(keep, keep)]
        step = (inverse(whole) @ (others @ scores)[..., None])[..., 0]
        foretold = np.einsum("bp,bpq,bq->b", step, information, step)
        return np.asarray(self.squares - 2 * (step * scores).sum(axis=1) + foretold)


def sum_blocks(
    log: Log, chosen: tuple[str, ...], candidates: Sequence[tuple[str, ...]]
) -> BlockSums:
    """The normal equations of a fit with the chosen sources, and of what candidates would add."""
    samples, reference, channels, settings, usable, estimates = log
    gauge: str = settings.gauge
    if gauge == "auto":
        gauge = SYMMETRIC if "dip" not in channels else FREE
    own = replace(settings, sources=chosen)
    problem, _ = normalise(samples, reference, channels, gauge, own)
    estimates[chosen] = estimate_beside(estimates, problem, usable, own)
    rows = np.flatnonzero(usable)
    rows = rows[:: -(-len(rows) // MOST_ROWS)]
    x = np.hstack([find_terms(samples, one)[rows] for one in candidates])
    terms = (x - x.mean(axis=0)) / np.maximum(x.std(axis=0), 1e-300)
    of = tuple(one for one in candidates for _ in one)
    return _add_up(problem.subset(rows), estimates[chosen], terms, of)


def _add_up(
    part: Problem, found: Estimate, terms: Array, of: tuple[tuple[str, ...], ...]
) -> BlockSums:
    """The sums of the blocks of the rows of a problem, with terms (n, k) that it does not have."""
    params, own = found.solution.params, len(found.solution.params)
    n, sides = len(part.points), []
    for channel in part.channels:
        given = zip(*pieces(part, channel)(params), strict=True)
        r, jacobian = (np.concatenate(side) for side in given)
        added = expand_covariates(jacobian[:, :3], terms)
        sides.append((r, np.hstack([jacobian, added])))
    sides = _weigh(sides)
    block = np.arange(n) * BLOCKS // n
    size = own + 3 * terms.shape[1]
    information, scores = np.zeros((BLOCKS, size, size)), np.zeros((BLOCKS, size))
    squares = np.zeros(BLOCKS)
    for r, jacobian in sides:
        for b in range(BLOCKS):
            here, by = r[block == b], jacobian[block == b]
            information[b] += by.T @ by
            scores[b] -= by.T @ here
            squares[b] += here @ here
    prior = np.zeros((size, size))
    held = part.prior(part.soft_iron_sd)
    if held is not None:
        _, by = held(params)
        prior[:own, :own] = by.T @ by
    prior[np.arange(own, size), np.arange(own, size)] += 1e-9 * n
    return BlockSums(information, scores, squares, prior, ((),) * own + of * 3)


def _weigh(sides: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Residuals and Jacobians over the noise, each row at its weight, by Huber's loss.

    The weights are those of a fit with everything in it, for what a disturber does stands out of a
    fit without it like an outlier. Of each channel the noise is that which the others leave it.
    """
    sizes = [_spread(r) for r, _ in sides]
    weights = [np.ones(len(r)) for r, _ in sides]
    for _ in range(_ROUNDS):
        scaled = [
            (r * np.sqrt(w) / sd, j * (np.sqrt(w) / sd)[:, None])
            for (r, j), w, sd in zip(sides, weights, sizes, strict=True)
        ]
        information = sum((j.T @ j for _, j in scaled), np.zeros(()))
        step = inverse(np.asarray(information)) @ sum((j.T @ r for r, j in scaled), np.zeros(()))
        left = [r - j @ step for r, j in sides]
        sizes = [_spread(one) for one in left]
        weights = [
            np.minimum(1.0, HUBER * sd / np.maximum(np.abs(one), 1e-300))
            for one, sd in zip(left, sizes, strict=True)
        ]
    return scaled


def _spread(residuals: Array) -> float:
    """The standard deviation by the median of the sizes."""
    return max(median(np.abs(residuals)) / NORMAL_MEDIAN, 1e-12)
