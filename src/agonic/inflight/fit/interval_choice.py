"""How many intervals the bias needs in time, and whether one step would do in their place.

As many as make unseen readings fit better.

Readings are summed up over short stretches of time as cross-products G = [J r]ᵀ[J r] about a fit,
in which a spline with any number of intervals is a bias that is constant over each stretch. So
fits to one half of the blocks, and what they leave of the other, are algebra.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.inflight.fit.prior import TERM_SD, build_prior
from agonic.inflight.fit.terms import DEGREE, evaluate_spline, place_knots
from agonic.inflight.maths.residuals import cut, residual_pieces
from agonic.maths.estimation.leastsq import inverse

if TYPE_CHECKING:
    from agonic.inflight.fit.covariance import Estimate
    from agonic.inflight.fit.problem import Problem

MOST_INTERVALS = 64
CERTAIN = 2.5
"""Standard errors, over the blocks, by which unseen readings must fit better for more knots."""
DOUBT = 1.0
"""Standard errors by which they may fit worse: wide errors are better than a swing missed."""
BLOCKS_AN_INTERVAL = 4
"""Blocks held out are this much shorter than the shortest interval, so that it is seen."""
_STRETCHES_A_BLOCK = 8


class Stretches(NamedTuple):
    """Of each of s stretches: `gram` (s, m + 1, m + 1) of the m parameters beside the spline, the
    bias first, and of the residual without a spline, over the noise; `time` (s,) from 0 to 1, and
    the number of its `block` (s,). `known` (m, m) and `pull` (m,) are the prior's information and
    gradient, `unit` the noise, nT, over the rms of what the gram has as residuals of the fit."""

    gram: Array
    time: Array
    block: Index
    known: Array
    pull: Array
    unit: float


def choose_intervals(
    problem: Problem, fit: Callable[[int], Estimate]
) -> tuple[Estimate, dict[int, float]]:
    """The fit with as many intervals as the bias needs, and the held-out error, nT, by the number
    of intervals tried; `fit` gives that with any number.

    Raises `AgonicError` for a number below zero.
    """
    asked = problem.settings.drift_knots
    if asked != "auto":
        if asked < 0:
            raise AgonicError(f"drift_knots is {asked}; it counts intervals, 0 for a constant bias")
        return fit(asked), {}
    candidates = list_candidates(int(problem.used.sum()))
    best = 0
    for _ in range(3):
        estimate = fit(best)
        found, errors = _compare(candidates, sum_stretches(problem, estimate, candidates[-1]))
        if found == best:
            return estimate, errors
        best = found
    return fit(best), errors


def list_candidates(rows: int) -> list[int]:
    """The numbers of intervals to try."""
    doublings = [1 << k for k in range(MOST_INTERVALS.bit_length())]
    return [0, *(k for k in doublings if rows > 40 * (k + DEGREE))]


def sum_stretches(problem: Problem, estimate: Estimate, intervals: int) -> Stretches:
    """The rows used, in blocks for at most so many intervals, about an estimate with any spline."""
    params, layout, terms = estimate.solution.params, estimate.layout, estimate.terms
    noise = estimate.noise["magnitude"]
    splines = np.zeros(layout.parameters, dtype=bool)
    splines[layout.bias_columns(slice(terms.splines))] = True
    used = np.flatnonzero(problem.used)
    count = max(BLOCKS_AN_INTERVAL * intervals, 10) * _STRETCHES_A_BLOCK
    stretch = used * count // len(problem.used)
    m = int((~splines).sum())
    gram = np.zeros((count, m + 1, m + 1))
    rows = problem.rows(terms).select(problem.used)
    done, square = 0, 0.0
    for r, few, onto in residual_pieces(lambda: cut(rows, layout), "magnitude", layout)(params):
        jacobian = few @ onto
        at = stretch[done : done + len(r)]
        done += len(r)
        weight = noise.loss.weight((r / noise.sd) ** 2)
        without = r - jacobian[:, splines] @ params[splines]
        columns = np.column_stack([jacobian[:, ~splines], without]) / noise.sd
        starts = np.flatnonzero(np.diff(at, prepend=-1))
        for k, part in enumerate(np.split(columns, starts[1:])):
            own = weight[starts[k] :][: len(part)]
            gram[at[starts[k]]] += (part.T * own) @ part
        square += float(weight @ (r / noise.sd) ** 2)
    off, slope = build_prior(problem, terms, layout)(params)
    slope = slope[:, ~splines] * np.sqrt(noise.correlation)
    seconds = problem.time[(np.arange(count) * 2 + 1) * len(problem.used) // (2 * count)]
    return Stretches(
        gram,
        (seconds - terms.start) / (terms.stop - terms.start),
        np.arange(count) // _STRETCHES_A_BLOCK,
        slope.T @ slope,
        slope.T @ off * np.sqrt(noise.correlation),
        noise.sd * problem.magnitude / np.sqrt(max(square, 1e-300)),
    )


def _compare(candidates: list[int], stretches: Stretches) -> tuple[int, dict[int, float]]:
    """The number of intervals, and the held-out error, nT, of each that was tried.

    Until a drift is found each doubling is tried, up to the most that the rows allow, for a swing
    shows only once knots are closer than half of it. A drift is there where unseen readings fit
    better by `CERTAIN` standard errors; then as many intervals as they do not contradict by
    `DOUBT`, for what a stiff spline misses is in no standard error.
    """
    best, left = 0, {0: _squares_unseen(stretches, 0)}
    for k in candidates[1:]:
        left[k] = _squares_unseen(stretches, k)
        if compute_certainty(left[best], left[k]) > (-DOUBT if best else CERTAIN):
            best = k
        elif best:  # more than these would be worse, and still more a matter of chance
            break
    return best, {k: stretches.unit * float(np.sqrt(of.sum())) for k, of in left.items()}


def compute_certainty(before: Array, after: Array) -> float:
    """By how many standard errors squares of residuals of all blocks are smaller than before."""
    gained = before - after
    spread = float(np.std(gained, ddof=1)) * np.sqrt(len(gained))
    return float(gained.sum() / max(spread, 1e-300))


class Step(NamedTuple):
    """When the bias stepped, 0 to 1, and by how much over the field; what is left with the step,
    and with a steady drift in its place, over what the spline leaves."""

    time: float
    size: float
    left: float
    left_by_drift: float


def find_step(stretches: Stretches, intervals: int) -> Step:
    """The step that explains the magnitude best, beside a bias that is constant otherwise: among
    places over the record, and then among all stretches around the best of them."""
    seconds, whole = stretches.time, np.ones(len(stretches.time), dtype=bool)

    def measure(course: Array) -> tuple[float, float]:
        basis = course - course.mean(axis=0)
        moved = _solve(stretches, basis, whole)
        square = np.einsum("si,sij,sj->", moved, stretches.gram, moved, optimize=True)
        return float(np.sqrt(square)), float(np.linalg.norm(moved[-1, :3] - moved[0, :3]))

    def place(after: int) -> tuple[float, float, int]:
        return *measure((seconds >= seconds[after])[:, None] * 1.0), after

    by_spline, _ = measure(evaluate_spline(seconds, place_knots(0.0, 1.0, intervals)))
    by_drift, _ = measure(seconds[:, None])
    # places of a step that are tried first
    last, wide = len(seconds) - 2, max(len(seconds) // 40, 1)
    near = min(place(k) for k in range(wide, last, wide))[2]
    left, size, after = min(place(k) for k in range(max(near - wide, 2), min(near + wide, last)))
    middle = float(seconds[after - 1] + seconds[after]) / 2
    return Step(middle, size, left / by_spline, by_drift / by_spline)


def _squares_unseen(stretches: Stretches, intervals: int) -> Array:
    """Squares of residuals of each block, over the noise, by the fit to the other half."""
    basis = evaluate_spline(stretches.time, place_knots(0.0, 1.0, intervals))
    basis = basis - basis.mean(axis=0)
    left = np.empty(len(basis))
    for half in (stretches.block % 2 == 0, stretches.block % 2 == 1):
        moved = _solve(stretches, basis, ~half)
        left[half] = np.einsum("si,sij,sj->s", moved, stretches.gram, moved, optimize=True)[half]
    return np.asarray(np.bincount(stretches.block, left), dtype=np.float64)


def _solve(stretches: Stretches, basis: Array, seen: Array) -> Array:
    """By how much the parameters of each stretch are moved, and a one for the residual, (s, m + 1),
    by a spline of the bias over a basis (s, q) that is fitted to the stretches `seen`."""
    gram, some = stretches.gram[seen], basis[seen]
    m, q = len(stretches.pull), basis.shape[1]
    whole = gram.sum(axis=0)
    information = np.zeros((m + 3 * q, m + 3 * q))
    information[:m, :m] = whole[:m, :m] + stretches.known
    across = np.einsum("sij,sq->ijq", gram[:, :, :3], some).reshape(m + 1, -1)
    information[:m, m:], information[m:, :m] = across[:m], across[:m].T
    weighted = (gram[:, :3, :3, None] * some[:, None, None]).reshape(len(some), -1)
    own = (some.T @ weighted).reshape(q, 3, 3, q).transpose(1, 0, 2, 3)
    information[m:, m:] = own.reshape(3 * q, 3 * q) + np.eye(3 * q) / TERM_SD**2
    right = np.concatenate([whole[:m, -1] + stretches.pull, across[m]])
    found = -inverse(information) @ right
    moved = np.ones((len(basis), m + 1))
    moved[:, :m] = found[:m]
    moved[:, :3] += basis @ found[m:].reshape(3, q).T
    return moved
