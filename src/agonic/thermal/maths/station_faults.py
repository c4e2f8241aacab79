"""A sensor that was not the same at all stations: an odd station, a step, a bias that settles.

Every kind of fault adds columns G to the Jacobian J of the residuals z, and numbers b to what is
unknown. With C the covariance of the fit, nothing is fitted again:

    z + J δ + G b,   M = 1 − J C Jᵀ,   b = −(GᵀMG)⁻¹ GᵀM z,   δ = −C JᵀG b,   q = bᵀ(GᵀMG) b

q is Rao's (1948) score statistic, χ² where there is no fault; how many faults were looked for
counts. δ is what the coefficients would change by if the fault were in the model: by so much they
may be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc, fdtrc

from agonic.arrays import Array, Index
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.thermal.maths.estimate import IMPLAUSIBLE, StationEstimate
from agonic.thermal.maths.gaussian_process import (
    GaussianProcess,
    estimate_process,
    list_near_kinds,
)
from agonic.thermal.maths.prior import make_prior
from agonic.thermal.maths.station_residuals import (
    State,
    StationProblem,
    collect_parameters,
    make_pieces,
    make_whitener,
    project_changes,
)

ODD, STEP, SETTLING = "odd", "step", "settling"
THERMOMETER, UNSETTLED = "thermometer", "unsettled"
CHANCE = 0.002
"""Faults are believed that chance would make this seldom in a campaign without any."""
DECAYS = (0.02, 0.06, 0.2)
"""Time constants of a bias that settles, of the whole campaign."""
_UNSETTLED = 0.1  # of a station's recording: how long a temperature takes to settle
LARGEST, LARGEST_CHANGE = 0.02, 0.05
"""A combination is tested whose standard error is below this of the field, or of half the range of
temperatures: the readings hardly tell larger ones from the fit."""
_NEW = 1e-3  # of its information: what must be left of a fault beside all else
_MOST = 4
_MOMENTS = 30
_PARTS = (16, 8, 4)
_NOTHING = 0.1
_OUTLIER = 5.0


class Candidate(NamedTuple):
    """A fault to look for: `weight` (m,) of it at each mean.

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
    p_value: float


class Faults(NamedTuple):
    """All that were found, and the second moments (a, a) of what they moved the coefficients by.

    `left_out` are stations that fit so badly that the robust loss had left nothing of them.
    """

    found: tuple[Fault, ...]
    covariance: Array
    left_out: tuple[int, ...] = ()


class _Fit(NamedTuple):
    """The linearised fit, not yet whitened with slow changes of the field.

    Residuals z (n,) and Jacobian (n, p); `beside` (n, c) are the columns of faults that were found,
    `prior` residuals and Jacobian of the prior, `slow` the changes of the field beside all;
    `order` (m,) the means by station and time.
    """

    problem: StationProblem
    state: State
    z: Array
    jacobian: Array
    prior: tuple[Array, Array]
    beside: Array
    slow: GaussianProcess
    correlation: float
    order: Index

    @property
    def whitened(self) -> tuple[Array, Array]:
        """Residuals, and Jacobian with the faults last."""
        whiten = make_whitener(self.problem, self.state._replace(slow=self.slow))
        return whiten(self.z), whiten(np.hstack([self.jacobian, self.beside]))

    @property
    def known(self) -> tuple[Array, Array]:
        """Residuals and Jacobian of the prior, which knows nothing of the faults."""
        expected, by = self.prior
        return expected, np.pad(by, ((0, 0), (0, self.beside.shape[1])))

    def solve(self) -> tuple[Array, Array]:
        """The step (p + c,) to the least squares, and its covariance."""
        z, rows = self.whitened
        expected, by = self.known
        covariance = leastsq.inverse(rows.T @ rows + by.T @ by)
        return -covariance @ (rows.T @ z + by.T @ expected), covariance

    def with_fault(self, columns: Array) -> _Fit:
        """With a fault in the model, and slow changes as they are beside it."""
        new = self._replace(beside=np.hstack([self.beside, columns]))
        if self.slow.sd == 0.0:
            return new
        plain = new._replace(slow=GaussianProcess())
        (step, _), (z, rows) = plain.solve(), plain.whitened
        left = z + rows @ step
        limit = _OUTLIER * max(robust_scale(left), 1.0)
        slow, _ = estimate_process(
            project_changes(self.problem, self.state),
            np.clip(left, -limit, limit),
            rows,
            (new.known[0] + new.known[1] @ step, new.known[1]),
            list_near_kinds(self.slow),
        )
        return new._replace(slow=slow)


