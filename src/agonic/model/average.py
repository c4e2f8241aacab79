"""How large each term is, by restricted likelihood, and what that leaves of the parameters.

Everything is algebra on cross-products G = [A Z r]ᵀ[A Z r] over the noise. A base holds the
parameters, under their priors, and the terms that are there; of one further term with the columns
Z, S = ZᵀZ and s = Zᵀr beside the base, S = U Λ Uᵀ and q = Uᵀs, the likelihood of the size τ is

    L(τ) = ½ Σ_i [q_i² τ²/(1 + τ² λ_i) − log(1 + τ² λ_i)],

and its unknowns have the mean U τ²/(1 + τ²Λ) q and the covariance U τ²/(1 + τ²Λ) Uᵀ. The estimate
and its covariance are averages over τ, on a grid, under a half-Cauchy prior.

Source: D. MacKay (1992), Neural Computation 4, 415; A. Gelman (2006), Bayesian Analysis 1, 515.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index

GRID = np.geomspace(0.03, 100.0, 18)
"""Sizes that are tried, over the scale of nature: a step is half a decade, a likelihood's width."""
EVIDENCE = 3.0
"""In log-odds, that a term is there: 20 to 1."""
DOUBT = 1.0
"""And that it stays, beside terms found later."""
MOST_TERMS = 8
"""Beside each other: what needs more is not described."""
RIVALS = 3.0
"""In log-odds, by which a term may be less likely than another and still be meant: 1 to 20."""
_FIRM = 1e-10  # of a column's own square: so near to others it says nothing
ROUNDING = 1e-9
"""Of squares: less is rounding of the cross-products, not information."""


class Group(NamedTuple):
    """Unknowns of one size: their columns, the scale of τ, how often they are there at all, and how
    large τ is at most, over its scale."""

    name: str
    columns: Index
    scale: float
    odds: float
    most: float


class Prior(NamedTuple):
    """Information (m, m) on the m parameters, its pull (m,) from where they are, and by how much it
    is off there, χ²."""

    information: Array
    pull: Array
    off: Array | float


class Base(NamedTuple):
    """Parameters and terms that are there, solved: their columns, (MᵀM)⁻¹, estimate, and the
    log-likelihood but for the noise."""

    columns: Index
    inverse: Array
    estimate: Array
    evidence: float


class Sized(NamedTuple):
    """A term averaged over its size: log-odds that it is there and their best size; mean (k,) and
    covariance (k, k) of its unknowns; `alias` (b, k), by how much each moves what the base holds,
    and the covariance (b, b) of that."""

    odds: float
    size: float
    mean: Array
    covariance: Array
    alias: Array
    spread: Array

    @property
    def square(self) -> Array:
        """E[u uᵀ], (k, k)."""
        return self.covariance + np.outer(self.mean, self.mean)


class _Layout(NamedTuple):
    """Groups by their numbers of unknowns and their sizes: the first unknown of each (g,), the
    group of each unknown (k,), the unknowns of groups of as many, (a, k_a) each; sizes that are
    tried, the first zero, their squares, and logarithms of their prior probabilities, (g, t)."""

    first: Index
    group: Index
    alike: tuple[Index, ...]
    sizes: Array
    square: Array
    log_chance: Array


class _Turned(NamedTuple):
    """Λ (k,) and q (k,) of groups, U of those with as many unknowns, (a, k_a, k_a), and how far
    each unknown moves the base (b, k) that they stand beside."""

    layout: _Layout
    values: Array
    seen: Array
    axes: list[Array]
    alias: Array


def _lay_out(groups: Sequence[Group]) -> _Layout:
    return _lay_out_alike(tuple((len(c), scale, odds, most) for _, c, scale, odds, most in groups))


