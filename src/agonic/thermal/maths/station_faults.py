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

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from agonic.arrays import Array
from agonic.maths.equation import temperature_model
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.model.average import EVIDENCE, Base, Group, Prior, choose, mix, price, rate, solve
from agonic.model.terms.time import TIME
from agonic.thermal.maths import gaussian_process
from agonic.thermal.maths.estimate import AGED, IMPLAUSIBLE, LIKELY, OUTLIER, RARE, StationEstimate
from agonic.thermal.maths.gaussian_process import STEADY, GaussianProcess, Kind, StationSpaces
from agonic.thermal.maths.prior import make_prior
from agonic.thermal.maths.station_residuals import (
    State,
    StationProblem,
    collect_parameters,
    find_feet,
    make_pieces,
    project_changes,
)

PLAUSIBLE = 0.003
"""Of the field: what it may change by from one hour to another in a building, if nobody watches,
or the bias of a sensor that is handled."""
_BOUND = float((3.0 / chdtri(3, 0.95)) ** 0.5)
"""A standard deviation that three numbers tell is below 2.9 times theirs with 95 %."""
ODD, STEP, SETTLING, AGEING = "odd", "step", "settling", "ageing"
THERMOMETER, UNSETTLED, WALK = "thermometer", "unsettled", "walk"
OF_TEMPERATURE, OF_ALL = (THERMOMETER, UNSETTLED), (STEP, SETTLING, AGEING, WALK)
"""Faults of the temperature, where the others are of the bias; and those not of one station."""
SMOOTH: Kind = ("smooth", 0.7)
"""Slow changes of the field, where the estimate has none of their own."""
ODDS = 2e-3
"""How often a campaign has a fault of one kind at one place. Assumed: with some 40 places, one
campaign in twelve has a fault."""
WARM = 0.01
"""Scale of a thermometer's error, of half the range: 0.3 °C of 30."""
CHANGES = 1e-3
"""Scale of slow changes of the field, of itself, which every second chamber has."""
DECAYS = (0.02, 0.06, 0.2)
"""Time constants of a bias that settles, of the whole campaign."""
_UNSETTLED = 0.1  # of a station's recording: how long a temperature takes to settle
_MOMENTS = 30  # of a step, about the one that was found: nearer is the same to the readings
_PARTS = (16, 8, 4)  # of a station, over which memory is looked for
_ROUNDS = 2  # until a fault is found it is scatter and memory
_NOTHING = 0.1  # weight of a station that the robust loss left out
_SMALL, _SAME = 1e-9, 0.01  # of the largest axis: rounding; of a weight: alike in a station
LARGEST = 15.0
"""Of a fault, over its scale: 0.03 of the field, or 4.5 °C of 60."""


Way = tuple[float, dict[int, float]]
"""Terms by their sizes, and how likely they are."""


class Candidate(NamedTuple):
    """A fault to look for: `weight` (m,) of it at each mean, or (m, s) of each of its steps.

    `station` is the odd one, or that in which or before which a step came; `time` the first time
    (s) with the fault; of a bias that settles, its time constant.
    """

    kind: str
    weight: Array
    station: int = 0
    time: float = np.nan


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


