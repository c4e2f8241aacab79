"""From an estimate to what is known of it: terms, covariance, shares of the heading's error, and
what the orientations that were seen determine without priors and without the noise's help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.coverage import DOWN
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.one_pass import find_length
from agonic.model.average import (
    Base,
    Prior,
    average,
    average_each,
    list_ways,
    mix,
    solve,
    solve_each,
)
from agonic.model.gram import Stack
from agonic.model.pose import LEAST_NOISE, Explained, Known, Search, find_prior, or_none, pose
from agonic.model.rows import Rows, choose_rows, compute_jacobian
from agonic.model.shares import Level, Share, stand_level, weigh
from agonic.model.term import Errors, Term
from agonic.model.terms import HIDDEN
from agonic.model.terms.ripple import find_ripple
from agonic.model.terms.time import STEP
from agonic.model.unseen import Unseen, predict_unseen

BY_CHANCE = 3.0
"""Standard deviations by which the noise's help may be more than it is on the average."""
_FLOOR = 1e-12


class Held(NamedTuple):
    """The share of priors in the variance of a level heading, its standard error without them,
    degrees, and that of the bias along each axis, (3,), over the radius."""

    share: float
    alone_deg: float
    bias_sd: Array


def find_held(
    rows: Rows, estimate: Estimate, stacks: Sequence[Stack], base: Base, prior: Prior, level: Array
) -> Held:
    """What holds the heading where readings do not.

    With the information M = G + P, P that of priors and N what noise pretends to, the share is
    hᵀM⁻¹(P + N)M⁻¹h/hᵀM⁻¹h, and the error alone that of G − N. In circles and planes G is of full
    rank by noise only. N is found for white noise, of J at footpoints that a further draw of noise
    moves along the surface less J at footpoints, beside the same of J; its part in G = LLᵀ is the
    same where noise has a memory: L L_w⁻¹ N_w L_w⁻ᵀ Lᵀ.

    Parameters: `level` (h, m) derivatives of the heading.
    """
    m = len(prior.pull)
    inverse = base.inverse[:m, :m]
    whole = np.linalg.inv(inverse)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(whole), 1e-300))
    both = np.outer(scale, scale)
    seen, by_noise = _add_up_white(rows, estimate, stacks)
    chance = 1.0 + BY_CHANCE / np.sqrt(max(len(rows.weights), 1))
    held = prior.information * both
    turned = _power(whole * both - held, 0.5) @ _power(seen * both, -0.5)
    held = held + turned @ (by_noise * both) @ turned.T * chance
    values, axes = np.linalg.eigh(whole * both - held)
    alone = (axes / np.maximum(values, _FLOOR * values[-1])) @ axes.T
    ways = level * scale
    moved = np.linalg.solve(whole * both, ways.T)
    share = float(np.sum((held @ moved) * moved)) / max(float(np.sum(ways.T * moved)), 1e-300)
    variance = float(np.einsum("hi,ij,hj->", ways, alone, ways)) / len(level)
    bias_sd = np.sqrt(np.maximum(np.diag(alone)[:3], 0.0)) * scale[:3] / rows.radius
    return Held(min(share, 1.0), float(np.sqrt(max(variance, 0.0))), bias_sd)


def _power(information: Array, power: float) -> Array:
    """A power of information that may be singular, by its axes; none along those not seen."""
    values, axes = np.linalg.eigh(information)
    seen = values > _FLOOR**2 * values[-1]
    return np.asarray((axes[:, seen] * values[seen] ** power) @ axes[:, seen].T)


def _add_up_white(rows: Rows, estimate: Estimate, stacks: Sequence[Stack]) -> tuple[Array, Array]:
    """Information (m, m) of the footpoints for white noise, and that which noise pretends to."""
    params, points, roots = estimate.solution.params, rows.footpoints.points, np.sqrt(rows.weights)
    m = len(params)
    blur = estimate.noise["magnitude"].sd * np.random.default_rng(0).normal(size=points.shape)
    normal = stacks[0].columns[:3].T
    normal = normal / np.maximum(find_length(normal), 1e-300)[:, None]
    blur -= normal * np.sum(blur * normal, axis=1, keepdims=True)
    blurred = rows.footpoints._replace(points=points + blur)
    seen, by_noise = np.zeros((m, m)), np.zeros((m, m))
    for name, columns in stacks:
        standing, variance = columns[:m], estimate.noise[name].sd ** 2
        change = compute_jacobian(blurred, name, params).T * roots + standing
        seen += standing @ standing.T / variance
        by_noise += change @ change.T / variance
    return seen, by_noise