class _Scores(NamedTuple):
    """Of the columns (c,) of faults beside the fit: gradient with outliers bounded, information,
    and that (c,) which each would have alone; `variance` of the residuals by their scale and
    memory, and the sum of squares `slow` of what changes slowly in them, with `freedom` degrees.
    """

    gradient: Array
    information: Array
    alone: Array
    variance: float
    slow: float
    freedom: float

    def find_seen(self, part: Index, sized: bool = False) -> Array:
        """Combinations (c, r) of a fault's columns that are not all but in the fit already, each of
        unit information; those alone whose size can be told, where `sized`.
        """
        scale = 1 / np.sqrt(np.maximum(self.alone[part], 1e-300))
        largest = LARGEST if len(part) == 3 else LARGEST_CHANGE
        scaled = self.information[np.ix_(part, part)] * np.outer(scale, scale)
        values, vectors = np.linalg.eigh(scaled)
        sizes = np.sum((scale[:, None] * vectors) ** 2, axis=0)  # of one, before scaling
        seen = (values > _NEW) & ((values * largest**2 > sizes) | (not sized))
        return np.asarray(scale[:, None] * vectors[:, seen] / np.sqrt(values[seen]))

    def measure(self, part: Index) -> tuple[float, int]:
        """Rao's statistic of a fault, and its degrees of freedom."""
        score = self.gradient[part] @ self.find_seen(part)
        return float(score @ score), len(score)

    def test(self, part: Index) -> float:
        """The p-value of a fault: beside the noise, and beside what else changes slowly."""
        score = self.gradient[part] @ self.find_seen(part, sized=True)
        q, k = float(score @ score), len(score)
        if not k:
            return 1.0
        others = max(self.freedom - k, 1.0)
        rest = max(self.slow - q, 0.0) / others
        beside = float(fdtrc(k, others, q / k / rest)) if rest > 0 else 0.0
        return max(float(chdtrc(k, q / self.variance)), beside)


def find_faults(problem: StationProblem, estimate: StationEstimate, time: Array) -> Faults:
    """What was not the same at all stations, most likely first; `time` (m,) of the means, s."""
    left_out = find_left_out(problem, estimate)
    candidates = [
        one
        for one in list_candidates(problem, time)
        if one.kind in (STEP, SETTLING) or one.station not in left_out
    ]
    plain = fit = _linearise(problem, estimate, time, left_out)
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
    fit: _Fit


def _find_next(fit: _Fit, candidates: list[Candidate], time: Array) -> _Next:
    """The most likely fault.

    What is a fault may have been taken for slow changes of the field: those are estimated again
    beside the best candidates with them and without.
    """
    tested = _with_offsets(fit)
    plain, tried = tested._replace(slow=GaussianProcess()), []
    likely = {_find_best(each, candidates) for each in (tested, plain)}
    for k in likely:
        many, best = len(candidates), candidates[k]
        if best.kind == STEP:
            moments = list(_list_moments(fit.problem, best, time))
            many, best = many + len(moments), moments[_find_best(plain, moments)]
        columns = _make_columns(fit, best)
        scores, (own,) = _score(plain, [columns])
        slow = tested.with_fault(columns @ scores.find_seen(own)).slow
        scores, _ = _score(tested._replace(slow=slow), [columns])
        seen = scores.find_seen(own, sized=True)
        p_value = scores.test(own) * many if slow.sd < IMPLAUSIBLE else np.inf
        wider = fit._replace(slow=slow, beside=np.hstack([fit.beside, columns @ seen]))
        tried.append(_Next(p_value, best, seen, wider))
    return min(tried, key=lambda each: each.p_value)


def _with_offsets(fit: _Fit) -> _Fit:
    """Where the magnitude alone is known, with another field at each station.

    Twelve stations less nine numbers leave three that another field at each explains as well as
    any fault does: there a fault must show within stations.
    """
    if fit.state.poses is not None:
        return fit
    station = fit.problem.station
    offsets = (station[:, None] == np.arange(fit.problem.stations)).astype(np.float64)
    p = fit.problem.degree + 1
    offsets *= np.linalg.norm(fit.jacobian[:, [0, p, 2 * p]], axis=1, keepdims=True)
    (expected, by), k = fit.prior, fit.problem.stations
    return fit._replace(
        jacobian=np.hstack([fit.jacobian, offsets]),
        prior=(np.pad(expected, (0, k)), block_diag(by, np.eye(k) / IMPLAUSIBLE)),
    )


def _find_best(fit: _Fit, candidates: list[Candidate]) -> int:
    """The place of the candidate with the smallest p-value by the noise alone."""
    scores, parts = _score(fit, [_make_columns(fit, each) for each in candidates])
    found = [scores.measure(part) for part in parts]
    return int(np.argmax([q - 2.0 * k for q, k in found]))