def list_candidates(
    problem: StationProblem, time: Array, walks: bool = False
) -> Iterator[Candidate]:
    """Odd stations, thermometers that are off, and, where times are known, temperatures that had
    not settled, steps between stations and in the middle of each, biases that age or settle, and
    one that `walks` from each station to the next.
    """
    stations = range(problem.stations) if problem.stations > 1 else ()
    for k in stations:
        own = (problem.station == k).astype(np.float64)
        yield Candidate(ODD, own, k)
        if problem.degree:
            yield Candidate(THERMOMETER, own, k)
    if not np.isfinite(time).all() or np.ptp(time) == 0.0:
        return
    first = [float(time[problem.station == k].min()) for k in stations]
    order = sorted(stations, key=lambda k: first[k])
    for k in order:
        own = problem.station == k
        begins, ends = first[k], float(time[own].max())
        if problem.degree:
            since = np.maximum(time - begins, 0.0) / (_UNSETTLED * max(ends - begins, 1e-9))
            yield Candidate(UNSETTLED, np.asarray(own * np.exp(-since), dtype=np.float64), k)
        for moment in ((begins + ends) / 2,) if k == order[0] else (begins, (begins + ends) / 2):
            yield Candidate(STEP, np.where(time >= moment, 0.5, -0.5), k, moment)
    since = (time - time.min()) / float(np.ptp(time))
    yield Candidate(AGEING, since - 0.5, order[-1])
    if walks:
        later = np.column_stack([time >= first[k] for k in order[1:]])
        yield Candidate(WALK, np.where(later, 0.5, -0.5), order[-1])
    for share in DECAYS:
        yield Candidate(SETTLING, np.exp(-since / share), order[0], share * float(np.ptp(time)))