@lru_cache(maxsize=64)
def _lay_out_alike(groups: tuple[tuple[int, float, float, float], ...]) -> _Layout:
    """Groups by their numbers of unknowns, scales, odds and largest sizes."""
    counts = np.array([count for count, *_ in groups], dtype=np.intp)
    first = np.cumsum(counts) - counts
    alike = [first[counts == k][:, None] + np.arange(k) for k in sorted(set(counts.tolist()))]
    sizes = np.zeros((len(groups), len(GRID) + 1))
    log_chance = np.full(sizes.shape, -np.inf)
    for i, (_, *own) in enumerate(groups):
        tried, chance = _list_sizes(*own)
        sizes[i, : len(tried)], log_chance[i, : len(tried)] = tried, np.log(chance)
    group = np.repeat(np.arange(len(groups)), counts)
    return _Layout(first, group, tuple(alike), sizes, sizes**2, log_chance)


def _list_sizes(scale: float, odds: float, most: float) -> tuple[Array, Array]:
    """Sizes (t,), the first zero, and their prior probabilities."""
    if odds == 1.0:
        return np.array([0.0, scale]), np.array([np.finfo(float).tiny, 1.0])
    ratio = GRID[most * 1.01 >= GRID]
    density = ratio / (1 + ratio**2)  # half-Cauchy over the logarithm
    chance = odds * density / density.sum()
    return np.append(0.0, ratio * scale), np.append(1.0 - odds, chance)


def solve(
    gram: Array,
    prior: Prior,
    groups: Sequence[Group],
    there: Mapping[int, float],
    without: int | None = None,
) -> Base:
    """The base of the parameters and the groups that are `there`, by their sizes; `without` one."""
    one = Prior(prior.information[None], prior.pull[None], np.array([prior.off]))
    kept = {k: size for k, size in there.items() if k != without}
    columns, inverse, estimate, evidence = solve_each(gram, one, groups, kept)
    return Base(columns, inverse[0], estimate[0], float(evidence[0]))


def solve_each(
    gram: Array, priors: Prior, groups: Sequence[Group], there: Mapping[int, float]
) -> tuple[Index, Array, Array, Array]:
    """The columns of a base, and by each of several priors, (s, m, m), (s, m) and (s,), its
    inverses (s, b, b), estimates (s, b) and evidences (s,)."""
    m = priors.pull.shape[1]
    columns = np.concatenate([np.arange(m), *(groups[i].columns for i in there)]).astype(np.intp)
    sizes = np.repeat([*there.values()], [len(groups[i].columns) for i in there])
    shared = gram[columns[:, None], columns]
    shared.flat[m * (len(columns) + 1) :: len(columns) + 1] += sizes**-2.0
    information = np.repeat(shared[None], len(priors.pull), axis=0)
    information[:, :m, :m] += priors.information
    right = np.repeat(gram[None, columns, -1], len(priors.pull), axis=0)
    right[:, :m] += priors.pull
    own = np.diagonal(information, axis1=1, axis2=2)
    least = 1e-24 * own.max(axis=1, keepdims=True)  # what nothing shows stays finite
    scale = 1.0 / np.sqrt(np.maximum(own, least))
    both = scale[:, :, None] * scale[:, None]
    scaled = information * both + _FIRM * np.eye(len(columns))
    inverse = np.linalg.inv(scaled) * both
    estimate = (inverse @ right[:, :, None])[:, :, 0]
    volume = np.linalg.slogdet(scaled)[1] - 2 * np.log(scale).sum(axis=1)
    volume += 2 * float(np.log(sizes).sum())
    fitted = np.sum(right * estimate, axis=1) - gram[-1, -1]
    return columns, inverse, estimate, 0.5 * (fitted - volume - priors.off)


def average(gram: Array, base: Base, group: Group) -> Sized:
    """One term beside a base, averaged over its size."""
    return average_each(gram, base, [group])[0]


