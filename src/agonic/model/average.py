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
_BLIND = 1e-9  # of a term's squares: less is rounding of the cross-products, not information


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
    off: float


class Base(NamedTuple):
    """Parameters and terms that are there, solved: their columns, (MᵀM)⁻¹, estimate, and the
    log-likelihood but for the noise."""

    columns: Index
    inverse: Array
    estimate: Array
    evidence: float


class Sized(NamedTuple):
    """A term averaged over its size: log-odds that it is there and their best size; mean (k,) and
    covariance (k, k) of its unknowns; `alias` (m, k), by how much each moves the parameters."""

    odds: float
    size: float
    mean: Array
    covariance: Array
    alias: Array

    @property
    def square(self) -> Array:
        """E[u uᵀ], (k, k)."""
        return self.covariance + np.outer(self.mean, self.mean)


def solve(gram: Array, prior: Prior, groups: Sequence[Group], there: Mapping[int, float]) -> Base:
    """The base of the parameters and the groups that are `there`, by their sizes."""
    m = len(prior.pull)
    columns = np.concatenate([np.arange(m), *(groups[i].columns for i in there)]).astype(np.intp)
    sizes = np.repeat([*there.values()], [len(groups[i].columns) for i in there])
    information = gram[np.ix_(columns, columns)].copy()
    information[:m, :m] += prior.information
    information[range(m, len(columns)), range(m, len(columns))] += sizes**-2.0
    right = gram[columns, -1].copy()
    right[:m] += prior.pull
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information * np.outer(scale, scale) + _FIRM * np.eye(len(columns))
    inverse = np.linalg.inv(scaled) * np.outer(scale, scale)
    estimate = inverse @ right
    volume = np.linalg.slogdet(scaled)[1] - 2 * np.log(scale).sum() + 2 * np.log(sizes).sum()
    return Base(
        columns,
        inverse,
        estimate,
        0.5 * float(right @ estimate - gram[-1, -1] - volume - prior.off),
    )


def average(gram: Array, base: Base, group: Group) -> Sized:
    """One term beside a base, averaged over its size."""
    values, axes, seen, moved = _beside(gram, base, group)
    sizes, chance = _grid(group)
    square = sizes[:, None] ** 2
    likelihood = _likelihood(values, seen, square)
    weight = np.exp(likelihood + np.log(chance) - (likelihood + np.log(chance)).max())
    weight /= weight.sum()
    shrunk = square / (1 + square * values)
    means = shrunk * seen
    mean = weight @ means
    apart = means - mean
    covariance = np.diag(weight @ shrunk) + (apart * weight[:, None]).T @ apart
    best = 1 + int(np.argmax((likelihood + np.log(chance))[1:]))
    return Sized(
        odds=_odds(likelihood, chance),
        size=float(sizes[best]),
        mean=axes @ mean,
        covariance=axes @ covariance @ axes.T,
        alias=moved,
    )


def choose(gram: Array, prior: Prior, groups: Sequence[Group]) -> dict[int, float]:
    """The groups that the residuals show, by their likeliest sizes: one by one the likeliest,
    beside which those before it are sized again."""
    there: dict[int, float] = {}
    for _ in range(MOST_TERMS):
        base = solve(gram, prior, groups, there)
        found = {i: _best(gram, base, group) for i, group in enumerate(groups) if i not in there}
        best = max(found, key=lambda i: found[i][0], default=None)
        if best is None or found[best][0] < EVIDENCE:
            break
        there[best] = found[best][1]
        for i in [i for i in there if len(there) > 1]:
            others = {k: size for k, size in there.items() if k != i}
            odds, size = _best(gram, solve(gram, prior, groups, others), groups[i])
            if odds < DOUBT:
                del there[i]
            else:
                there[i] = size
    return there


def list_ways(
    gram: Array, prior: Prior, groups: Sequence[Group], there: Mapping[int, float], alike: set[int]
) -> list[tuple[float, dict[int, float]]]:
    """The ways to explain the residuals, with their chances: as they are, and with each term that
    is `alike` in place of another, where the residuals hardly tell one from the other."""
    ways = [(1.0, dict(there))]
    for i in alike & set(there):
        others = {k: size for k, size in there.items() if k != i}
        base = solve(gram, prior, groups, others)
        odds = _best(gram, base, groups[i])[0]
        for j in alike - set(there):
            other, size = _best(gram, base, groups[j])
            if other > odds - RIVALS:
                ways.append((float(np.exp(min(other - odds, RIVALS))), {**others, j: size}))
    total = sum(chance for chance, _ in ways)
    return [(chance / total, way) for chance, way in ways]


def mix(chances: Array, each: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Mean and covariance of a mixture, by those of its parts."""
    mean = np.asarray(sum(p * own for p, (own, _) in zip(chances, each, strict=True)))
    covariance = np.zeros((len(mean), len(mean)))
    for p, (own, spread) in zip(chances, each, strict=True):
        covariance += p * (spread + np.outer(own - mean, own - mean))
    return mean, covariance


def price(groups: Sequence[Group], there: Mapping[int, float]) -> float:
    """The logarithm of the prior of these sizes."""
    total = 0.0
    for i, group in enumerate(groups):
        sizes, chance = _grid(group)
        total += np.log(chance[np.argmin(np.abs(sizes - there.get(i, 0.0)))])
    return total


def _best(gram: Array, base: Base, group: Group) -> tuple[float, float]:
    """The log-odds that a term is there, and its likeliest size."""
    values, _, seen, _ = _beside(gram, base, group)
    sizes, chance = _grid(group)
    likelihood = _likelihood(values, seen, sizes[:, None] ** 2)
    best = 1 + int(np.argmax((likelihood + np.log(chance))[1:]))
    return _odds(likelihood, chance), float(sizes[best])


def _grid(group: Group) -> tuple[Array, Array]:
    """Sizes (g,), the first zero, and their prior probabilities."""
    ratio = GRID[group.most * 1.01 >= GRID]
    density = ratio / (1 + ratio**2)  # half-Cauchy over the logarithm
    chance = group.odds * density / density.sum()
    return np.append(0.0, ratio * group.scale), np.append(1.0 - group.odds, chance)


def _beside(gram: Array, base: Base, group: Group) -> tuple[Array, Array, Array, Array]:
    """Λ, U and q of a term beside a base, and by how much its unknowns move the parameters."""
    across = gram[np.ix_(base.columns, group.columns)]
    moved = base.inverse @ across
    own = gram[np.ix_(group.columns, group.columns)]
    square = own - across.T @ moved
    values, axes = np.linalg.eigh((square + square.T) / 2)
    seen = axes.T @ (gram[group.columns, -1] - across.T @ base.estimate)
    blind = values < _BLIND * np.trace(own)
    return np.where(blind, 0.0, values), axes, np.where(blind, 0.0, seen), moved


def _likelihood(values: Array, seen: Array, square: Array) -> Array:
    spread = 1 + square * values
    return np.asarray(0.5 * (seen**2 * square / spread - np.log(spread)).sum(axis=1))


def _odds(likelihood: Array, chance: Array) -> float:
    """The log-odds of all sizes above zero against none."""
    rest = likelihood[1:] + np.log(chance[1:])
    none = likelihood[0] + np.log(chance[0])
    return float(np.log(np.exp(rest - rest.max()).sum()) + rest.max() - none)
