"""From an estimate to what is known of it: terms, covariance, and shares of the heading's error."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import NamedTuple, ParamSpec

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.coverage import DOWN
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.noise.student import compute_widening
from agonic.model.average import Base, Group, Prior, average, solve
from agonic.model.determinacy import Held, find_held
from agonic.model.gram import Stack, count_blocks
from agonic.model.level import Level, stand_level
from agonic.model.memory import Explained, Search
from agonic.model.rows import Rows, choose_rows, stack_columns
from agonic.model.shares import Share, weigh
from agonic.model.term import Errors, Term
from agonic.model.terms import HIDDEN
from agonic.model.terms.ripple import find_ripple
from agonic.model.terms.time import STEP
from agonic.model.unseen import Unseen, predict_unseen

ATTITUDE_MEMORY = 0.5
"""Errors of roll, pitch and heading that last move the bias by this share of them, about."""
FARTHEST_DEG = 10.0
"""Of heading: as far as terms may move the estimate; algebra about a fit holds no farther."""
SOFT_IRON_SDS = np.geomspace(0.003, 0.3, 7)
"""Of soft iron over the mean gain, from a bare sensor to one beside steel."""
_SOFT_IRON_FREEDOM = 5  # a symmetric matrix but for its mean gain


_FREE = Held(0.0, 0.0)


class Posterior(NamedTuple):
    """Parameters (m,) averaged over the sizes of all terms, their covariance, what makes it.

    `shares` by term, the largest first; `noise_deg` is that of noise and coverage, `memory_deg` of
    disturbances with memory whose cause is not known, `attitude_lasts` where errors of dip or
    azimuth have one, `left` the noise that terms leave, over the radius, `considered_deg` of errors
    that all rows share; `held` by priors; `unseen` blocks.
    """

    params: Array
    covariance: Array
    shares: tuple[Share, ...]
    noise_deg: float
    memory_deg: float
    attitude_lasts: bool
    left: float
    considered_deg: Mapping[str, float]
    held: Held
    unseen: Unseen


class Known(NamedTuple):
    """A term with its errors in the rows."""

    term: Term
    errors: Errors


P = ParamSpec("P")


def _or_none(find: Callable[P, Posterior | None]) -> Callable[P, Posterior | None]:
    """None for readings that determine nothing: other findings say why."""

    @wraps(find)
    def call(*args: P.args, **given: P.kwargs) -> Posterior | None:
        try:
            return find(*args, **given)
        except np.linalg.LinAlgError:
            return None

    return call


@_or_none
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
    known: Array | None = None,
) -> Posterior | None:
    """What is known of an estimate; None where its rows are too few to tell.

    Parameters: `time` (n,) of the rows of the problem, `origin` (3,) to be added to its points for
    readings from zero; `inclination_deg` and `down` (3,) of a level heading; `considered` by how
    much an error of one standard deviation that no row shows moves the parameters, by name;
    `shrink` where the size of soft iron is a further unknown, by evidence; `known` the covariance
    of the estimate where more than rows tell it: then terms are sought in the magnitude alone.
    """
    rows = choose_rows(problem, estimate, time, origin)
    if rows is None or not np.isfinite(rows.feet.points).all():
        return None
    search, seen = _pose(rows, estimate, HIDDEN, known)
    found = search.explain(np.array([estimate.noise[one.name].sd for one in search.stacks]))
    left = search.leave(found)[0] / found.sds[0]
    waves = find_ripple(rows.seen, left, search.stacks[0].columns[:3])
    if waves is not None:
        search, seen = _pose(rows, estimate, (*HIDDEN, waves), known)
        found = search.explain(found.sds)
    level = stand_level(rows, estimate.solution.params, origin, inclination_deg, down)
    base = solve(found.gram, search.prior, search.groups, found.there)
    centre = (
        _shrink(problem, estimate, search, found)
        if shrink
        else _centre(base, len(search.prior.pull))
    )
    made = (rows, estimate, seen, level, search, found, base, centre, considered or {})
    return _gather(*made, priors_alone=known is None)


def _pose(
    rows: Rows, estimate: Estimate, terms: Sequence[Term], covariance: Array | None
) -> tuple[Search, list[Known]]:
    """Columns, priors and groups of unknowns, with the errors of every term that rows can tell."""
    made = [(term, term.errors(rows.seen)) for term in terms]
    known = [Known(term, errors) for term, errors in made if errors is not None]
    problem, params = rows.problem, estimate.solution.params
    channels = problem.channels if covariance is None else ("magnitude",)
    stacks = stack_columns(rows, estimate, [one.errors for one in known], channels)
    prior = _find_prior(problem, params, problem.soft_iron_sd)
    if covariance is not None:
        prior = _hold(covariance, stacks[0], estimate.noise["magnitude"].sd, len(params))
    groups, at = [], len(params)
    for term, errors in known:
        columns = np.arange(at, at + errors.unknowns)
        groups.append(Group(term.name, columns, term.scale, term.odds, term.most))
        at += errors.unknowns
    places = count_blocks(len(rows.weights)) - 1
    for k in range(places):
        columns = np.arange(at + 3 * k, at + 3 * k + 3)
        groups.append(Group(STEP.name, columns, STEP.scale, STEP.odds / places, STEP.most))
    return Search(stacks, prior, groups, rows.radius), known


def _find_prior(problem: Problem, params: Array, soft_iron_sd: float | None) -> Prior:
    given = problem.prior(soft_iron_sd)
    if given is None:
        return Prior(np.zeros((len(params), len(params))), np.zeros(len(params)), 0.0)
    residuals, jacobian = given(params)
    return Prior(jacobian.T @ jacobian, -jacobian.T @ residuals, float(residuals @ residuals))


def _hold(covariance: Array, stack: Stack, sd: float, m: int) -> Prior:
    """What more than the rows of one channel tells, as a prior: the covariance's information less
    theirs."""
    size = np.sqrt(np.diag(covariance))
    scale = np.outer(size, size)
    own = stack.columns[:m] @ stack.columns[:m].T / sd**2
    values, axes = np.linalg.eigh(np.linalg.inv(covariance / scale) - own * scale)
    more = (axes * np.maximum(values, 0.0)) @ axes.T / scale
    return Prior(more, np.zeros(m), 0.0)


def _centre(base: Base, m: int) -> tuple[Array, Array]:
    """How far the base moves the parameters, and their covariance."""
    return base.estimate[:m].copy(), base.inverse[:m, :m].copy()


def _shrink(
    problem: Problem, estimate: Estimate, search: Search, found: Explained
) -> tuple[Array, Array]:
    """The same averaged over how large soft iron is, by the evidence of each size.

    The larger it may be, the less the prior holds, and the more its normalisation costs.
    """
    bases, evidence = [], []
    for sd in SOFT_IRON_SDS:
        prior = _find_prior(problem, estimate.solution.params, float(sd))
        base = solve(found.gram, prior, search.groups, found.there)
        bases.append(_centre(base, len(prior.pull)))
        evidence.append(base.evidence - _SOFT_IRON_FREEDOM * np.log(sd))
    weights = np.exp(np.array(evidence) - max(evidence))
    weights /= weights.sum()
    mean = np.asarray(sum(w * move for w, (move, _) in zip(weights, bases, strict=True)))
    covariance = np.zeros((len(mean), len(mean)))
    for w, (move, own) in zip(weights, bases, strict=True):
        covariance += w * (own + np.outer(move - mean, move - mean))
    return mean, covariance


def _gather(
    rows: Rows,
    estimate: Estimate,
    known: Sequence[Known],
    level: Level,
    search: Search,
    found: Explained,
    base: Base,
    centre: tuple[Array, Array],
    considered: Mapping[str, Array],
    *,
    priors_alone: bool,
) -> Posterior:
    """Parameters and covariance averaged over every term, and the shares of each.

    Unless `priors_alone` are beside the rows, nothing is said of what priors hold.
    """
    gram, m = found.gram, len(search.prior.pull)
    freedom = max(len(rows.weights) - m, 1)
    shift, covariance = centre[0], centre[1] * rows.share * compute_widening(freedom) ** 2
    if rows.share < 1.0:  # some rows alone: what they say of terms counts, not where they are best
        shift = shift - solve(gram, search.prior, search.groups, {}).estimate[:m]
    noise_deg = float(np.sqrt(level.spread(covariance)))
    shares = []
    for i, group in enumerate(search.groups):
        there = i in found.there
        beside = base
        if there:
            others = {k: size for k, size in found.there.items() if k != i}
            beside = solve(gram, search.prior, search.groups, others)
        sized = average(gram, beside, group)
        alias = sized.alias[:m]
        if not there:
            shift = shift - alias @ sized.mean
            covariance += alias @ sized.covariance @ alias.T
        term, errors, row = _find_errors(known, i, found, rows)
        share = weigh(term, errors, sized, alias, level, there=there)
        if there and row is not None:
            share = share._replace(row=row, size=float(np.sqrt(np.trace(sized.square))))
        shares.append(share)
    for move in considered.values():
        covariance += np.outer(move, move)
    far = level.spread(np.outer(shift, shift)) > FARTHEST_DEG**2
    if far or not priors_alone:  # rows of one channel move no estimate that others hold
        covariance, shift = covariance + np.outer(shift, shift), np.zeros(m)
    by_channel = np.array([1.0, *[ATTITUDE_MEMORY**2] * (len(found.memory) - 1)])
    memory = float(by_channel @ found.memory) / rows.radius**2
    at_rest = sum(one.at_rest_deg**2 for one in shares)
    covariance[:3, :3] += (at_rest / level.per_error + memory) * rows.radius**2 * np.eye(3)
    channels = [one.name for one in search.stacks]
    own = level.by_params - (level.by_params.mean(axis=0) if search.stacks[1:] else 0.0)
    return Posterior(
        params=estimate.solution.params + shift,
        covariance=covariance,
        shares=tuple(sorted(shares, key=lambda one: -one.heading_deg)),
        noise_deg=noise_deg,
        memory_deg=float(np.sqrt(memory * level.per_error)),
        attitude_lasts=bool(found.memory[1:].any()),
        left=float(found.sds[0]) / rows.radius,
        considered_deg={
            name: float(np.sqrt(np.mean((level.by_params @ move) ** 2)))
            for name, move in considered.items()
        },
        held=find_held(rows, estimate, channels, base, search.prior, own)
        if priors_alone
        else _FREE,
        unseen=predict_unseen(found.blocks, base, level.by_params),
    )


def _find_errors(
    known: Sequence[Known], i: int, found: Explained, rows: Rows
) -> tuple[Term, Errors, int | None]:
    """A group's term and its errors; of a step those of its moment, and the row where it is."""
    if i < len(known):
        return known[i].term, known[i].errors, None
    counts = found.blocks.rows
    before = int(counts[: i - len(known) + 1].sum())
    n = int(counts.sum())
    height = np.where(np.arange(n) >= before, before / n, before / n - 1.0)
    return STEP, Errors(np.asarray(height[:, None, None])), int(rows.seen.rows[before])