def average_each(gram: Array, base: Base, groups: Sequence[Group]) -> list[Sized]:
    """Each term alone beside a base, averaged over its size."""
    one = _stand_beside(gram, base, groups)
    layout, alias, joint = one.layout, one.alias, _weigh_sizes(one)
    weight = np.exp(joint - joint.max(axis=1, keepdims=True))
    weight = (weight / weight.sum(axis=1, keepdims=True))[layout.group]
    square = layout.square[layout.group]
    shrunk = square / (1 + square * one.values[:, None])
    means = shrunk * one.seen[:, None]
    turned = np.sum(weight * means, axis=1)
    apart = (means - turned[:, None]) * np.sqrt(weight)
    by_noise = np.sum(weight * shrunk, axis=1)
    found: list[tuple[int, Sized]] = []
    odds, sizes = _find_best(layout, joint)
    for at, axes in zip(layout.alike, one.axes, strict=True):
        covariance = apart[at] @ np.swapaxes(apart[at], 1, 2)
        covariance[:, range(at.shape[1]), range(at.shape[1])] += by_noise[at]
        covariance = axes @ covariance @ np.swapaxes(axes, 1, 2)
        own, mean = alias[:, at].transpose(1, 0, 2), (axes @ turned[at][:, :, None])[:, :, 0]
        spread = own @ covariance @ np.swapaxes(own, 1, 2)
        i = layout.group[at[:, 0]]
        each = zip(odds[i].tolist(), sizes[i].tolist(), mean, covariance, own, spread, strict=True)
        found += zip(i.tolist(), (Sized(*one) for one in each), strict=True)
    return [one for _, one in sorted(found, key=lambda numbered: numbered[0])]


def choose(
    gram: Array, prior: Prior, groups: Sequence[Group], start: Mapping[int, float]
) -> tuple[dict[int, float], Base]:
    """The groups that the residuals show, by their likeliest sizes, and their base: one by one the
    likeliest, beside which those before it are sized again; from those of a `start` on."""
    there, base = _size_again(gram, prior, groups, dict(start))
    for _ in range(MOST_TERMS - len(there) if groups else 0):
        odds, sizes = rate(gram, base, groups)
        odds[[*there]] = -np.inf
        best = int(np.argmax(odds))
        if odds[best] < EVIDENCE:
            break
        there, base = _size_again(gram, prior, groups, {**there, best: float(sizes[best])})
    return there, base


def _size_again(
    gram: Array, prior: Prior, groups: Sequence[Group], there: dict[int, float]
) -> tuple[dict[int, float], Base]:
    """The groups by their likeliest sizes beside each other, without those that are doubtful, and
    their base."""
    base = solve(gram, prior, groups, there)
    for _ in range(2 * MOST_TERMS):
        if len(there) < 2:
            break
        odds, sizes = rate_there(gram, base, groups, there)
        least = int(np.argmin(odds))
        if odds[least] < DOUBT:
            del there[[*there][least]]
        elif np.array_equal(sizes, [*there.values()]):
            break
        else:
            there = dict(zip(there, sizes.tolist(), strict=True))
        base = solve(gram, prior, groups, there)
    return there, base


def rate_there(
    gram: Array, base: Base, groups: Sequence[Group], there: Mapping[int, float]
) -> tuple[Array, Array]:
    """The log-odds of each group that is there beside all others of a base, and its likeliest size.

    Of its block P of the covariance and its estimate u, information beside the others is
    S = P⁻¹ − τ⁻² and the score s = P⁻¹ u.
    """
    layout = _lay_out([groups[i] for i in there])
    count, sizes = len(layout.group), np.array([*there.values()])
    inverse, estimate = base.inverse[-count:, -count:], base.estimate[-count:]
    squares, score = [], np.empty(count)
    for at in layout.alike:
        whole = np.linalg.inv(inverse[at[:, :, None], at[:, None]])
        score[at] = (whole @ estimate[at][:, :, None])[:, :, 0]
        own = sizes[layout.group[at[:, 0]]][:, None, None]
        squares.append(whole - np.eye(at.shape[1]) / own**2)
    columns = base.columns[-count:]
    none = np.empty((0, count))
    turned = _turn(layout, squares, score, gram[columns, columns], none)
    return _find_best(layout, _weigh_sizes(turned))


def rate(gram: Array, base: Base, groups: Sequence[Group]) -> tuple[Array, Array]:
    """The log-odds (g,) that each group is there beside a base, and its likeliest size."""
    one = _stand_beside(gram, base, groups)
    return _find_best(one.layout, _weigh_sizes(one))


