"""Scores of faults beside a fit that has none: how surely each is there, on what is left.

With the residuals z, their Jacobian J, the covariance C of the fit, and the columns G of a fault,

    M = 1 − J C Jᵀ,   b = −(GᵀMG)⁻¹ GᵀM z,   q = bᵀ(GᵀMG) b

is Rao's (1948) score statistic, χ² where there is no fault.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc, fdtrc

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation import temperature_model
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.thermal.maths.estimate import IMPLAUSIBLE, OUTLIER, StationEstimate
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

ODD, STEP, SETTLING, AGEING = "odd", "step", "settling", "ageing"
THERMOMETER, UNSETTLED = "thermometer", "unsettled"
OF_TEMPERATURE = (THERMOMETER, UNSETTLED)
"""Faults of the temperature; the others are of the bias."""
DECAYS = (0.02, 0.06, 0.2)
"""Time constants of a bias that settles, of the whole campaign."""
_UNSETTLED = 0.1  # of a station's recording: how long a temperature takes to settle
_MOMENTS = 30


class Candidate(NamedTuple):
    """A fault to look for: `weight` (m,) of it at each mean.

    `station` is the odd one, or that in which or before which a step came; `time` the first time
    (s) with the fault; of a bias that settles, its time constant.
    """

    kind: str
    weight: Array
    station: int = 0
    time: float = np.nan


def list_candidates(problem: StationProblem, time: Array) -> Iterator[Candidate]:
    """Odd stations, thermometers that are off, and, where times are known, temperatures that had
    not settled, steps between stations and in the middle of each, and biases that age or settle.
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
    last = order[-1]
    yield Candidate(AGEING, (time - (time.min() + time.max()) / 2) / float(np.ptp(time)), last)
    for share in DECAYS:
        constant = share * float(np.ptp(time))
        left = np.exp((time.min() - time) / constant)
        yield Candidate(SETTLING, np.asarray(left, dtype=np.float64), order[0], constant)