ATTITUDE_MEMORY = 0.5
"""Errors of roll, pitch and heading that last move the bias by this share of them, about."""
FARTHEST_DEG = 10.0
"""Of heading: as far as terms may move the estimate; algebra about a fit holds no farther."""
LEAST_SHARE = 0.01
"""Of the variance of the heading: smaller shares are not told."""
SOFT_IRON_SDS = np.geomspace(0.003, 0.3, 7)
"""Of soft iron over the mean gain, from a bare sensor to one beside steel."""
_SOFT_IRON_FREEDOM = 5  # a symmetric matrix but for its mean gain
_FREE = Held(0.0, 0.0, np.zeros(3))


class Posterior(NamedTuple):
    """Parameters (m,) averaged over the sizes of all terms, their covariance, what makes it.

    `shares` by term, the largest first; `noise_deg` is that of noise and coverage, `memory_deg` of
    disturbances with memory whose cause is not known, `left` what terms leave, noise and memory,
    and `bias_sd` (3,), over the radius, `considered_deg` of errors that all rows share; `held` by
    priors; `unseen` blocks.
    """

    params: Array
    covariance: Array
    shares: tuple[Share, ...]
    noise_deg: float
    memory_deg: float
    left: float
    considered_deg: Mapping[str, float]
    bias_sd: Array
    held: Held
    unseen: Unseen

    def average(self, estimate: Estimate) -> Estimate:
        """The estimate with parameters and covariance averaged over the sizes of all terms."""
        known = estimate.solution._replace(params=self.params, covariance=self.covariance)
        return estimate._replace(solution=known)

    def list_shares(self) -> Mapping[str, float]:
        """The standard error of a level heading by what makes it, degrees, the largest first."""
        shares = {"noise and coverage": self.noise_deg, "correlated noise": self.memory_deg}
        shares |= self.considered_deg
        for one in self.shares:
            shares[one.term.name] = float(np.hypot(shares.get(one.term.name, 0.0), one.heading_deg))
        total = sum(value**2 for value in shares.values())
        told = {name: value for name, value in shares.items() if value**2 > LEAST_SHARE * total}
        return dict(sorted(told.items(), key=lambda one: -one[1]))


class Scene(NamedTuple):
    """What the posterior is found from: rows, terms, level headings, and what explains the
    residuals; `soft_iron` is the problem of all rows where the size of soft iron is unknown too."""

    rows: Rows
    estimate: Estimate
    known: Sequence[Known]
    level: Level
    search: Search
    found: Explained
    soft_iron: Problem | None


class Way(NamedTuple):
    """One way to explain the residuals: how far it moves the parameters, their covariance, that of
    noise and coverage alone, and the share of each group."""

    shift: Array
    covariance: Array
    noise: Array
    shares: list[Share]


@or_none
def find_posterior(
    problem: Problem,
    estimate: Estimate,
    time: Array | None,
    origin: Array,
    *,
    inclination_deg: float = 60.0,
    down: Array = DOWN,
    considered: Mapping[str, Array] | None = None,
    shrink: bool = False,
    alone: bool = False,
    terms: Sequence[Term] = (),
) -> Posterior | None:
    """What is known of an estimate; None where its rows are too few to tell.

    Where what is left of any of several channels has a memory, terms would explain errors of the
    attitude, which last: they are sought in the magnitude `alone`, beside all that the estimate is
    known by.

    Parameters: `time` (n,) of the rows of the problem, `origin` (3,) to be added to its points for
    readings from zero; `inclination_deg` and `down` (3,) of a level heading; `considered` by how
    much an error of one standard deviation that no row shows moves the parameters, by name;
    `shrink` where the size of soft iron is a further unknown, by evidence; `terms` beside the
    hidden ones.
    """
    rows = choose_rows(problem, estimate, time, origin)
    if rows is None or not np.isfinite(rows.footpoints.points).all():
        return None
    level = stand_level(rows, estimate.solution.params, origin, inclination_deg, down)
    at = None if alone else _explain_rows(rows, estimate, level, None, terms)
    if len(problem.channels) > 1 and (at is None or at.found.memory.any()):
        alone = True
        at = _explain_rows(rows, estimate, level, estimate.solution.covariance, terms)
    if at is None:
        return None
    at = at._replace(soft_iron=problem if shrink else None)
    known = _gather(at, considered or {}, priors_alone=not alone)
    return known if np.isfinite(known.covariance).all() else None  # an axis that never moved


