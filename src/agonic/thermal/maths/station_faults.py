"""What was not the same at all stations, as terms beside a fit: odd stations, steps, settling.

Every fault that a campaign may have is a term of `model.average`: its columns are how the residuals
follow one of size one. Slow changes of the field are terms as well, one for each kind of process.
All share what the estimate left over in one likelihood, and the likeliest are there. The estimate
moves to where it is beside them; the covariance is what the readings tell beside them.

Twelve magnitudes less nine numbers leave three: a field, or a gain, that changes from one station
on looks in most of its components like another calibration. The small part that shows tells the
size of the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from agonic.arrays import Array
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.model.average import EVIDENCE, Base, choose, mix, price, rate, solve
from agonic.model.terms.time import TIME
from agonic.thermal.maths.estimate import AGED, IMPLAUSIBLE, OUTLIER, StationEstimate
from agonic.thermal.maths.fault_terms import (
    AGEING,
    LARGEST,
    OF_ALL,
    STEP,
    WALK,
    Candidate,
    Linear,
    Terms,
    linearise,
    list_candidates,
    list_moments,
    list_terms,
)
from agonic.thermal.maths.gaussian_process import STEADY
from agonic.thermal.maths.station_residuals import StationProblem

_BOUND = float((3.0 / chdtri(3, 0.95)) ** 0.5)
"""A standard deviation that three numbers tell is below 2.9 times theirs with 95 %."""
_PARTS = (16, 8, 4)  # of a station, over which memory is looked for
_ROUNDS = 2  # until a fault is found it is scatter and memory
_NOTHING = 0.1  # weight of a station that the robust loss left out
Way = tuple[float, dict[int, float]]
"""Terms by their sizes, and how likely they are."""


class Fault(NamedTuple):
    """What was found, with its normalised size: (3,) of the bias, (1,) of the temperature."""

    candidate: Candidate
    size: Array


class Faults(NamedTuple):
    """All that were found, the coefficients (a,) beside them, and their covariance (a, a). `unseen`
    (a, a) are what changes of the field that hardly show add to it, `left_out` stations of which
    the robust loss had left nothing."""

    found: tuple[Fault, ...]
    coefficients: Array
    covariance: Array
    unseen: tuple[Array, ...] = ()
    left_out: tuple[int, ...] = ()


def measure_shown_change(estimate: StationEstimate) -> float:
    """By how much of itself the field, or the gain, seems to change between stations, where the
    magnitude alone is known: what showed is another constant at each, for steps look like it.
    """
    slow = estimate.slow
    return _BOUND * slow.sd if estimate.poses is None and slow.kind == STEADY else 0.0


def _bound_outliers(
    fit: Linear, terms: Terms, there: Mapping[int, float], time: Array
) -> tuple[Array, float]:
    """The residuals (n,) with outliers bounded, and the variance of what terms leave of them, by
    means over parts of a station too, which is more where it has memory."""
    offsets = {} if fit.problem.turns_known else {len(terms.groups): IMPLAUSIBLE}
    base = solve(terms.gram, fit.prior, [*terms.groups, terms.changes], {**there, **offsets})
    found = _place(base, len(terms.gram))
    first, slow = terms.changes.columns[-1] + 1, terms.roots.shape[1]
    left = fit.left - terms.dense[:, :-1] @ np.delete(found[:-1], slice(first, first + slow))
    if fit.spaces is not None:
        left = left - fit.spaces.expand(terms.roots @ found[first : first + slow])
    order = np.lexsort((time, fit.problem.station))
    scale = max(robust_scale(left), 1.0)
    bounded = np.clip(left, -OUTLIER * scale, OUTLIER * scale)
    rows = bounded.reshape(-1, len(order))[:, order]
    lengths = {max(len(order) // (fit.problem.stations * parts), 1) for parts in _PARTS}
    sums = [np.add.reduceat(rows, np.arange(0, len(order), each), axis=1) for each in lengths]
    memory = max(float(np.sum(each**2)) / left.size for each in sums)
    return fit.left - left + bounded, max(scale**2, memory)


def find_faults(
    problem: StationProblem,
    estimate: StationEstimate,
    time: Array,
    changes: Sequence[float] = (),
    look: bool = True,
) -> Faults:
    """What was not the same at all stations, and what the coefficients may be off by unseen.

    Parameters: `time` (m,) of the means, s; `changes` standard deviations, over the field, of a
    random step that it takes from each station to the next, allowed for where the magnitude alone
    is known; whether to look for faults.
    """
    left_out = _find_stations_left_out(problem, estimate) if look else ()
    fit = linearise(problem, estimate, left_out)
    told = estimate.poses is not None and estimate.fixture_sd < estimate.slow.sd
    walks = problem.turns_known and not told
    candidates = [
        one
        for one in (list_candidates(problem, time, walks) if look else ())
        if one.kind in OF_ALL or one.station not in left_out
    ]
    terms = list_terms(fit, time, candidates, fit.left)
    ways, variance = [(0.0, fit.slow)], 1.0
    if look and terms.groups:
        terms, ways, variance = _find_ways(fit, terms, estimate, time)
    gram = terms.gram / variance
    unseen = _allow_for_changes(fit, terms, gram, changes, problem.layout.shape[1])
    each = [(likely, _conclude(fit, terms, gram, estimate, there)) for likely, there in ways]
    made = [(likely, *one) for likely, one in each if one is not None]
    if not any(found for _, found, *_ in made):
        return Faults((), estimate.coefficients, estimate.covariance, unseen, left_out)
    likelies, named, means, spreads = zip(*made, strict=True)
    chances = np.exp(np.array(likelies) - max(likelies))
    chances /= chances.sum()
    each_chance = zip(named, chances, strict=True)
    found = next((one for one, p in each_chance if one and p > _chance_to_tell(one)), ())
    averaged = mix(chances, np.stack(means), np.stack(spreads))
    return Faults(found, *averaged, unseen, left_out)


def _chance_to_tell(faults: Sequence[Fault]) -> float:
    """From which chance faults are told: others that are rarer are in the standard error alone; a
    walk looks like another field at each station, and is told where it is not unlikely."""
    return 0.05 if any(one.candidate.kind == WALK for one in faults) else 0.4


def _find_ways(
    fit: Linear, terms: Terms, estimate: StationEstimate, time: Array
) -> tuple[Terms, list[Way], float]:
    """The ways to explain the residuals, the likeliest first, by terms with steps at moments near
    those that were found, and the variance of what is left."""
    problem, ways, variance = fit.problem, list[Way](), 1.0
    for _ in range(_ROUNDS):
        if ways:  # until it is found a fault is scatter, and memory
            there = ways[0][1]
            left, variance = _bound_outliers(fit, terms, there, time)
            if not terms.select_faults(there):
                variance = max(variance, estimate.correlation)
            steps = [one for one in map(terms.find, there) if one and one.kind == STEP]
            near = [each for one in steps for each in list_moments(problem, one, time)]
            terms = terms.explain(left, fit.spaces)
            if near:
                terms = list_terms(fit, time, [*near, *terms.candidates], left)
        tested, ways = _leave_offsets(fit, terms, variance), []
        for start in _list_starts(fit, terms, tested):
            there, base = choose(tested, fit.prior, terms.groups, start)
            likely = base.evidence + price(terms.groups, there)
            there = terms.keep_apart(there, 0.5 * float(np.ptp(time)) / problem.stations)
            ways.append((likely, {**there, **({} if problem.turns_known else fit.slow)}))
        ways.sort(key=lambda way: -way[0])
        ways = [way for k, way in enumerate(ways) if way[1] not in [w for _, w in ways[:k]]]
    if not (problem.turns_known or len(estimate.ageing)) and fit.slow:
        ways += [(ways[0][0] + more, way) for more, way in _weigh_ageing(fit, terms, variance)]
    return terms, ways, variance


def _list_starts(fit: Linear, terms: Terms, gram: Array) -> list[dict[int, float]]:
    """From where terms are chosen: slow changes hide faults, and faults slow changes."""
    odds, sizes = rate(gram, solve(gram, fit.prior, terms.groups, {}), terms.groups)
    odds[: len(terms.groups) - len(terms.candidates)] = -np.inf
    walking = [i for i, one in enumerate(terms.groups) if one.name == WALK]
    likeliest = {int(np.argmax(odds)), *walking}
    return [{}, fit.slow, *({i: float(sizes[i])} for i in likeliest if odds[i] > EVIDENCE)]


def _find_stations_left_out(problem: StationProblem, estimate: StationEstimate) -> tuple[int, ...]:
    """Stations of which the robust loss left nothing, and which are further off than any fault."""
    away = np.abs(estimate.residuals).reshape(len(problem.station), -1).max(axis=1)
    each = [problem.station == k for k in range(problem.stations)]
    limit = LARGEST * TIME[0].scale
    return tuple(
        k
        for k, own in enumerate(each)
        if np.median(estimate.weights[own]) < _NOTHING and np.median(away[own]) > limit
    )


def _weigh_ageing(
    fit: Linear, terms: Terms, variance: float
) -> list[tuple[float, dict[int, float]]]:
    """Ageing in place of the slow changes that the estimate has, or beside them, and by how much
    likelier it is: by the magnitude alone a field that changes for long looks much like it."""
    slow = range(len(terms.groups) - len(terms.candidates))
    few = [*slow, *(i for i, one in enumerate(terms.groups) if one.name == AGEING)]
    groups = [terms.groups[i] for i in few]
    ages = len(groups) - 1
    if groups[ages].name != AGEING:
        return []
    groups[ages] = groups[ages]._replace(odds=AGED)
    gram, likely, aged = terms.gram / variance, list[float](), dict[int, float]()
    for among, start in ((groups[:ages], fit.slow), (groups, {ages: groups[ages].scale})):
        aged, base = choose(gram, fit.prior, among, start)
        likely.append(base.evidence + price(groups, aged))
    if ages not in aged:
        return []
    return [(likely[1] - likely[0], {few[i]: size for i, size in aged.items()})]


def _leave_offsets(fit: Linear, terms: Terms, variance: float) -> Array:
    """Cross-products over the variance; by the magnitude alone of what is left beside another field
    at each station, which explains any fault of whole stations."""
    gram = terms.gram / variance
    if fit.problem.turns_known:
        return gram
    own = terms.changes.columns
    shared = gram[:, own]
    return np.asarray(gram - shared @ np.linalg.pinv(shared[own], hermitian=True) @ shared.T)


def _allow_for_changes(
    fit: Linear, terms: Terms, gram: Array, changes: Sequence[float], a: int
) -> tuple[Array, ...]:
    """What a random step of each of `changes` before every station but the first adds to the
    covariance (a, a), where turns are known one such step at the worst place: parts that would
    show count no more than the noise lets them."""
    own = terms.changes.columns.reshape(fit.problem.stations, -1)[1:]
    parts = own if fit.problem.turns_known else own.reshape(1, -1)
    plain, last = solve(gram, fit.prior, terms.groups, fit.slow).inverse, len(terms.groups)
    added = []
    for size in changes:
        worst = plain
        for columns in parts if size > 0.0 and own.size else ():
            groups = [*terms.groups, terms.changes._replace(columns=columns)]
            wider = solve(gram, fit.prior, groups, {**fit.slow, last: size}).inverse
            worst = max(worst, wider, key=lambda each: float(np.trace(each[:a, :a])))
        added.append(worst[:a, :a] - plain[:a, :a])
    return tuple(added)


def _conclude(
    fit: Linear, terms: Terms, gram: Array, estimate: StationEstimate, there: Mapping[int, float]
) -> tuple[tuple[Fault, ...], Array, Array] | None:
    """The faults among terms, coefficients (a,) beside them, and their covariance: a sensor is on
    either side of a step, or at the end of its ageing, half of it from the middle. None where all
    are larger than any sensor has."""
    base = solve(gram, fit.prior, terms.groups, there)
    every = _place(base, len(gram))
    if too_large := terms.select_faults(there, every):  # they stand in for something else
        left = {i: size for i, size in there.items() if i not in too_large}
        whole = terms.select_faults(left)
        return _conclude(fit, terms, gram, estimate, left) if whole else None
    found = tuple(
        Fault(one, every[terms.groups[i].columns]) for i in there if (one := terms.find(i))
    )
    if not found:
        return (), estimate.coefficients, estimate.covariance
    a, constant = fit.problem.layout.shape[1], (fit.problem.degree + 1) * np.arange(3)
    if np.abs(every[:a]).max() > 0.5:  # of the field: no small move, so its equations do not hold
        return None
    covariance = base.inverse[:a, :a].copy()
    halves = list[Array]()
    for i in there:  # and half of what is not known of their sizes
        if (one := terms.find(i)) is not None and one.kind in (STEP, AGEING, WALK):
            of = terms.groups[i].columns
            own = np.flatnonzero(np.isin(base.columns, of))
            spread = base.inverse[np.ix_(own, own)].reshape(len(own) // 3, 3, -1, 3)
            covariance[np.ix_(constant, constant)] += spread.sum(axis=(0, 2)) / 4
            halves.append(every[of].reshape(-1, 3).sum(axis=0) / 2)
    if len(estimate.ageing):
        first = a + len(estimate.drift)
        halves.append((estimate.ageing + every[first : first + 3]) / 2)
    for half in halves:
        covariance[np.ix_(constant, constant)] += np.outer(half, half)
    return found, estimate.coefficients + every[:a], covariance


def _place(base: Base, count: int) -> Array:
    """The estimates of a base among all (count,) unknowns, zero where they are not in it."""
    found = np.zeros(count)
    found[base.columns] = base.estimate
    return found