def _list_moments(problem: StationProblem, step: Candidate, time: Array) -> Iterator[Candidate]:
    """A step at moments about that of a candidate, as far as half of a station away."""
    own = time[problem.station == step.station]
    reach = 0.55 * float(np.ptp(own))
    near = np.unique(time[np.abs(time - step.time) <= reach])
    for moment in near[:: max(len(near) // _MOMENTS, 1)][1:]:
        place = int(problem.station[np.argmin(np.abs(time - moment))])
        yield Candidate(STEP, _step_at(time, float(moment)), place, float(moment))


def list_candidates(problem: StationProblem, time: Array) -> Iterator[Candidate]:
    """Odd stations, thermometers that are off, and, where times are known, temperatures that had
    not settled, steps between stations and in the middle of each, and biases that settle.
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
            yield Candidate(STEP, _step_at(time, moment), k, moment)
    for share in DECAYS:
        constant = share * float(np.ptp(time))
        left = np.exp((time.min() - time) / constant)
        yield Candidate(SETTLING, np.asarray(left, dtype=np.float64), order[0], constant)


def _step_at(time: Array, moment: float) -> Array:
    """Less one half before a moment, one half after."""
    return np.where(time >= moment, 0.5, -0.5)


def _linearise(
    problem: StationProblem, estimate: StationEstimate, time: Array, left_out: tuple[int, ...]
) -> _Fit:
    """Residuals, Jacobian and prior at an estimate, without the stations that were left out."""
    state = State(
        estimate.coefficients,
        estimate.drift,
        estimate.ageing,
        estimate.poses,
        estimate.excess,
        estimate.fixture_sd,
        estimate.slow,
        np.zeros((0, 0)),
    )
    params = collect_parameters(state, problem.layout.shape[1])
    pieces = make_pieces(problem, state._replace(slow=GaussianProcess()))
    z, jacobian = next(iter(pieces(params)))
    used = np.tile(~np.isin(problem.station, left_out), len(z) // len(problem.points))
    z, jacobian = z * used, jacobian * used[:, None]
    prior = make_prior(problem, state)(params)
    none, order = np.zeros((len(z), 0)), np.lexsort((time, problem.station))
    lasts = estimate.correlation
    return _Fit(problem, state, z, jacobian, prior, none, estimate.slow, lasts, order)


def _make_columns(fit: _Fit, candidate: Candidate) -> Array:
    """How residuals follow a fault of size one, (n, 3) or (n, 1)."""
    problem, jacobian, p = fit.problem, fit.jacobian, fit.problem.degree + 1
    axes = len(jacobian) // len(problem.points)
    weight = np.tile(candidate.weight, axes)[:, None]
    if candidate.kind not in (THERMOMETER, UNSETTLED):
        return np.asarray(jacobian[:, [0, p, 2 * p]] * weight)
    powers = np.arange(1, p)
    curves = fit.state.coefficients[: 9 * p].reshape(9, p)[:, 1:] * powers
    slopes = np.tile(problem.phi[:, 1, None] ** (powers - 1) @ curves.T, (axes, 1))
    return np.asarray((jacobian[:, : 9 * p : p] * slopes).sum(axis=1, keepdims=True) * weight)


def _score(fit: _Fit, columns: list[Array]) -> tuple[_Scores, list[Index]]:
    """The scores of faults, and the columns of each."""
    edges = np.cumsum([0, *(made.shape[1] for made in columns)]).tolist()
    z, rows = fit.whitened
    added = make_whitener(fit.problem, fit.state._replace(slow=fit.slow))(np.hstack(columns))
    step, covariance = fit.solve()
    left = z + rows @ step
    scale = max(robust_scale(left), 1.0)
    bounded = np.clip(left, -_OUTLIER * scale, _OUTLIER * scale)
    slow, freedom = _measure_slow(fit, bounded, rows, covariance)
    shared = rows.T @ added
    moved = -covariance @ shared
    scores = _Scores(
        gradient=bounded @ added + ((bounded - left) @ rows) @ moved,
        information=added.T @ added + shared.T @ moved,
        alone=np.sum(added**2, axis=0),
        variance=max(fit.correlation * scale**2, _measure_memory(fit, bounded)),
        slow=slow,
        freedom=freedom,
    )
    return scores, [np.arange(*edge) for edge in pairwise(edges)]


def _measure_memory(fit: _Fit, left: Array) -> float:
    """By how much means over parts of a station scatter more than those of white noise."""
    m = len(fit.order)
    rows = left.reshape(-1, m)[:, fit.order]
    lengths = {max(m // (fit.problem.stations * parts), 1) for parts in _PARTS}
    sums = [np.add.reduceat(rows, np.arange(0, m, length), axis=1) for length in lengths]
    return max(float(np.sum(each**2)) / left.size for each in sums)


def _measure_slow(fit: _Fit, left: Array, rows: Array, covariance: Array) -> tuple[float, float]:
    """The sum of squares of what residuals hold of polynomials at each station, and its freedom."""
    if fit.problem.course is None:
        return 0.0, 1.0
    spaces = project_changes(fit.problem, fit.state)
    slow, known = spaces.within(left), spaces.within(rows)
    return float(slow @ slow), float(len(slow) - np.sum((known @ covariance) * known))


def _assemble(plain: _Fit, fit: _Fit, found: list[_Next]) -> Faults:
    """Faults with their sizes, and what they did to the coefficients.

    A sensor is on either side of a step, half of it away from the middle.
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
        if one.candidate.kind == STEP:
            half = np.zeros(a)
            half[[0, p, 2 * p]] = made[-1].size / 2
            covariance += np.outer(half, half)
    return Faults(tuple(made), covariance)
