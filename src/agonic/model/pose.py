"""Rows and terms as a search: the columns of every channel, priors, and groups of unknowns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import NamedTuple, ParamSpec, TypeVar

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.model.average import Group, Prior
from agonic.model.gram import Stack, count_blocks
from agonic.model.memory import Search
from agonic.model.rows import Rows, stack_columns
from agonic.model.term import Errors, Term
from agonic.model.terms.time import STEP

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