@or_none
def _explain_rows(
    rows: Rows, estimate: Estimate, level: Level, known: Array | None, terms: Sequence[Term]
) -> Scene | None:
    """What explains the residuals, with ripples if there are any; of the magnitude alone where the
    `known` covariance of the estimate is by more than that."""
    search, seen = pose(rows, estimate, (*HIDDEN, *terms), known)
    found = search.explain(np.array([estimate.noise[one.name].sd for one in search.stacks]))
    left = search.leave(found)[0]
    left = left / max(float(left.std()), LEAST_NOISE)
    rows = rows._replace(seen=rows.seen._replace(blur=float(found.sds[0])))
    step = rows.problem.rounding * 12**0.5 / rows.radius
    waves = find_ripple(rows.seen, left, search.stacks[0].columns[:3], step)
    if waves is not None:
        search, seen = pose(rows, estimate, (*HIDDEN, *terms, waves), known)
        found = search.explain(found.sds)
    return Scene(rows, estimate, seen, level, search, found, None)


def _centre(at: Scene, base: Base, there: Mapping[int, float]) -> tuple[Array, Array]:
    """How far the base moves the parameters, and their covariance; averaged over how large soft
    iron is, by the evidence of each size, where that is unknown.

    The larger it may be, the less the prior holds, and the more its normalisation costs.
    """
    m = len(at.search.prior.pull)
    if at.soft_iron is None:
        return base.estimate[:m].copy(), base.inverse[:m, :m].copy()
    params = at.estimate.solution.params
    others, one = (find_prior(at.soft_iron, params, sd) for sd in (None, 1.0))
    by_size = SOFT_IRON_SDS[:, None] ** -2.0  # what is known of soft iron goes by its square
    priors = Prior(
        others.information + by_size[:, None] * (one.information - others.information),
        others.pull + by_size * (one.pull - others.pull),
        others.off + by_size[:, 0] * (one.off - others.off),
    )
    _, inverses, estimates, evidence = solve_each(at.found.gram, priors, at.search.groups, there)
    evidence = evidence - _SOFT_IRON_FREEDOM * np.log(SOFT_IRON_SDS)
    weights = np.exp(evidence - evidence.max())
    return mix(weights / weights.sum(), estimates[:, :m], inverses[:, :m, :m])


def _explain(at: Scene, there: Mapping[int, float], base: Base) -> Way:
    """Parameters and covariance averaged over the sizes of all terms, beside those `there`."""
    gram, groups, prior, share = at.found.gram, at.search.groups, at.search.prior, at.rows.share
    m = len(prior.pull)
    shift, noise = _centre(at, base, there)
    noise *= share * compute_widening(max(len(at.rows.weights) - m, 1)) ** 2
    if share < 1.0:  # some rows alone: what they say of terms counts, not where they are best
        shift = shift - solve(gram, prior, groups, {}).estimate[:m]
    absent, shares = np.zeros_like(noise), []
    for i, sized in enumerate(average_each(gram, base, groups)):
        if i in there:
            sized = average(gram, solve(gram, prior, groups, there, i), groups[i])
        else:
            shift = shift - sized.alias[:m] @ sized.mean
            absent += sized.spread[:m, :m]
        term = at.known[i].term if i < len(at.known) else STEP
        errors, row = _find_errors(at, i) if i in there else (None, None)
        one = weigh(term, sized, at.level, errors)
        if row is not None:
            one = one._replace(row=row, size=float(np.sqrt(np.trace(sized.square))))
        shares.append(one)
    unseen = [one for i, one in enumerate(shares) if i not in there]
    part = _weigh_absent(at.level.spread(noise), unseen)
    shares = [one if i in there else one.reduce(part) for i, one in enumerate(shares)]
    return Way(shift, noise + part * absent, noise, shares)


