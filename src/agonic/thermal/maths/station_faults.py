"""A sensor that was not the same at all stations: an odd station, a step, a bias that settles.

Every kind of fault adds columns G to the Jacobian J of the residuals z, and numbers b to what is
unknown. With C the covariance of the fit, nothing is fitted again:

    z + J δ + G b,   M = 1 − J C Jᵀ,   b = −(GᵀMG)⁻¹ GᵀM z,   δ = −C JᵀG b,   q = bᵀ(GᵀMG) b

q is Rao's (1948) score statistic, χ² where there is no fault; how many faults were looked for
counts. δ is what the coefficients would change by if the fault were in the model: by so much they
may be wrong.

Twelve magnitudes less nine numbers leave three: a field, or a gain, that is another from one
station on looks in most of its parts like another calibration, and hardly shows. What little shows
tells how much did not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.thermal.maths.estimate import IMPLAUSIBLE, StationEstimate
from agonic.thermal.maths.fault_scores import (
    AGEING,
    SETTLING,
    STEP,
    Candidate,
    LinearisedFit,
    change_fields,
    linearise,
    list_candidates,
    list_moments,
    make_columns,
    score_faults,
    with_offsets,
)
from agonic.thermal.maths.gaussian_process import STEADY, GaussianProcess
from agonic.thermal.maths.station_residuals import StationProblem, make_whitener

PLAUSIBLE = 0.003
"""Of the field: what it may change by from one hour to another in a building, if nobody watches."""
_BOUND = float((3.0 / chdtri(3, 0.95)) ** 0.5)
"""A standard deviation that three numbers tell is below 2.9 times theirs with 95 %."""


def measure_shown_change(estimate: StationEstimate) -> float:
    """By how much of itself the field, or the gain, seems to change between stations, where the
    magnitude alone is known: what showed is another constant at each, for steps look like it.
    """
    slow = estimate.slow
    return _BOUND * slow.sd if estimate.poses is None and slow.kind == STEADY else 0.0


def allow_for_unseen_changes(
    problem: StationProblem, estimate: StationEstimate, time: Array, sds: Sequence[float]
) -> list[Array]:
    """What joins the covariance (a, a) of the coefficients, where the field takes a random step of
    each of `sds` (over the field) from each station to the next; `time` (m,) of the means, s.

        ΔC = (Jᵀ V⁻¹ J + P)⁻¹ − (JᵀJ + P)⁻¹,   V = 1 + σ² S Sᵀ

    with the whitened Jacobian J, the prior P, and what each step does to the residuals, S. Parts of
    a step that would show count no more than the noise lets them.
    """
    a = problem.layout.shape[1]
    if problem.turns_known or problem.stations < 2:
        return [np.zeros((a, a)) for _ in sds]
    fit = linearise(problem, estimate, time, ())
    later = _rank_stations(problem, time)[:, None] >= np.arange(1, problem.stations)
    steps = change_fields(fit, later)
    whiten = make_whitener(problem, fit.state._replace(slow=fit.slow))
    rows, (_, by) = whiten(np.hstack([fit.jacobian, steps])), fit.prior
    known, told, steady = by.T @ by, rows.T @ rows, np.eye(problem.stations - 1)
    n = len(known)
    at_rest = leastsq.inverse(told[:n, :n] + known)[:a, :a]
    return [
        leastsq.inverse(told + block_diag(known, steady / sd**2))[:a, :a] - at_rest
        if sd > 0.0
        else np.zeros((a, a))
        for sd in sds
    ]


def _rank_stations(problem: StationProblem, time: Array) -> Array:
    """Of each mean (m,) how many stations were recorded before; in their order without a clock."""
    if not np.isfinite(time).all():
        return np.asarray(problem.station)
    first = [float(time[problem.station == k].min()) for k in range(problem.stations)]
    return np.asarray(np.argsort(np.argsort(first))[problem.station])


CHANCE = 0.002
"""Faults are believed that chance would make this seldom in a campaign without any."""
_MOST = 4
_NOTHING = 0.1


class Fault(NamedTuple):
    """What was found, with its normalised size: (3,) of the bias, (1,) of the temperature."""

    candidate: Candidate
    size: Array
    p_value: float


class Faults(NamedTuple):
    """All that were found, and the second moments (a, a) of what they moved the coefficients by.

    `left_out` are stations that fit so badly that the robust loss had left nothing of them.
    """

    found: tuple[Fault, ...]
    covariance: Array
    left_out: tuple[int, ...] = ()


def find_faults(problem: StationProblem, estimate: StationEstimate, time: Array) -> Faults:
    """What was not the same at all stations, most likely first; `time` (m,) of the means, s."""
    left_out = find_left_out(problem, estimate)
    candidates = [
        one
        for one in list_candidates(problem, time)
        if one.kind in (STEP, SETTLING, AGEING) or one.station not in left_out
    ]
    plain = fit = linearise(problem, estimate, time, left_out)
    found: list[_Next] = []
    while candidates and len(found) < _MOST:
        most_likely = _find_next(fit, candidates, time)
        if most_likely.p_value > CHANCE:
            break
        found.append(most_likely)
        fit = most_likely.fit
    return _assemble(plain, fit, found)._replace(left_out=left_out)


def find_left_out(problem: StationProblem, estimate: StationEstimate) -> tuple[int, ...]:
    """Stations of which the robust loss left next to nothing."""
    weights = (np.median(estimate.weights[problem.station == k]) for k in range(problem.stations))
    return tuple(k for k, weight in enumerate(weights) if weight < _NOTHING)


class _Next(NamedTuple):
    """How likely chance makes such a fault, what it is, combinations of its columns, and the fit
    with these.
    """

    p_value: float
    candidate: Candidate
    seen: Array
    fit: LinearisedFit


def _find_next(fit: LinearisedFit, candidates: list[Candidate], time: Array) -> _Next:
    """The most likely fault.

    What is a fault may have been taken for slow changes of the field: those are estimated again
    beside the best candidates with them and without.
    """
    tested = with_offsets(fit)
    plain, tried = tested._replace(slow=GaussianProcess()), []
    likely = {_find_best(each, candidates) for each in (tested, plain)}
    for k in likely:
        many, best = len(candidates), candidates[k]
        if best.kind == STEP:
            moments = list(list_moments(fit.problem, best, time))
            many, best = many + len(moments), moments[_find_best(plain, moments)]
        columns = make_columns(fit, best)
        scores, (own,) = score_faults(plain, [columns])
        slow = tested.with_fault(columns @ scores.find_seen(own)).slow
        scores, _ = score_faults(tested._replace(slow=slow), [columns])
        seen = scores.find_seen(own, sized=True)
        p_value = scores.test(own) * many if slow.sd < IMPLAUSIBLE else np.inf
        wider = fit._replace(slow=slow, beside=np.hstack([fit.beside, columns @ seen]))
        tried.append(_Next(p_value, best, seen, wider))
    return min(tried, key=lambda each: each.p_value)


def _find_best(fit: LinearisedFit, candidates: list[Candidate]) -> int:
    """The place of the candidate with the smallest p-value by the noise alone."""
    scores, parts = score_faults(fit, [make_columns(fit, each) for each in candidates])
    found = [scores.measure(part) for part in parts]
    return int(np.argmax([q - 2.0 * k for q, k in found]))


def _assemble(plain: LinearisedFit, fit: LinearisedFit, found: list[_Next]) -> Faults:
    """Faults with their sizes, and what they did to the coefficients.

    A sensor is on either side of a step, or at the end of its ageing, half of it from the middle.
    """
    a, p = plain.problem.layout.shape[1], plain.problem.degree + 1
    if not found:
        return Faults((), np.zeros((a, a)))
    (step, _), (before, _) = fit.solve(), plain.solve()
    moved = step[:a] - before[:a]
    covariance = np.outer(moved, moved)
    widths = np.cumsum([one.seen.shape[1] for one in found])[:-1]
    made = []
    for one, size in zip(found, np.split(step[len(before) :], widths), strict=True):
        made.append(Fault(one.candidate, one.seen @ size, one.p_value))
        if one.candidate.kind in (STEP, AGEING):
            half = np.zeros(a)
            half[[0, p, 2 * p]] = made[-1].size / 2
            covariance += np.outer(half, half)
    return Faults(tuple(made), covariance)