def _stand_beside(gram: Array, base: Base, groups: Sequence[Group]) -> _Turned:
    """Groups, each alone beside a base."""
    layout, columns = _lay_out(groups), np.concatenate([group.columns for group in groups])
    before = gram[base.columns[:, None], columns]
    alias, squares = base.inverse @ before, []
    for at in layout.alike:
        own = columns[at]
        across = before[:, at].transpose(1, 2, 0) @ alias[:, at].transpose(1, 0, 2)
        squares.append(gram[own[:, :, None], own[:, None]] - across)
    score = gram[columns, -1] - base.estimate @ before
    return _turn(layout, squares, score, gram[columns, columns], alias)


def _turn(
    layout: _Layout, squares: Sequence[Array], score: Array, whole: Array, alias: Array
) -> _Turned:
    """S = U Λ Uᵀ and q = Uᵀ s of each group, by S (a, k_a, k_a) of those alike and s (k,); what is
    rounding beside the trace of the `whole` diagonal (k,) is none."""
    values, seen, turns = np.empty(len(score)), np.empty(len(score)), []
    for at, square in zip(layout.alike, squares, strict=True):
        values[at], axes = np.linalg.eigh(square)
        seen[at] = (score[at][:, None] @ axes)[:, 0]
        turns.append(axes)
    blind = values < ROUNDING * np.add.reduceat(whole, layout.first)[layout.group]
    values[blind], seen[blind] = 0.0, 0.0
    return _Turned(layout, values, seen, turns, alias)


def _weigh_sizes(one: _Turned) -> Array:
    """The logarithm of likelihood L(τ) times prior, (g, t)."""
    square = one.layout.square[one.layout.group]
    spread = 1 + square * one.values[:, None]
    likelihood = 0.5 * ((one.seen**2)[:, None] * square / spread - np.log(spread))
    return np.asarray(np.add.reduceat(likelihood, one.layout.first) + one.layout.log_chance)


def _find_best(layout: _Layout, joint: Array) -> tuple[Array, Array]:
    """The log-odds (g,) of all sizes above zero against none, and the likeliest size."""
    likeliest, every = 1 + np.argmax(joint[:, 1:], axis=1), np.arange(len(joint))
    most = joint[every, likeliest]
    rest = np.log(np.exp(joint[:, 1:] - most[:, None]).sum(axis=1)) + most
    return rest - joint[:, 0], layout.sizes[every, likeliest]


def list_ways(
    gram: Array, prior: Prior, groups: Sequence[Group], there: Mapping[int, float], alike: set[int]
) -> list[tuple[float, dict[int, float]]]:
    """The ways to explain the residuals, with their chances: as they are, and with each term that
    is `alike` in place of another, where the residuals hardly tell one from the other."""
    ways = [(1.0, dict(there))]
    for i in alike & set(there):
        odds, sizes = rate(gram, solve(gram, prior, groups, there, i), groups)
        for j in alike - set(there):
            if odds[j] > odds[i] - RIVALS:
                chance = float(np.exp(min(odds[j] - odds[i], RIVALS)))
                way = {**there, j: float(sizes[j])}
                ways.append((chance, {k: size for k, size in way.items() if k != i}))
    total = sum(chance for chance, _ in ways)
    return [(chance / total, way) for chance, way in ways]


def mix(chances: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Mean and covariance of a mixture, by means (s, k) and covariances (s, k, k) of its parts."""
    mean = chances @ means
    apart = means - mean
    return mean, np.tensordot(chances, covariances, 1) + (apart.T * chances) @ apart


def price(groups: Sequence[Group], there: Mapping[int, float]) -> float:
    """The logarithm of the prior of these sizes."""
    layout = _lay_out(groups)
    total = float(layout.log_chance[:, 0].sum())
    for i, size in there.items():
        nearest = np.argmin(np.abs(layout.sizes[i] - size))
        total += float(layout.log_chance[i, nearest] - layout.log_chance[i, 0])
    return total
