"""What was recorded beside the field, against what no column names: which explains the residuals.

Each set of columns is a term like all others, and competes with them in one likelihood.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem, compute_residuals
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.model.average import Base, rate, solve
from agonic.model.gram import fit_filter
from agonic.model.pose import Explained, Search, or_none, pose
from agonic.model.rows import Rows, choose_rows
from agonic.model.term import Errors, Seen, Term, along_time
from agonic.model.terms import HIDDEN
from agonic.model.unseen import leave_out

ODDS = 0.5
"""How often one of the columns of a log that could disturb does."""
HUBER = 1.345
"""Of the noise: beyond it a residual counts by its size (Huber 1981)."""
CHANCE = 0.05
"""How often a log without any disturber may have one taken, whatever the number of candidates."""
RECORDED = "recorded"
_WEIGHINGS = 2


class Weighed(NamedTuple):
    """Sets of columns beside hidden terms: the log-odds of each and its likeliest size, (s,); the
    search, what it found, the hidden terms that are there, and the logarithms of what these leave
    of each unseen block, (b,)."""

    odds: Array
    sizes: Array
    search: Search
    found: Explained
    hidden: Mapping[int, float]
    left: Array

    def measure_left(self, i: int) -> Array:
        """What is left of the squares of each block by the fit to all others, with a set over
        without it, as logarithms (b,)."""
        there = {**self.hidden, i: float(self.sizes[i])}
        joined = solve(self.found.gram, self.search.prior, self.search.groups, there)
        return _log_squares(self.found, joined) - self.left

    @or_none
    def find_sure(self) -> int | None:
        """The set that explains most and surely something, None where none does.

        It is sure where it is likely with the memory that the noise is left with too, or where
        unseen blocks have surely less.
        """
        count = len(self.odds)
        shown = [i for i in self.found.there if i < count]
        best = max(shown, key=lambda i: self.odds[i], default=None)
        if best is None or is_surely_less(self.measure_left(best), count):
            return best
        filters = [fit_filter(one) for one in self.search.leave(self.found)]
        if all(len(by) == 1 for by in filters):
            return best
        again, _ = self.search.settle(filters, self.found.sds)
        return best if best in again.there else None


def _log_squares(found: Explained, base: Base) -> Array:
    return np.asarray(np.log(leave_out(found.split(base), base).square))


def is_surely_less(left: Array, tries: int) -> bool:
    """Whether the mean of logarithms (b,) is below zero by more than chance makes of the best of so
    many tries (Student's t), whatever the memory of the noise within blocks."""
    surely = float(stdtrit(len(left) - 1, 1.0 - CHANCE / tries))
    return bool(-left.mean() > surely * left.std(ddof=1) / np.sqrt(len(left)))


@or_none
def weigh_recorded(
    problem: Problem, estimate: Estimate, time: Array | None, origin: Array, sets: Sequence[Array]
) -> Weighed | None:
    """Each set of columns beside hidden terms, without the other sets.

    Noise is white: one with memory explains much of a disturber whose shape is not exact.

    Parameters as in `find_posterior`, and sets of columns (n, k); None where the rows are too few
    to tell.
    """
    terms = [_make_term(one, len(sets)) for one in sets]
    rows = _choose(problem, estimate, time, origin)
    if rows is None:
        return None
    search, found = _explain(rows, estimate, [*terms, *HIDDEN], white=True)
    hidden = {i: size for i, size in found.there.items() if i >= len(sets)}
    base = solve(found.gram, search.prior, search.groups, hidden)
    odds, sizes = rate(found.gram, base, search.groups[: len(sets)])
    return Weighed(odds, sizes, search, found, hidden, _log_squares(found, base))


@or_none
def measure_slopes(
    problem: Problem,
    estimate: Estimate,
    time: Array | None,
    origin: Array,
    slopes: Array,
    *,
    white: bool,
) -> tuple[Array, Array] | None:
    """What columns (n, k) add per unit to a fit, (3 k,) with its covariance, beside hidden terms
    and `white` noise or any; None where the rows are too few to tell."""
    rows = _choose(problem, estimate, time, origin)
    if rows is None:
        return None
    search, found = _explain(rows, estimate, [_make_term(slopes, 1), *HIDDEN], white=white)
    free = {**{i: size for i, size in found.there.items() if i > 0}, 0: 1e3}
    base = solve(found.gram, search.prior, search.groups, free)
    at = np.isin(base.columns, search.groups[0].columns)
    scale = np.repeat(rows.radius / _spread(slopes), 3)
    return base.estimate[at] * scale, base.inverse[np.ix_(at, at)] * np.outer(scale, scale)


def _choose(problem: Problem, estimate: Estimate, time: Array | None, origin: Array) -> Rows | None:
    """All rows: what a disturber does stands out of a fit without it like an outlier."""
    every = estimate._replace(weights=np.ones(len(problem.points)))
    return choose_rows(problem, every, time, origin)


def _explain(
    rows: Rows, estimate: Estimate, terms: Sequence[Term], *, white: bool
) -> tuple[Search, Explained]:
    """The terms that explain the residuals, with Huber's weights for what they leave."""
    params, channels = estimate.solution.params, rows.problem.channels
    sds = np.array([estimate.noise[one].sd for one in channels])
    left = [compute_residuals(rows.problem, one, params) for one in channels]
    recorded = {i for i, one in enumerate(terms) if one.name == RECORDED}
    whole, _ = pose(rows, estimate, terms, None)
    for _ in range(_WEIGHINGS):
        over = np.max([np.abs(one) / sd for one, sd in zip(left, sds, strict=True)], axis=0)
        roots = np.sqrt(np.minimum(1.0, HUBER / np.maximum(over, 1e-300)))
        search = whole.weigh(roots)
        found = search.explain_white(sds)[0] if white else search.explain(sds)
        if recorded.isdisjoint(found.there):
            break
        left, sds = [one / roots for one in search.leave(found)], found.sds
    return search, found


def _make_term(columns: Array, among: int) -> Term:
    scaled = (columns - columns.mean(axis=0)) / _spread(columns)
    return Term(
        name=RECORDED,
        errors=partial(_pick, columns=scaled),
        scale=1e-2,
        most=100.0,
        odds=ODDS / among,
        source="motor currents some centimetres off, 500 nT",
        what="the readings move with what was recorded beside them",
        move="calibrate with it",
    )


def _spread(columns: Array) -> Array:
    return np.asarray(np.maximum(columns.std(axis=0), 1e-300))


def _pick(seen: Seen, *, columns: Array) -> Errors:
    """The columns (n, k) of the log at the rows that are seen."""
    return along_time(columns[seen.rows].T)
