"""A sensor that was not the same at all stations: an odd station, a step, a bias that settles.

Every kind of fault adds columns G to the Jacobian J of the residuals z, and numbers b to what is
unknown. With C the covariance of the fit, nothing is fitted again:

    z + J δ + G b,   M = 1 − J C Jᵀ,   b = −(GᵀMG)⁻¹ GᵀM z,   δ = −C JᵀG b,   q = bᵀ(GᵀMG) b

q is Rao's (1948) score statistic, χ² where there is no fault; how many faults were looked for
counts. δ is what the coefficients would change by if the fault were in the model: by so much they
may be wrong.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.thermal.maths.estimate import IMPLAUSIBLE, StationEstimate
from agonic.thermal.maths.fault_candidates import (
    AGEING,
    SETTLING,
    STEP,
    Candidate,
    list_candidates,
    list_moments,
)
from agonic.thermal.maths.fault_scores import (
    LinearisedFit,
    linearise,
    make_columns,
    score_faults,
    with_offsets,
)
from agonic.thermal.maths.gaussian_process import GaussianProcess
from agonic.thermal.maths.station_residuals import StationProblem

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
