"""Rows and terms as a search: the columns of every channel, priors, and groups of unknowns.

What goes together in time is terms, or noise with memory, whichever is likelier.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import NamedTuple, ParamSpec, Self, TypeVar

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.model.average import Base, Group, Prior, choose, price, solve
from agonic.model.gram import (
    WHITE,
    Blocks,
    Stack,
    count_blocks,
    fit_filter,
    whiten,
)
from agonic.model.rows import Rows, stack_columns
from agonic.model.term import Errors, Term
from agonic.model.terms.time import STEP

LEAST_NOISE = 1e-8
"""Of the field, 0.5 pT: what is less is rounding."""
_MOST_SIZINGS = 3
_SETTLED = 0.03  # by more, and twice the log-likelihood of a term moves by a tenth of it


class Explained(NamedTuple):
    """Standard deviations (c,) of what filters leave, by channel; the sizes of the groups that are
    there, and their base; Gram blocks of whitened columns, and their sum over channels and blocks,
    over the noise; what memory adds to the mean square of each channel, (c,)."""

    sds: Array
    there: Mapping[int, float]
    base: Base
    blocks: Blocks
    gram: Array
    memory: Array

    def split(self, base: Base) -> Array:
        """The cross-products of each block, of what a base holds and the residuals."""
        return self.blocks.split(base.columns, self.sds**-2.0)


@dataclass(frozen=True)
class Search:
    """What is known before: the rows' columns, priors, groups of unknowns, and the radius."""

    stacks: list[Stack]
    prior: Prior
    groups: Sequence[Group]
    radius: float

    def weigh(self, roots: Array) -> Self:
        """The same with all rows times the roots (n,) of further weights."""
        stacks = [Stack(one.name, one.columns * roots) for one in self.stacks]
        return replace(self, stacks=stacks)

    def explain(self, sds: Array) -> Explained:
        """The likeliest of three ways: terms beside white noise, terms first and then memory, and
        memory first.

        Of several channels the first way with memory that is likelier than white noise is taken:
        that there is memory is all that is asked of them.

        Parameters: `sds` (c,) of the channels to begin with.
        """
        first, white = self.explain_white(sds)
        tried = [(white, first)]
        starts = [
            [fit_filter(one) for one in self.leave(first)],
            [fit_filter(stack.columns[-1]) for stack in self.stacks],
        ]
        for by in starts:
            if all(len(one) == 1 for one in by):
                continue
            found, likelihood = self.settle(by, sds)
            if len(self.stacks) == 1 or likelihood < white:
                by = [fit_filter(one) for one in self.leave(found)]
                found, likelihood = self.settle(by, sds)
            found = found._replace(memory=self._find_memory(found))
            tried.append((likelihood, found))
            if len(self.stacks) > 1 and likelihood > white and found.memory.any():
                break
        return max(tried, key=lambda one: one[0])[1]

    def _find_memory(self, found: Explained) -> Array:
        """What memory adds to the mean square of each channel, (c,)."""
        most = [np.mean(stack.columns[-1] ** 2) for stack in self.stacks]
        whole = np.minimum([np.mean(one**2) for one in self.leave(found)], most)
        return np.maximum(whole - found.sds**2, 0.0)

    def explain_white(self, sds: Array) -> tuple[Explained, float]:
        """The terms beside white noise, and their log-likelihood."""
        return self.settle([WHITE] * len(self.stacks), sds)

    def settle(self, filters: list[Array], sds: Array) -> tuple[Explained, float]:
        """Terms and standard deviations for given filters, all from one pass over the rows."""
        white = [whiten(one.columns, by) for one, by in zip(self.stacks, filters, strict=True)]
        edges = np.linspace(0, white[0].shape[1], count_blocks(white[0].shape[1]) + 1).astype(int)
        blocks = Blocks(white, edges, self.radius)
        by_channel, n = blocks.add(), float(edges[-1])
        there, sds = dict[int, float](), np.maximum(sds, LEAST_NOISE)
        for _ in range(_MOST_SIZINGS):
            gram = np.tensordot(sds**-2.0, by_channel, axes=1)
            there, base = choose(gram, self.prior, self.groups, there)
            before, sds = sds, _find_sds(by_channel, base, sds, n)
            if np.abs(sds / before - 1).max() < _SETTLED:
                break
        gram = np.tensordot(sds**-2.0, by_channel, axes=1)
        base = solve(gram, self.prior, self.groups, there)
        likelihood = base.evidence - n * float(np.log(sds).sum()) + price(self.groups, there)
        return Explained(sds, there, base, blocks, gram, np.zeros(len(sds))), likelihood

    def leave(self, found: Explained) -> list[Array]:
        """What parameters and terms leave of each channel's residuals."""
        m = len(self.stacks[0].columns) - 1
        weights = np.zeros(found.gram.shape[0] - 1)
        weights[found.base.columns] = found.base.estimate
        shifts = found.blocks.heights @ weights[m:].reshape(-1, 3)
        bias = np.repeat(shifts, np.diff(found.blocks.edges), axis=0).T
        return [
            stack.columns[-1]
            - weights[:m] @ stack.columns[:-1]
            - np.sum(bias * stack.columns[:3], axis=0)
            for stack in self.stacks
        ]


def _find_sds(by_channel: Array, base: Base, sds: Array, n: float) -> Array:
    """The standard deviation of each channel's residuals, less the freedom that the base took."""
    columns, found = base.columns, []
    for sums, sd in zip(by_channel, sds, strict=True):
        own = sums[np.ix_(columns, columns)]
        square = sums[-1, -1] - 2 * sums[columns, -1] @ base.estimate
        square += base.estimate @ own @ base.estimate
        freedom = n - float(np.sum(base.inverse * own)) / sd**2
        found.append(max(np.sqrt(max(float(square), 0.0) / max(freedom, 0.2 * n)), LEAST_NOISE))
    return np.array(found)


P = ParamSpec("P")
T = TypeVar("T")


def or_none(find: Callable[P, T | None]) -> Callable[P, T | None]:
    """None for readings that determine nothing: other findings say why."""

    @wraps(find)
    def call(*args: P.args, **given: P.kwargs) -> T | None:
        try:
            return find(*args, **given)
        except np.linalg.LinAlgError:
            return None

    return call


class Known(NamedTuple):
    """A term with its errors in the rows."""

    term: Term
    errors: Errors


def pose(
    rows: Rows, estimate: Estimate, terms: Sequence[Term], covariance: Array | None
) -> tuple[Search, list[Known]]:
    """Columns, priors and groups of unknowns, with the errors of every term that rows can tell."""
    made = [(term, term.errors(rows.seen)) for term in terms]
    known = [Known(term, errors) for term, errors in made if errors is not None]
    problem, params = rows.problem, estimate.solution.params
    channels = problem.channels if covariance is None else ("magnitude",)
    stacks = stack_columns(rows, estimate, [one.errors for one in known], channels)
    prior = find_prior(problem, params, problem.soft_iron_sd)
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


def find_prior(problem: Problem, params: Array, soft_iron_sd: float | None) -> Prior:
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