def list_moments(problem: StationProblem, step: Candidate, time: Array) -> Iterator[Candidate]:
    """A step at moments about that of a candidate, as far as half of a station away."""
    own = time[problem.station == step.station]
    reach = 0.55 * float(np.ptp(own))
    near = np.unique(time[np.abs(time - step.time) <= reach])
    for moment in near[:: max(len(near) // _MOMENTS, 1)][1:]:
        place = int(problem.station[np.argmin(np.abs(time - moment))])
        yield Candidate(STEP, _step_at(time, float(moment)), place, float(moment))


def _step_at(time: Array, moment: float) -> Array:
    """Less one half before a moment, one half after."""
    return np.where(time >= moment, 0.5, -0.5)


LARGEST, LARGEST_CHANGE = 0.02, 0.05
"""A combination is tested whose standard error is below this of the field, or of half the range of
temperatures: the readings hardly tell larger ones from the fit."""
_NEW = 1e-3  # of its information: what must be left of a fault beside all else
_PARTS = (16, 8, 4)  # of a station, over which memory is looked for


class LinearisedFit(NamedTuple):
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

    def with_fault(self, columns: Array) -> LinearisedFit:
        """With a fault in the model, and slow changes as they are beside it."""
        new = self._replace(beside=np.hstack([self.beside, columns]))
        if self.slow.sd == 0.0:
            return new
        plain = new._replace(slow=GaussianProcess())
        (step, _), (z, rows) = plain.solve(), plain.whitened
        left = z + rows @ step
        limit = OUTLIER * max(robust_scale(left), 1.0)
        slow, _ = estimate_process(
            project_changes(self.problem, self.state),
            np.clip(left, -limit, limit),
            rows,
            (new.known[0] + new.known[1] @ step, new.known[1]),
            list_near_kinds(self.slow),
        )
        return new._replace(slow=slow)


class Scores(NamedTuple):
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


def linearise(
    problem: StationProblem, estimate: StationEstimate, time: Array, left_out: tuple[int, ...]
) -> LinearisedFit:
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
    return LinearisedFit(problem, state, z, jacobian, prior, none, estimate.slow, lasts, order)


def with_offsets(fit: LinearisedFit) -> LinearisedFit:
    """Where the magnitude alone is known, with another field at each station.

    Twelve stations less nine numbers leave three that another field at each explains as well as
    any fault does: there a fault must show within stations.
    """
    if fit.problem.turns_known:
        return fit
    offsets = change_fields(fit, fit.problem.station[:, None] == np.arange(fit.problem.stations))
    (expected, by), k = fit.prior, fit.problem.stations
    return fit._replace(
        jacobian=np.hstack([fit.jacobian, offsets]),
        prior=(np.pad(expected, (0, k)), block_diag(by, np.eye(k) / IMPLAUSIBLE)),
    )


def change_fields(fit: LinearisedFit, where: Mask) -> Array:
    """How residuals follow a field larger by all of itself at some of the means (m, c), (n, c)."""
    problem, p = fit.problem, fit.problem.degree + 1
    bias, _ = temperature_model.evaluate_local(fit.state.coefficients, problem.layout, problem.phi)
    axes = len(fit.jacobian) // len(problem.points)
    by_bias = fit.jacobian[:, [0, p, 2 * p]]
    by_field = np.einsum("ni,ni->n", by_bias, np.tile(problem.points - bias, (axes, 1)))
    return np.asarray(by_field[:, None] * np.tile(where, (axes, 1)))


def make_columns(fit: LinearisedFit, candidate: Candidate) -> Array:
    """How residuals follow a fault of size one, (n, 3) or (n, 1)."""
    problem, jacobian, p = fit.problem, fit.jacobian, fit.problem.degree + 1
    axes = len(jacobian) // len(problem.points)
    weight = np.tile(candidate.weight, axes)[:, None]
    if candidate.kind not in OF_TEMPERATURE:
        return np.asarray(jacobian[:, [0, p, 2 * p]] * weight)
    powers = np.arange(1, p)
    curves = fit.state.coefficients[: 9 * p].reshape(9, p)[:, 1:] * powers
    slopes = np.tile(problem.phi[:, 1, None] ** (powers - 1) @ curves.T, (axes, 1))
    return np.asarray((jacobian[:, : 9 * p : p] * slopes).sum(axis=1, keepdims=True) * weight)


def score_faults(fit: LinearisedFit, columns: list[Array]) -> tuple[Scores, list[Index]]:
    """The scores of faults, and the columns of each."""
    edges = np.cumsum([0, *(made.shape[1] for made in columns)]).tolist()
    z, rows = fit.whitened
    added = make_whitener(fit.problem, fit.state._replace(slow=fit.slow))(np.hstack(columns))
    step, covariance = fit.solve()
    left = z + rows @ step
    scale = max(robust_scale(left), 1.0)
    bounded = np.clip(left, -OUTLIER * scale, OUTLIER * scale)
    slow, freedom = _measure_slow(fit, bounded, rows, covariance)
    shared = rows.T @ added
    moved = -covariance @ shared
    scores = Scores(
        gradient=bounded @ added + ((bounded - left) @ rows) @ moved,
        information=added.T @ added + shared.T @ moved,
        alone=np.sum(added**2, axis=0),
        variance=max(fit.correlation * scale**2, _measure_memory(fit, bounded)),
        slow=slow,
        freedom=freedom,
    )
    return scores, [np.arange(*edge) for edge in pairwise(edges)]


def _measure_memory(fit: LinearisedFit, left: Array) -> float:
    """By how much means over parts of a station scatter more than those of white noise."""
    m = len(fit.order)
    rows = left.reshape(-1, m)[:, fit.order]
    lengths = {max(m // (fit.problem.stations * parts), 1) for parts in _PARTS}
    sums = [np.add.reduceat(rows, np.arange(0, m, length), axis=1) for length in lengths]
    return max(float(np.sum(each**2)) / left.size for each in sums)


def _measure_slow(
    fit: LinearisedFit, left: Array, rows: Array, covariance: Array
) -> tuple[float, float]:
    """The sum of squares of what residuals hold of polynomials at each station, and its freedom."""
    if fit.problem.course is None:
        return 0.0, 1.0
    spaces = project_changes(fit.problem, fit.state)
    slow, known = spaces.within(left), spaces.within(rows)
    return float(slow @ slow), float(len(slow) - np.sum((known @ covariance) * known))
