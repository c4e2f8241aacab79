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

from collections.abc import Iterator, Mapping, Sequence
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


def solve(
    gram: Array,
    prior: Prior,
    groups: Sequence[Group],
    there: Mapping[int, float],
    without: int | None = None,
) -> Base:
    """The base of the parameters and the groups that are `there`, by their sizes; `without` one."""
    m, there = len(prior.pull), {k: size for k, size in there.items() if k != without}
    columns = np.concatenate([np.arange(m), *(groups[i].columns for i in there)]).astype(np.intp)
    sizes = np.repeat([*there.values()], [len(groups[i].columns) for i in there])
    information = gram[np.ix_(columns, columns)].copy()
    information[:m, :m] += prior.information
    information[range(m, len(columns)), range(m, len(columns))] += sizes**-2.0
    right = gram[columns, -1].copy()
    right[:m] += prior.pull
    least = 1e-24 * float(np.diag(information).max())  # what nothing shows stays finite
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), least))
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
    return average_each(gram, base, [group])[0]


def average_each(gram: Array, base: Base, groups: Sequence[Group]) -> list[Sized]:
    """Each term alone beside a base, averaged over its size."""
    found: list[Sized | None] = [None] * len(groups)
    for members, one in _size_alike(gram, base, groups):
        weight = np.exp(one.joint - one.joint.max(axis=1, keepdims=True))
        weight /= weight.sum(axis=1, keepdims=True)
        shrunk = one.square / (1 + one.square * one.values[:, None])
        means = shrunk * one.seen[:, None]
        mean = np.einsum("gt,gtk->gk", weight, means)
        apart = (means - mean[:, None]) * np.sqrt(weight)[:, :, None]
        spread = np.swapaxes(apart, 1, 2) @ apart
        spread[:, range(mean.shape[1]), range(mean.shape[1])] += np.einsum(
            "gt,gtk->gk", weight, shrunk
        )
        covariance = one.axes @ spread @ np.swapaxes(one.axes, 1, 2)
        mean = np.einsum("gik,gk->gi", one.axes, mean)
        odds, sizes = one.find_best()
        for k, i in enumerate(members):
            found[i] = Sized(
                float(odds[k]), float(sizes[k]), mean[k], covariance[k], one.alias[:, k]
            )
    return [one for one in found if one is not None]


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
    odds, best = np.empty(len(there)), np.empty(len(there))
    at = len(base.columns) - sum(len(groups[i].columns) for i in there)
    for k, (i, size) in enumerate(there.items()):
        own = slice(at, at := at + len(groups[i].columns))
        whole = np.linalg.inv(base.inverse[own, own])
        trace = np.trace(gram[np.ix_(groups[i].columns, groups[i].columns)])
        values, _, seen = _turn(
            whole - np.eye(len(whole)) / size**2, whole @ base.estimate[own], trace
        )
        sizes, chance = _grid(groups[i])
        joint = _weigh_sizes(values, seen, sizes[:, None] ** 2, chance)
        odds[k], best[k] = _odds(joint), sizes[1 + int(np.argmax(joint[1:]))]
    return odds, best


def rate(gram: Array, base: Base, groups: Sequence[Group]) -> tuple[Array, Array]:
    """The log-odds (g,) that each group is there beside a base, and its likeliest size."""
    odds, best = np.empty(len(groups)), np.empty(len(groups))
    for members, one in _size_alike(gram, base, groups):
        odds[members], best[members] = one.find_best()
    return odds, best


class _Alike(NamedTuple):
    """Groups of as many unknowns and sizes: Λ (g, k), U (g, k, k) and q (g, k) of each beside a
    base, squares of its sizes (g, t, 1), likelihood times prior of these (g, t) as a logarithm, and
    how far its unknowns move the base (b, g, k)."""

    values: Array
    axes: Array
    seen: Array
    square: Array
    joint: Array
    alias: Array

    def find_best(self) -> tuple[Array, Array]:
        """The log-odds (g,) that each is there, and its likeliest size."""
        likeliest = 1 + np.argmax(self.joint[:, 1:], axis=1)
        sizes = np.sqrt(self.square[np.arange(len(likeliest)), likeliest, 0])
        return _odds(self.joint), sizes


def _size_alike(
    gram: Array, base: Base, groups: Sequence[Group]
) -> Iterator[tuple[list[int], _Alike]]:
    """Groups that are alike, by their numbers, each alone beside a base."""
    alike: dict[tuple[int, int], list[int]] = {}
    for i, group in enumerate(groups):
        alike.setdefault((len(group.columns), len(_grid(group)[0])), []).append(i)
    for members in alike.values():
        columns = np.stack([groups[i].columns for i in members])
        before = gram[base.columns][:, columns]  # (b, g, k)
        own = gram[columns[:, :, None], columns[:, None, :]]
        flat = before.reshape(len(base.columns), columns.size)
        moved = (base.inverse @ flat).reshape(before.shape)
        across = before.transpose(1, 2, 0) @ moved.transpose(1, 0, 2)
        score = gram[columns, -1] - np.tensordot(base.estimate, before, 1)
        trace = np.trace(own, axis1=1, axis2=2)[:, None]
        values, axes, seen = _turn(own - across, score, trace)
        sizes, chance = (
            np.stack(each) for each in zip(*(_grid(groups[i]) for i in members), strict=True)
        )
        square = sizes[:, :, None] ** 2
        joint = _weigh_sizes(values[:, None], seen[:, None], square, chance)
        yield members, _Alike(values, axes, seen, square, joint, moved)


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


@lru_cache(maxsize=64)
def _list_sizes(scale: float, odds: float, most: float) -> tuple[Array, Array]:
    if odds == 1.0:
        return np.array([0.0, scale]), np.array([np.finfo(float).tiny, 1.0])
    ratio = GRID[most * 1.01 >= GRID]
    density = ratio / (1 + ratio**2)  # half-Cauchy over the logarithm
    chance = odds * density / density.sum()
    return np.append(0.0, ratio * scale), np.append(1.0 - odds, chance)


def _grid(group: Group) -> tuple[Array, Array]:
    """Sizes (g,), the first zero, and their prior probabilities."""
    return _list_sizes(group.scale, group.odds, group.most)


def _turn(square: Array, score: Array, trace: Array) -> tuple[Array, Array, Array]:
    """Λ, U and q of S (…, k, k) and s (…, k); what is rounding beside `trace` (…, 1) is none."""
    values, axes = np.linalg.eigh((square + np.swapaxes(square, -1, -2)) / 2)
    seen = np.einsum("...ij,...i->...j", axes, score)
    blind = values < ROUNDING * trace
    return np.where(blind, 0.0, values), axes, np.where(blind, 0.0, seen)


def _weigh_sizes(values: Array, seen: Array, square: Array, chance: Array) -> Array:
    """The logarithm of likelihood L(τ) times prior, for squares of sizes (…, g, 1)."""
    spread = 1 + square * values
    likelihood = 0.5 * (seen**2 * square / spread - np.log(spread)).sum(axis=-1)
    return np.asarray(likelihood + np.log(chance))


def _odds(joint: Array) -> Array:
    """The log-odds of all sizes above zero against none, over the last axis."""
    most = joint[..., 1:].max(axis=-1)
    rest = np.log(np.exp(joint[..., 1:] - most[..., None]).sum(axis=-1)) + most
    return np.asarray(rest - joint[..., 0])
