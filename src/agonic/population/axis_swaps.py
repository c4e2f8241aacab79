"""Which swap of its axes makes a sensor one of its population."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.mounting import right_angles
from agonic.population.population import PAIRS

_DOF = 4.0  # of the Student t by which members are judged


class Likelihoods(NamedTuple):
    """Log-likelihood of each sensor for each swap, (n, 48), up to a constant of the sensor."""

    turns: Array
    log: Array

    def evidence(self) -> Array:
        """The e-value against unswapped axes: the mean likelihood ratio over the other swaps, (n,).

        A regular member reaches e ≥ 1/p with a probability of at most p.
        """
        others = self.log[:, 1:] - self.log[:, :1]
        largest = others.max(axis=1)
        mean = np.exp(others - largest[:, None]).mean(axis=1)
        return np.asarray(np.exp(np.minimum(largest, 600.0)) * mean)


def list_swaps() -> Array:
    """The 48 matrices that take axes to axes, mirrored ones too, (48, 3, 3); first the identity.

    >>> len(list_swaps()), list_swaps()[0].trace()
    (48, np.float64(3.0))
    """
    return np.concatenate([right_angles(), -right_angles()])


def swap_axes(parameters: Array, turn: Array) -> Array:
    """Bias, gains and cross-axis terms xy xz yz (…, 9) of the sensor with its axes swapped.

    b' = P b, W' = P W Pᵀ.

    >>> swap_axes(np.arange(9.0), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])).tolist()
    [-1.0, 0.0, 2.0, 4.0, 3.0, 5.0, -6.0, -8.0, 7.0]
    """
    own = np.argmax(np.abs(turn), axis=1)
    sign = turn[range(3), own]
    pairs = [PAIRS.index((min(own[a], own[b]), max(own[a], own[b]))) for a, b in PAIRS]
    order = [*own, *(3 + own), *(6 + np.array(pairs))]
    signs = [*sign, 1.0, 1.0, 1.0, *(sign[a] * sign[b] for a, b in PAIRS)]
    return np.asarray(parameters[..., order] * signs)


def compute_likelihoods(parameters: Array, sd: Array, centre: Array, spread: Array) -> Likelihoods:
    """How well each sensor fits its population after each swap of its axes.

    Every parameter of a member is taken as a Student t with 4 degrees of freedom about the centre,
    with the scale √(spread² + sd²). Parameters: parameters and sd (n, 9) as for `swap_axes`, NaN
    where there are none; centre and spread (9,).
    """
    turns = list_swaps()
    table = _tabulate(parameters, sd, centre, spread)
    log = np.empty((len(parameters), len(turns)))
    for k, turn in enumerate(turns):
        source = swap_axes(np.arange(1.0, 10.0), turn)
        own, mirrored = np.abs(source).astype(int) - 1, (source < 0).astype(int)
        log[:, k] = table[range(9), own, mirrored].sum(axis=0)
    return Likelihoods(turns, log)


def _tabulate(parameters: Array, sd: Array, centre: Array, spread: Array) -> Array:
    """Of each parameter, for each of the sensor's own of its kind, for each sign: (9, 9, 2, n)."""
    table = np.zeros((9, 9, 2, len(parameters)))
    for theirs in range(9):
        first = 3 * (theirs // 3)
        for own in range(first, first + 3):
            for mirrored in (0, 1):
                value = -parameters[:, own] if mirrored else parameters[:, own]
                scale = np.sqrt(spread[theirs] ** 2 + np.nan_to_num(sd[:, own], posinf=np.inf) ** 2)
                z = (value - centre[theirs]) / scale
                log = -0.5 * (_DOF + 1) * np.log1p(z**2 / _DOF) - np.log(scale)
                table[theirs, own, mirrored] = np.where(np.isfinite(log), log, 0.0)
    return table
