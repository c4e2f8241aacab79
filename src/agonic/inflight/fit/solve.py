"""The estimate: start, robust refinement on all readings, and the choice of the spline."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError
from agonic.inflight.fit import drift
from agonic.inflight.fit import prior as belief
from agonic.inflight.fit.channel_noise import mean_correlation, over_spreads, spreads
from agonic.inflight.fit.covariance import Clock, honest
from agonic.inflight.fit.problem import Task, require_enough
from agonic.inflight.fit.terms import Terms
from agonic.inflight.maths.residuals import (
    KINDS,
    Layout,
    Rows,
    Source,
    compute_residuals,
    correct,
    residual_pieces,
)
from agonic.maths.equation import attitude_aided
from agonic.maths.equation.affine import FREE, SYMMETRIC, model_basis, split
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.correlated_errors import Lasting
from agonic.maths.estimation.leastsq import robust_scale
from agonic.maths.estimation.noise import Noise, noise_of
from agonic.maths.rotations.vectors import find_best_rotation

BLOCKS = 10
MOST_INTERVALS = 32
WORTH = 0.98
"""More knots are kept when they bring the unseen residual below this share."""
FEWEST_STRETCHES = 120
_ENOUGH = 3000  # readings for a start without a ground calibration
_TURNED_RAD = 1e-6
_ROUNDS = 5


class Estimate(NamedTuple):
    """The solution, and of each kind the noise, the residuals, and the errors that last, in units
    of the magnitude; `sds` as `flight.residual` takes them."""

    solution: leastsq.Solution
    layout: Layout
    terms: Terms
    noise: dict[str, Noise]
    sds: dict[str, float]
    residuals: dict[str, Array]
    errors: dict[str, tuple[Lasting, ...]]

    @property
    def weight(self) -> Array:
        """What the robust losses left of each reading, the least of its kinds."""
        weights = [
            noise.loss.weight((self.residuals[kind] / noise.sd) ** 2)
            for kind, noise in self.noise.items()
        ]
        return np.asarray(np.minimum.reduce(weights))


class Found(NamedTuple):
    """The estimate, the task as it was at last, and unseen residuals by intervals tried, nT."""

    estimate: Estimate
    task: Task
    held_out: dict[int, float]


def found(task: Task) -> Found:
    """The estimate of a task; rows beyond the limit of residuals and a turn are settled here."""
    first = start(task)
    plain = replace(task, toward=None)
    intervals, held_out = _intervals(plain, first)
    estimate = fitted(plain, first, task.believed, intervals)
    limit = task.settings.residual_limit
    for _ in range(_ROUNDS if limit is not None else 0):
        assert limit is not None
        near = _near(task, estimate, limit)
        if (near == task.believed).all():
            break
        require_enough(near)
        task = replace(task, believed=near)
        estimate = fitted(replace(task, toward=None), first, near, intervals)
    if task.toward is not None:
        task, estimate = _with_attitude(task, estimate, intervals)
    return Found(_honest(task, estimate), task, held_out)


def _honest(task: Task, estimate: Estimate) -> Estimate:
    """The estimate with the covariance that errors that last leave it."""
    rows = task.rows(estimate.terms).select(task.believed)
    time = rows.time
    clock = Clock.of(float(time[0]), float(time[-1]), float(np.median(np.diff(time))))
    return with_honest(task, estimate, lambda: [rows], clock)


def with_honest(task: Task, estimate: Estimate, source: Source, clock: Clock) -> Estimate:
    """The estimate with the covariance and the noise by all readings that a source gives; as it is
    where there are too few to tell what lasts."""
    if clock.count < FEWEST_STRETCHES:
        return estimate
    params, layout, noise = estimate.solution.params, estimate.layout, estimate.noise
    _, jacobian = prior_of(task, layout)(params)
    held = jacobian.T @ jacobian
    found = honest(
        source,
        params,
        layout,
        noise,
        estimate.sds,
        held,
        mean_correlation(noise),
        clock,
        task.outside is not None,
    )
    return estimate._replace(
        solution=estimate.solution._replace(covariance=found.covariance),
        noise={k: of._replace(correlation=found.correlation[k]) for k, of in noise.items()},
        errors=found.errors,
    )


def start(task: Task) -> Array:
    """Bias and matrix, nine numbers, to start from."""
    if task.ground is not None:
        return Layout(SYMMETRIC, 0, 0).start
    rows = np.flatnonzero(task.believed)
    if len(rows) > _ENOUGH:
        chosen = np.random.default_rng(task.settings.seed).choice(len(rows), _ENOUGH, replace=False)
        rows = rows[np.sort(chosen)]
    problem = attitude_aided.Problem(
        points=task.samples.field[rows] / task.magnitude,
        terms=np.zeros((len(rows), 0)),
        horizontal=task.wanted[rows],
        vertical=np.zeros(1),
        down=None,
        across=None,
        model="full",
        gauge=SYMMETRIC,
        soft_iron_sd=task.settings.soft_iron_sd,
        turn_sd=None,
    )
    asked = task.settings
    return attitude_aided.estimate(problem, robust=asked.robust, seed=asked.seed).solution.params


def fitted(task: Task, first: Array, believed: Mask, intervals: int) -> Estimate:
    """The estimate from some of the rows with so many intervals of the bias in time."""
    terms = task.terms(intervals)
    gauge = SYMMETRIC if task.toward is None else FREE
    layout = Layout(gauge, terms.bias_count, terms.matrix_count)
    return refined(task, task.rows(terms).select(believed), layout, terms, _begun(layout, first))


def _begun(layout: Layout, first: Array) -> Array:
    """Parameters of a layout from the nine of another, terms at zero."""
    params = layout.start
    params[:9] = first[:9]
    if layout.gauge == FREE:
        params[9:12] = first[6:9]
    return params


def refined(task: Task, rows: Rows, layout: Layout, terms: Terms, params: Array) -> Estimate:
    """The minimum from a near start, noise and correlation of each kind from its residuals."""
    robust = task.settings.robust
    kinds = KINDS if task.toward is not None else KINDS[:1]
    prior = prior_of(task, layout)

    def source() -> list[Rows]:
        return [rows]

    seen = {kind: compute_residuals(rows, kind, params, layout)[0] for kind in kinds}
    sds = dict.fromkeys(kinds, 0.0)
    for _ in range(12):
        noise = {kind: noise_of(r, robust, len(params)) for kind, r in seen.items()}
        before, sds = sds, spreads(noise, sds)
        noise = {kind: over_spreads(of, kind, before, sds) for kind, of in noise.items()}
        lasts = mean_correlation(noise)
        channels = [
            leastsq.Channel(
                residual_pieces(source, kind, layout, sds[kind]),
                of.sd,
                of.loss,
                lasts,
                spread=of.correlation / lasts,
            )
            for kind, of in noise.items()
        ]
        solution = leastsq.solve_together(channels, params, prior=prior, tolerance=1e-2)
        params = solution.params
        parts = np.split(solution.residuals, len(noise))
        seen = dict(zip(noise, parts, strict=True))
        again = {kind: noise_of(r, robust, len(params)) for kind, r in seen.items()}
        if all(again[kind].settled(noise[kind]) for kind in noise) and len(kinds) == 1:
            break
        if all(abs(v / max(sds[k], 1e-12) - 1) < 0.02 for k, v in spreads(again, sds).items()):
            break
    return Estimate(solution, layout, terms, noise, sds, seen, {})


def prior_of(task: Task, layout: Layout) -> leastsq.Prior:
    """What is believed of the parameters beforehand."""
    asked = task.settings
    return belief.prior(layout, task.ground, asked.solve, asked.gain_sd, asked.soft_iron_sd)


def residuals_of(task: Task, estimate: Estimate, kind: str) -> Array:
    """The residuals of every row, (n,)."""
    rows = task.rows(estimate.terms)
    sd = 0.0 if kind == "magnitude" else estimate.sds[kind]
    parts = residual_pieces(lambda: [rows], kind, estimate.layout, sd)(estimate.solution.params)
    return np.concatenate([r for r, _ in parts])


def turn_of(estimate: Estimate) -> Array:
    """The rotation (3, 3) in a free matrix, M = R S."""
    c = estimate.layout.constants
    basis = model_basis("full", estimate.layout.gauge)
    return np.asarray(polar(split(basis @ estimate.solution.params[:c])[1])[0])


def _near(task: Task, estimate: Estimate, limit: float) -> Mask:
    """The rows whose residual is within a limit, nT."""
    far = np.abs(residuals_of(task, estimate, "magnitude")) * task.magnitude > limit
    return np.asarray(task.believed & ~far)


def _with_attitude(task: Task, estimate: Estimate, intervals: int) -> tuple[Task, Estimate]:
    """The turn from sensor to attitude by Wahba, then all three kinds of residual together.

    The turn found is taken into the directions until none is left, so that what remains of it in
    the matrix is small.
    """
    assert task.toward is not None
    rows = task.rows(estimate.terms).select(task.believed)
    field = correct(rows, estimate.solution.params, estimate.layout)
    seen = field / np.linalg.norm(field, axis=1)[:, None]
    turn = find_best_rotation(seen, task.toward.aim[task.believed], estimate.weight)
    first = estimate.solution.params[:9]
    for _ in range(_ROUNDS):
        task = replace(task, turn=turn)
        estimate = fitted(task, first, task.believed, intervals)
        left = turn_of(estimate)
        if np.abs(left - np.eye(3)).max() < _TURNED_RAD:
            break
        turn = turn @ left
        first = _symmetric_part(estimate, left)
    return task, estimate


def _symmetric_part(estimate: Estimate, turn: Array) -> Array:
    """Bias and the six entries of S in M = R S."""
    c = estimate.layout.constants
    bias, matrix = split(model_basis("full", FREE) @ estimate.solution.params[:c])
    s = turn.T @ matrix
    return np.concatenate([bias, pack_symmetric(s)])


def _intervals(task: Task, first: Array) -> tuple[int, dict[int, float]]:
    """How many intervals of drift, and the unseen residual of each number tried, nT."""
    asked = task.settings.drift_knots
    if asked != "auto":
        if asked < 0:
            raise AgonicError(f"drift_knots is {asked}; it counts intervals, 0 for a constant bias")
        return asked, {}
    tried = {0: _unseen(task, first, 0)}
    best, intervals = 0, 1
    while intervals <= MOST_INTERVALS and task.believed.sum() > 40 * (intervals + drift.DEGREE):
        tried[intervals] = _unseen(task, first, intervals)
        if tried[intervals] < WORTH * tried[best]:
            best = intervals
        elif intervals > 2 * max(best, 1):
            break
        intervals *= 2
    return best, tried


def _unseen(task: Task, first: Array, intervals: int) -> float:
    """Robust rms of residuals in every second block of time, by a fit to the others, nT."""
    block = np.arange(len(task.time)) * BLOCKS // len(task.time) % 2 == 0
    left = []
    for rows in (block, ~block):
        estimate = fitted(task, first, task.believed & rows, intervals)
        left.append(residuals_of(task, estimate, "magnitude")[task.believed & ~rows])
    return robust_scale(np.concatenate(left)) * task.magnitude