def _list_moments(problem: StationProblem, step: Candidate, time: Array) -> Iterator[Candidate]:
    """A step at moments about that of a candidate, as far as half of a station away."""
    reach = 0.55 * float(np.ptp(time[problem.station == step.station]))
    near = np.unique(time[np.abs(time - step.time) <= reach])
    for moment in near[:: max(len(near) // _MOMENTS, 1)][1:]:
        place = int(problem.station[np.argmin(np.abs(time - moment))])
        yield Candidate(STEP, np.where(time >= moment, 0.5, -0.5), place, float(moment))


class _Linear(NamedTuple):
    """The fit about its estimate: residuals (n,) that are to be explained, their Jacobian (n, p)
    and prior; how they follow a temperature (n,) and a field (n,) that are more by all of
    themselves; the stations' spaces; kinds of slow changes, and those that the estimate has."""

    problem: StationProblem
    left: Array
    jacobian: Array
    prior: Prior
    by_temperature: Array
    by_field: Array
    spaces: StationSpaces | None
    kinds: tuple[Kind, ...]
    slow: dict[int, float]

    def make_columns(self, candidate: Candidate) -> Array:
        """How residuals follow a fault of size one, (n, 3) or (n, 1)."""
        p = self.problem.degree + 1
        by = self.jacobian[:, [0, p, 2 * p]]
        if candidate.kind in OF_TEMPERATURE:
            by = self.by_temperature[:, None]
        weight = candidate.weight.reshape(len(candidate.weight), -1)
        weight = np.resize(weight, (len(by), weight.shape[1]))
        return np.asarray((weight[:, :, None] * by[:, None]).reshape(len(by), -1))


def _linearise(
    problem: StationProblem, estimate: StationEstimate, left_out: tuple[int, ...]
) -> _Linear:
    """The fit without the stations that were left out."""
    state = State(
        estimate.coefficients,
        estimate.drift,
        estimate.ageing,
        estimate.poses,
        estimate.excess,
        estimate.fixture_sd,
        GaussianProcess(),
        np.zeros((0, 0)),
    )
    params = collect_parameters(state, problem.layout.shape[1])
    feet = find_feet(problem, state)
    z, _ = next(iter(make_pieces(problem, state)(params)))
    _, jacobian = next(iter(make_pieces(problem._replace(points=feet), state)(params)))
    axes, p = len(z) // len(problem.points), problem.degree + 1
    used = np.tile(~np.isin(problem.station, left_out), axes)
    jacobian = jacobian * used[:, None]
    expected, by = make_prior(problem, state)(params)
    powers = np.arange(1, p)
    curves = state.coefficients[: 9 * p].reshape(9, p)[:, 1:] * powers
    slopes = problem.phi[:, 1:2] ** (powers - 1) @ curves.T
    bias, _ = temperature_model.evaluate_local(state.coefficients, problem.layout, problem.phi)
    field = np.tile(feet - bias, (axes, 1))
    slow, timed = estimate.slow, problem.course is not None
    kinds = (STEADY, SMOOTH if slow.kind in (STEADY, SMOOTH) else slow.kind)
    return _Linear(
        problem,
        -z * used,
        jacobian,
        Prior(by.T @ by, -expected @ by, float(expected @ expected)),
        np.sum(jacobian[:, : 9 * p : p] * np.tile(slopes, (axes, 1)), axis=1),
        np.sum(jacobian[:, [0, p, 2 * p]] * field, axis=1),
        project_changes(problem, state) if timed else None,
        kinds if timed else (),
        {kinds.index(slow.kind): slow.sd} if slow.sd > 0.0 and timed else {},
    )


class _Terms(NamedTuple):
    """Terms beside a fit, with cross-products of parameters, terms and residuals: first `changes`
    from each station on (of the bias where turns are known, else of the field), then slow changes
    by kind, then the faults."""

    changes: Group
    groups: list[Group]
    candidates: list[Candidate]
    gram: Array
    dense: Array
    roots: Array

    def explain(self, left: Array, spaces: StationSpaces | None) -> _Terms:
        """The same terms with other residuals (n,) to explain."""
        dense = np.column_stack([self.dense[:, :-1], left])
        along, curves = dense.T @ left, self.roots
        within = np.zeros(0) if spaces is None else curves.T @ spaces.within(left)
        gram, first = self.gram.copy(), self.changes.columns[-1] + 1
        gram[-1] = gram[:, -1] = np.concatenate([along[:first], within, along[first:]])
        return self._replace(gram=gram, dense=dense)

    def find(self, group: int) -> Candidate | None:
        """The fault that a group is, or None where it is slow changes."""
        at = group - (len(self.groups) - len(self.candidates))
        return self.candidates[at] if at >= 0 else None

    def select_faults(self, there: Iterable[int], every: Array | None = None) -> list[int]:
        """The faults among groups; those alone that are larger than any sensor has, where the
        estimates of `every` unknown are given."""
        faults = [i for i in there if self.find(i) is not None]
        if every is None:
            return faults
        of = self.groups
        return [i for i in faults if np.linalg.norm(every[of[i].columns]) > LARGEST * of[i].scale]

    def keep_apart(self, there: Mapping[int, float], near: float) -> dict[int, float]:
        """Of steps at about the same moment the likeliest alone: others would share in it."""
        kept, moments = dict[int, float](), list[float]()
        for i, size in there.items():
            one = self.find(i)
            if one is not None and one.kind == STEP:
                if any(abs(one.time - other) < near for other in moments):
                    continue
                moments.append(one.time)
            kept[i] = size
        return kept


def _list_terms(fit: _Linear, time: Array, candidates: Sequence[Candidate], left: Array) -> _Terms:
    """The terms of candidates, for residuals (n,) whose outliers are bounded; by the magnitude
    alone of those that are not the same throughout each station."""
    problem = fit.problem
    each = [problem.station == k for k in range(problem.stations)]
    candidates = [
        one
        for one in candidates
        if problem.turns_known
        or one.kind in OF_TEMPERATURE
        or any(np.ptp(one.weight[own]) > _SAME for own in each)
    ]
    later = _rank_stations(problem, time)[:, None] >= np.arange(problem.stations)
    p = problem.degree + 1
    by = fit.jacobian[:, [0, p, 2 * p]] if problem.turns_known else fit.by_field[:, None]
    half = 0.5 if problem.turns_known else 0.0  # of a bias that steps the middle is meant
    steps = np.resize(later - half, (len(left), later.shape[1]))[:, :, None] * by[:, None]
    steps = steps.reshape(len(left), -1)
    own = [fit.make_columns(each) for each in candidates]
    dense = np.hstack([fit.jacobian, steps, *own, left[:, None]])
    first = fit.jacobian.shape[1]
    at = first + steps.shape[1]
    changes = Group("changes", np.arange(first, at), PLAUSIBLE, 1.0, 1.0)
    first, groups, roots = at, list[Group](), [np.zeros((0, 0))]
    spread = np.zeros((0, dense.shape[1]))
    if fit.spaces is not None:
        spread, roots = fit.spaces.within(dense), []
        for kind in fit.kinds:
            size, axis = gaussian_process.find_principal_axes(fit.spaces, kind)
            kept = size > _SMALL * size.max()
            roots.append(axis[:, kept] * np.sqrt(size[kept]))
            odds = RARE if kind == STEADY else LIKELY
            groups.append(Group(kind[0], at + np.arange(kept.sum()), CHANGES, odds, 20.0))
            at += int(kept.sum())
    for one, columns in zip(candidates, own, strict=True):
        scale = WARM if one.kind in OF_TEMPERATURE else TIME[0].scale
        odds = RARE if one.kind == WALK else ODDS
        groups.append(Group(one.kind, at + np.arange(columns.shape[1]), scale, odds, LARGEST))
        at += columns.shape[1]
    curves = np.hstack(roots)
    inner, across, before = dense.T @ dense, curves.T @ spread, slice(first)
    gram = np.block(
        [
            [inner[before, before], across[:, before].T, inner[before, first:]],
            [across[:, before], curves.T @ curves, across[:, first:]],
            [inner[first:, before], across[:, first:].T, inner[first:, first:]],
        ]
    )
    return _Terms(changes, groups, candidates, gram, dense, curves)


def _bound_outliers(
    fit: _Linear, terms: _Terms, there: Mapping[int, float], time: Array
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
    fit = _linearise(problem, estimate, left_out)
    told = estimate.poses is not None and estimate.fixture_sd < estimate.slow.sd
    walks = problem.turns_known and not told
    candidates = [
        one
        for one in (list_candidates(problem, time, walks) if look else ())
        if one.kind in OF_ALL or one.station not in left_out
    ]
    terms = _list_terms(fit, time, candidates, fit.left)
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
    found = next((one for one, p in zip(named, chances, strict=True) if one and p > 0.05), ())
    averaged = mix(chances, np.stack(means), np.stack(spreads))
    return Faults(found, *averaged, unseen, left_out)


def _find_ways(
    fit: _Linear, terms: _Terms, estimate: StationEstimate, time: Array
) -> tuple[_Terms, list[Way], float]:
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
            near = [each for one in steps for each in _list_moments(problem, one, time)]
            terms = terms.explain(left, fit.spaces)
            if near:
                terms = _list_terms(fit, time, [*near, *terms.candidates], left)
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


def _list_starts(fit: _Linear, terms: _Terms, gram: Array) -> list[dict[int, float]]:
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
    fit: _Linear, terms: _Terms, variance: float
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


def _leave_offsets(fit: _Linear, terms: _Terms, variance: float) -> Array:
    """Cross-products over the variance; by the magnitude alone of what is left beside another field
    at each station, which explains any fault of whole stations."""
    gram = terms.gram / variance
    if fit.problem.turns_known:
        return gram
    own = terms.changes.columns
    shared = gram[:, own]
    return np.asarray(gram - shared @ np.linalg.pinv(shared[own], hermitian=True) @ shared.T)


def _allow_for_changes(
    fit: _Linear, terms: _Terms, gram: Array, changes: Sequence[float], a: int
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
    fit: _Linear, terms: _Terms, gram: Array, estimate: StationEstimate, there: Mapping[int, float]
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


def _rank_stations(problem: StationProblem, time: Array) -> Array:
    """Of each mean (m,) how many stations were recorded before; in their order without a clock."""
    if not np.isfinite(time).all():
        return np.asarray(problem.station)
    first = [float(time[problem.station == k].min()) for k in range(problem.stations)]
    return np.asarray(np.argsort(np.argsort(first))[problem.station])