def _weigh_absent(variance: float, shares: Sequence[Share]) -> float:
    """The part of their variances v by which terms that are not there count beside that of a level
    heading, σ₀²: the mean of standard errors σ₀ + Σ p (√(σ₀² + v/p) − σ₀), by chances p."""
    added = np.array([one.heading_deg**2 for one in shares])
    chance = 1.0 / (1.0 + np.exp(-np.array([one.odds for one in shares])))
    if not 0.0 < added.sum() < np.inf:
        return 1.0
    more = np.sqrt(chance**2 * variance + chance * added) - chance * np.sqrt(variance)
    return min(float(((np.sqrt(variance) + more.sum()) ** 2 - variance) / added.sum()), 1.0)


def _explain_all(at: Scene) -> Way:
    """The same averaged over which of the terms that err at rest it is, where they hardly differ in
    the residuals."""
    bends = {i for i, one in enumerate(at.known) if one.term.at_rest}
    found, fixed = at.found, (at.found.gram, at.search.prior, at.search.groups)
    listed = list_ways(*fixed, found.there, bends)
    first = _explain(at, found.there, found.base)
    if len(listed) == 1:
        return first
    more = [_explain(at, there, solve(*fixed, there)) for _, there in listed[1:]]
    ways, chances = [first, *more], np.array([chance for chance, _ in listed])
    shift, covariance = mix(
        chances,
        np.array([one.shift for one in ways]),
        np.array([one.covariance for one in ways]),
    )
    apart = np.sqrt([at.level.spread(np.outer(d, d)) for d in (w.shift - shift for w in ways)])
    shares = []
    for i, each in enumerate(zip(*(one.shares for one in ways), strict=True)):
        own = apart if i in bends and i in found.there else np.zeros(len(ways))
        by = np.array([[one.heading_deg**2, one.at_rest_deg**2] for one in each])
        heading, rest = np.sqrt(chances @ by)
        whole = float(np.hypot(heading, np.sqrt(chances @ own**2)))
        shares.append(each[0]._replace(heading_deg=whole, at_rest_deg=float(rest)))
    return Way(shift, covariance, first.noise, shares)


def _gather(at: Scene, considered: Mapping[str, Array], *, priors_alone: bool) -> Posterior:
    """Parameters, covariance and shares, with what no row shows.

    Unless `priors_alone` are beside the rows, nothing is said of what priors hold.
    """
    rows, level, search, found = at.rows, at.level, at.search, at.found
    shift, covariance, noise, shares = _explain_all(at)
    for move in considered.values():
        covariance += np.outer(move, move)
    far = level.spread(np.outer(shift, shift)) > FARTHEST_DEG**2
    if far or not priors_alone:  # rows of one channel move no estimate that others hold
        covariance, shift = covariance + np.outer(shift, shift), np.zeros_like(shift)
    by_channel = np.array([1.0, *[ATTITUDE_MEMORY**2] * (len(found.memory) - 1)])
    memory = float(by_channel @ found.memory) / rows.radius**2
    at_rest = sum(one.at_rest_deg**2 for one in shares)
    covariance[:3, :3] += (at_rest / level.per_error + memory) * rows.radius**2 * np.eye(3)
    own = level.by_params - (level.by_params.mean(axis=0) if search.stacks[1:] else 0.0)
    counts = len(found.sds) * found.blocks.rows
    at_footpoints = (rows, at.estimate, search.stacks, found.base, search.prior, own)
    return Posterior(
        params=at.estimate.solution.params + shift,
        covariance=covariance,
        shares=tuple(sorted(shares, key=lambda one: -one.heading_deg)),
        noise_deg=float(np.sqrt(level.spread(noise))),
        memory_deg=float(np.sqrt(memory * level.per_error)),
        left=float(np.sqrt(found.sds[0] ** 2 + found.memory[0])) / rows.radius,
        considered_deg={
            name: float(np.sqrt(np.mean((level.by_params @ move) ** 2)))
            for name, move in considered.items()
        },
        bias_sd=np.sqrt(np.diag(covariance)[:3]) / rows.radius,
        held=find_held(*at_footpoints) if priors_alone else _FREE,
        unseen=predict_unseen(found.split(found.base), counts, found.base, level.by_params),
    )


def _find_errors(at: Scene, i: int) -> tuple[Errors, int | None]:
    """The errors of a group; of a step those of its moment, and the row where it is."""
    if i < len(at.known):
        return at.known[i].errors, None
    counts = at.found.blocks.rows
    before = int(counts[: i - len(at.known) + 1].sum())
    n = int(counts.sum())
    height = np.where(np.arange(n) >= before, before / n, before / n - 1.0)
    return Errors(np.asarray(height[None, None])), int(at.rows.seen.rows[before])
