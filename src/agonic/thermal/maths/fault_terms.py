"""Faults that the stations of a campaign may have, and slow changes, as terms beside its fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import temperature_model
from agonic.model.average import Group, Prior
from agonic.model.terms.time import TIME
from agonic.thermal.maths import gaussian_process
from agonic.thermal.maths.estimate import LIKELY, RARE, StationEstimate
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
ODD, STEP, SETTLING, AGEING = "odd", "step", "settling", "ageing"
THERMOMETER, UNSETTLED, WALK = "thermometer", "unsettled", "walk"
OF_TEMPERATURE, OF_ALL = (THERMOMETER, UNSETTLED), (STEP, SETTLING, AGEING, WALK)
"""Faults of the temperature, where the others are of the bias; and those not of one station."""
LARGEST = 15.0
"""Of a fault, over its scale: 0.03 of the field, or 4.5 °C of 60."""
DECAYS = (0.02, 0.06, 0.2)
"""Time constants of a bias that settles, of the whole campaign."""
_UNSETTLED = 0.1  # of a station's recording: how long a temperature takes to settle
_MOMENTS = 30  # of a step, about the one that was found: nearer is the same to the readings
SMOOTH: Kind = ("smooth", 0.7)
"""Slow changes of the field, where the estimate has none of their own."""
ODDS = 2e-3
"""How often a campaign has a fault of one kind at one place. Assumed: with some 40 places, one
campaign in twelve has a fault."""
WARM = 0.01
"""Scale of a thermometer's error, of half the range: 0.3 °C of 30."""
CHANGES = 1e-3
"""Scale of slow changes of the field, of itself, which every second chamber has."""
_SMALL, _SAME = 1e-9, 0.01  # of the largest axis: rounding; of a weight: alike in a station


class Candidate(NamedTuple):
    """A fault to look for: `weight` (m,) of it at each mean, or (m, s) of each of its steps.

    `station` is the odd one, or that in which or before which a step came; `time` the first time
    (s) with the fault; of a bias that settles, its time constant.
    """

    kind: str
    weight: Array
    station: int = 0
    time: float = np.nan


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


def list_moments(problem: StationProblem, step: Candidate, time: Array) -> Iterator[Candidate]:
    """A step at moments about that of a candidate, as far as half of a station away."""
    reach = 0.55 * float(np.ptp(time[problem.station == step.station]))
    near = np.unique(time[np.abs(time - step.time) <= reach])
    for moment in near[:: max(len(near) // _MOMENTS, 1)][1:]:
        place = int(problem.station[np.argmin(np.abs(time - moment))])
        yield Candidate(STEP, np.where(time >= moment, 0.5, -0.5), place, float(moment))


class Linear(NamedTuple):
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


def linearise(
    problem: StationProblem, estimate: StationEstimate, left_out: tuple[int, ...]
) -> Linear:
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
    return Linear(
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


class Terms(NamedTuple):
    """Terms beside a fit, with cross-products of parameters, terms and residuals: first `changes`
    from each station on (of the bias where turns are known, else of the field), then slow changes
    by kind, then the faults."""

    changes: Group
    groups: list[Group]
    candidates: list[Candidate]
    gram: Array
    dense: Array
    roots: Array

    def explain(self, left: Array, spaces: StationSpaces | None) -> Terms:
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


def list_terms(fit: Linear, time: Array, candidates: Sequence[Candidate], left: Array) -> Terms:
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
    across, n = curves.T @ spread, dense.shape[1]
    gram = np.block([[dense.T @ dense, across.T], [across, curves.T @ curves]])
    order = np.r_[:first, n : len(gram), first:n]
    gram = gram[np.ix_(order, order)]
    return Terms(changes, groups, candidates, gram, dense, curves)


def _rank_stations(problem: StationProblem, time: Array) -> Array:
    """Of each mean (m,) how many stations were recorded before; in their order without a clock."""
    if not np.isfinite(time).all():
        return np.asarray(problem.station)
    first = [float(time[problem.station == k].min()) for k in range(problem.stations)]
    return np.asarray(np.argsort(np.argsort(first))[problem.station])
