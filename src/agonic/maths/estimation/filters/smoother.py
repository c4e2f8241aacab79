"""The one smoother: states at moments, what couples neighbours, and unknowns that all share.

Residuals r + A x_k + A' x_{k+1} + J θ of known weight add to normal equations whose states couple
neighbours only. The states are eliminated (Rauch, Tung & Striebel 1965, in information form): with
H of the states, M mixed and G of θ, the information of θ is G − Mᵀ H⁻¹ M.
"""

from __future__ import annotations

import operator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal, solve


class Sums(NamedTuple):
    """What residuals r of moments or intervals add to the normal equations of N states of b numbers
    and p parameters.

    `diagonal` and `below` are H of the states; `mixed` (N, b, p); `params` (p, p); the gradient of
    each interval for the states before and after it, `before` and `after` (N, b), and the
    parameters, `own` (N, p); `cost` Σ w r², of `size` numbers.
    """

    diagonal: Array
    below: Array
    mixed: Array
    params: Array
    before: Array
    after: Array
    own: Array
    cost: float
    size: float

    @property
    def states(self) -> Tridiagonal:
        """H of the states."""
        return Tridiagonal(self.diagonal, self.below)

    @property
    def gradient(self) -> Array:
        """Of the states, (N, b)."""
        return np.asarray(self.before + np.roll(self.after, 1, axis=0))

    def add(self, other: Sums) -> Sums:
        """The sums of both."""
        return Sums._make(map(operator.add, self, other))

    def scale(self, by: float) -> Sums:
        """The sums of residuals over their standard deviation: `by` is its inverse square."""
        return Sums._make([*(by * one for one in self[:-2]), by * self.cost, self.size])


def sum_residuals(
    residuals: Array,
    weights: Array,
    by_params: Array,
    by_state: Array,
    by_next: Array | None = None,
) -> Sums:
    """The sums of residuals (N, r) of weights (N,), which parameters move by (N, r, p) and the
    states by (N, r, b); or of N − 1 intervals, by the state before and `by_next` that after."""
    sides = [by_state] if by_next is None else [by_state, by_next]
    n = len(weights) + len(sides) - 1
    weighted = by_params * weights[:, None, None]
    b, p = by_state.shape[2], by_params.shape[2]
    diagonal, mixed, own = np.zeros((n, b, b)), np.zeros((n, b, p)), np.zeros((n, p))
    pulls, below = np.zeros((2, n, b)), np.zeros((n - 1, b, b))
    for k, side in enumerate(sides):
        turned, there = side * weights[:, None, None], slice(k, k + len(weights))
        diagonal[there] += _multiply(turned, side)
        mixed[there] += _multiply(turned, by_params)
        pulls[k, : len(weights)] = np.einsum("krb,kr->kb", turned, residuals)
        if k:
            below += _multiply(turned, by_state)
    own[: len(weights)] = np.einsum("krp,kr->kp", weighted, residuals)
    square = weighted.reshape(-1, p).T @ by_params.reshape(-1, p)
    cost = float(weights @ (residuals**2).sum(axis=1))
    size = residuals.shape[1] * float(weights.sum())
    return Sums(diagonal, below, mixed, square, pulls[0], pulls[1], own, cost, size)


def _multiply(one: Array, other: Array) -> Array:
    """Aᵀ B of (k, r, b) and (k, r, c)."""
    rows = zip(np.swapaxes(one, 0, 1), np.swapaxes(other, 0, 1), strict=True)
    return np.asarray(sum(a[:, :, None] * b[:, None, :] for a, b in rows))


class Eliminated(NamedTuple):
    """How states follow the parameters (N, b, p), and where they are without them (N, b);
    information (p, p) and gradient (p,) of the parameters; what the states without them take from
    the cost, and log det H."""

    by_params: Array
    alone: Array
    information: Array
    gradient: Array
    gained: float
    log_determinant: float


def eliminate(sums: Sums) -> Eliminated:
    """The states eliminated.

    Raises `LinAlgError` where the states are not determined.
    """
    right = np.concatenate([sums.mixed, sums.gradient[:, :, None]], axis=2)
    found, log_determinant = solve(sums.states, right)
    p = right.shape[2] - 1
    both = right.reshape(-1, p + 1).T @ found.reshape(-1, p + 1)
    return Eliminated(
        -found[:, :, :p],
        -found[:, :, p],
        sums.params - both[:p, :p],
        sums.own.sum(axis=0) - both[:p, p],
        float(both[p, p]),
        log_determinant,
    )
