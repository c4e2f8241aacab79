"""The estimate: start, robust refinement on all readings, and the choice of the spline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import polar

from agonic.arrays import Array, Mask
from agonic.field.worldfield import EXTERNAL_NT, EXTERNAL_S
from agonic.inflight.fit import covariance
from agonic.inflight.fit.interval_choice import choose_intervals
from agonic.inflight.fit.prior import build_prior
from agonic.inflight.fit.problem import Problem, require_enough
from agonic.inflight.fit.terms import Terms
from agonic.inflight.maths import residuals
from agonic.inflight.maths.correlated_errors import CorrelatedError
from agonic.maths.equation import maximum_likelihood
from agonic.maths.equation.affine import FREE, SYMMETRIC, model_basis, split
from agonic.maths.equation.channels import Problem as Known
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise
from agonic.maths.rotations.vectors import find_best_rotation

_LARGEST = 1.0  # of the readings' noise over the field: what it bends residuals by would run away


def compute_spreads(noise: dict[str, Noise], before: dict[str, float]) -> dict[str, float]:
    """The noise of the readings, and for what is across the field that of the attitude over it.

    What a kind scatters by beyond the magnitude, σ²(1 + κ²) with the field about one, is the
    attitude's. `before` are those with which `noise` was found.
    """
    own = noise["magnitude"].sd
    found = {"magnitude": min(own, _LARGEST)}
    for kind, of in noise.items():
        if kind != "magnitude":
            whole = (of.sd / own) ** 2 * (1 + before[kind] ** 2)
            found[kind] = float(np.sqrt(max(whole - 1, 0.0)))
    return found


def _compute_spread_ratio(kind: str, before: dict[str, float], now: dict[str, float]) -> float:
    """What residuals of a kind are over with the spreads `now`, σ or √(1 + κ²), over what they were
    over before; an attitude whose errors do not show has κ = 0."""
    least = 0.0 if kind == "magnitude" else 1.0
    return float(np.hypot(least, now[kind]) / np.hypot(least, before[kind]))


def find_estimate(problem: Problem) -> tuple[Problem, covariance.Estimate]:
    """The estimate, and the problem with the rows and the rotation that were settled on the way."""
    first = find_start(problem)
    plain = replace(problem, direction=None)
    estimate, held_out = choose_intervals(
        plain, lambda intervals: fit_rows(plain, first, problem.used, intervals)
    )
    intervals = estimate.terms.intervals
    limit = problem.settings.residual_limit
    for _ in range(5 if limit is not None else 0):
        assert limit is not None
        r = compute_residuals_of(problem, estimate, "magnitude")
        near = problem.used & ~(np.abs(r) * problem.magnitude > limit)
        if (near == problem.used).all():
            break
        require_enough(near)
        problem = replace(problem, used=near)
        estimate = fit_rows(replace(problem, direction=None), first, near, intervals)
    if problem.direction is not None:
        problem, estimate = _with_attitude(problem, estimate, intervals)
    return problem, state_errors(problem, estimate)._replace(held_out=held_out)


def state_errors(
    problem: Problem, estimate: covariance.Estimate, *, alternative: bool = False
) -> covariance.Estimate:
    """The estimate with the covariance under correlated errors, by the rows that it is from.

    An `alternative`, which asks whether the bias changes at all, is held against what readings
    show: what the world model may lack besides would let a change pass for it.
    """
    rows = problem.rows(estimate.terms).select(problem.used)
    time, blocks = rows.time, list(residuals.cut(rows, estimate.layout))
    clock = covariance.Clock.of(float(time[0]), float(time[-1]), float(np.median(np.diff(time))))
    return add_covariance(problem, estimate, lambda: blocks, clock, alternative=alternative)


def add_covariance(
    problem: Problem,
    estimate: covariance.Estimate,
    source: residuals.Source,
    clock: covariance.Clock,
    *,
    alternative: bool = False,
) -> covariance.Estimate:
    """The estimate with the covariance under correlated errors, by all readings that a source
    gives, as `state_errors` has it; as it is where there are too few to tell the correlation."""
    if clock.count < 120:
        return estimate
    prior = build_prior(problem, estimate.terms, estimate.layout)
    _, jacobian = prior(estimate.solution.params)
    earth_fixed, assumed = problem.direction_e is not None, list[CorrelatedError]()
    if earth_fixed and estimate.terms.splines and not alternative:
        # what the world model lacks for hours, and a spline of the bias takes up unseen
        variance = (EXTERNAL_NT / problem.magnitude) ** 2
        assumed = [CorrelatedError(variance, EXTERNAL_S, covariance.OF_EARTH)]
    return covariance.compute_covariance(
        source, estimate, jacobian.T @ jacobian, clock, earth_fixed=earth_fixed, assumed=assumed
    )


def find_start(problem: Problem) -> Array:
    """Bias and matrix, nine numbers, to start from."""
    if problem.ground is not None:
        return residuals.Layout(SYMMETRIC, 0, 0).start
    rows, asked = np.flatnonzero(problem.used), problem.settings
    if len(rows) > 3000:
        rng = np.random.default_rng(asked.seed)
        rows = np.sort(rng.choice(rows, 3000, replace=False))
    points = problem.samples.field[rows] / problem.magnitude
    known = Known(points, problem.wanted[rows], "full", asked.soft_iron_sd)
    found = maximum_likelihood.estimate(known, robust=asked.robust, seed=asked.seed)
    return found.solution.params


def fit_rows(
    problem: Problem, first: Array | covariance.Estimate, used: Mask, intervals: int
) -> covariance.Estimate:
    """The estimate from some of the rows with so many intervals of the bias in time, from `first`:
    bias and matrix (9,), or an estimate whose terms are the first of these."""
    terms = problem.terms(intervals)
    gauge = SYMMETRIC if problem.direction is None else FREE
    layout = residuals.Layout(gauge, terms.bias_count, terms.matrix_degree + terms.rate)
    params = layout.start
    if isinstance(first, covariance.Estimate):  # bias, the symmetric part of M = R S, its terms
        old, found = first.layout, first.solution.params
        bias, matrix = split(model_basis("full", old.gauge) @ found[: old.constants])
        nine = np.concatenate([bias, pack_symmetric(polar(matrix)[1])])
        layout.biases(params)[:, : old.bias_terms] = old.biases(found)
        if layout.matrix_terms:
            params[-6 * layout.matrix_terms :] = found[-6 * layout.matrix_terms :]
    else:
        nine = first
    params[:9] = nine[:9]
    if layout.gauge == FREE:
        params[9:12] = nine[6:9]
    return refine(problem, problem.rows(terms).select(used), layout, terms, params)


def refine(
    problem: Problem,
    rows: residuals.Rows,
    layout: residuals.Layout,
    terms: Terms,
    params: Array,
) -> covariance.Estimate:
    """The minimum from a near start, noise and correlation of each kind from its residuals."""
    robust = problem.settings.robust
    kinds = residuals.KINDS if problem.direction is not None else residuals.KINDS[:1]
    prior, blocks = build_prior(problem, terms, layout), list(residuals.cut(rows, layout))
    seen = {kind: residuals.find_residuals(rows, kind, params, layout) for kind in kinds}
    sds = dict.fromkeys(kinds, 0.0)
    for _ in range(12):
        noise = {kind: estimate_noise(r, robust, len(params)) for kind, r in seen.items()}
        before, sds = sds, compute_spreads(noise, sds)
        for kind in kinds[1:]:
            sd = noise[kind].sd / _compute_spread_ratio(kind, before, sds)
            noise[kind] = noise[kind]._replace(sd=sd)
        correlation = covariance.compute_mean_correlation(noise)
        channels = [
            leastsq.Channel(
                residuals.residual_pieces(lambda: blocks, kind, layout, sds[kind]),
                of.sd,
                of.loss,
                correlation,
                spread=of.correlation / correlation,
            )
            for kind, of in noise.items()
        ]
        solution = leastsq.solve_together(channels, params, prior=prior, tolerance=1e-2)
        params = solution.params
        parts = np.split(solution.residuals, len(noise))
        seen = dict(zip(noise, parts, strict=True))
        again = {kind: estimate_noise(r, robust, len(params)) for kind, r in seen.items()}
        now = compute_spreads(again, sds)
        if all(abs(_compute_spread_ratio(kind, sds, now) - 1) < 0.02 for kind in kinds):
            break
    return covariance.Estimate(solution, layout, terms, noise, sds, seen, {}, {})


def compute_residuals_of(problem: Problem, estimate: covariance.Estimate, kind: str) -> Array:
    """The residuals of every row, (n,)."""
    rows = problem.rows(estimate.terms)
    sd = 0.0 if kind == "magnitude" else estimate.sds[kind]
    return residuals.find_residuals(rows, kind, estimate.solution.params, estimate.layout, sd)


def rotation_of(estimate: covariance.Estimate) -> Array:
    """The rotation (3, 3) in a free matrix, M = R S."""
    c = estimate.layout.constants
    basis = model_basis("full", estimate.layout.gauge)
    return np.asarray(polar(split(basis @ estimate.solution.params[:c])[1])[0])


def _with_attitude(
    problem: Problem, estimate: covariance.Estimate, intervals: int
) -> tuple[Problem, covariance.Estimate]:
    """The rotation from sensor to attitude by Wahba, then all three kinds of residual together.

    The rotation found is taken into the directions until none is left, so that what remains of it
    in the matrix is small.
    """
    assert problem.direction is not None
    rows = problem.rows(estimate.terms).select(problem.used)
    field = residuals.correct(rows, estimate.solution.params, estimate.layout)
    seen = field / np.linalg.norm(field, axis=1)[:, None]
    aim = problem.direction.aim[problem.used]
    rotation = find_best_rotation(seen, aim, estimate.weight)
    for _ in range(5):
        problem = replace(problem, rotation=rotation)
        estimate = fit_rows(problem, estimate, problem.used, intervals)
        left = rotation_of(estimate)
        if np.abs(left - np.eye(3)).max() < 1e-6:
            break
        rotation = rotation @ left
    return problem, estimate
