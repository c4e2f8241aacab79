"""How much of the change of a vector the rates of a gyro explain, with its axes and unit renamed.

A vector v that stands still turns in a sensor that turns at ω by dv/dt = (v − b) × ω, b being what
the sensor reads too much. With the axes of the gyro renamed by T, and its unit s times the right
one, the same holds for s T ω.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.one_pass import median
from agonic.maths.rotations.low_pass import low_pass
from agonic.maths.rotations.vectors import skew

_MOST = 4000
_LEVI_CIVITA = skew(np.eye(3)).swapaxes(1, 2)


def sum_products(
    vectors: Array, rate: Array, time: Array, smoothed_s: float, *, felt: bool = False
) -> Array:
    """Sums over the rows of products of what the residual of any renaming is made of, (19, 19).

    With f the vectors about their mean, the change c − f × ω' − ω' × b of a row under a rate
    ω' = s T ω is a sum of the change c itself, of the nine f × e_k ω_j, times s T_kj, and of the
    nine e_c ω_j: all renamings have their squares and best biases from these sums, and no row is
    seen again. What is `felt`, a vector of a known mean and ω' × u, changes by
    dω'/dt × u − (ω' × u) × ω' more: of each e_c not only ω_j, also dω_j/dt and ω_j ω_k, (55, 55).

    Parameters: vectors (n, 3) and rate (n, 3) at time (n,), `smoothed_s` over which both are
    averaged; `felt` where the vectors are acceleration, taken as they are, and b is small.
    """
    step = median(np.diff(time))
    every = max(1, len(time) // _MOST)
    vectors, rate = (low_pass(v, step, smoothed_s) for v in (vectors, rate))
    # no rate is larger than noise where nothing turns; a gap's change is not that of a row
    change = np.gradient(vectors, time, axis=0)[::every]
    size = np.sqrt((change**2).sum(axis=1))
    usual = size < 10 * median(size) + 1e-12
    about = vectors if felt else vectors - vectors.mean(axis=0)
    crossed = skew(about[::every][usual]).swapaxes(1, 2)  # (n, k, 3): f × e_k
    factors = rate[::every][usual]
    turned = (crossed[:, :, None] * factors[:, None, :, None]).reshape(-1, 9, 3)
    seen = np.concatenate([change[usual][:, None], turned], axis=1)
    if felt:
        faster = np.gradient(rate, time, axis=0)[::every][usual]
        squares = (factors[:, :, None] * factors[:, None]).reshape(-1, 9)
        factors = np.concatenate([factors, faster, squares], axis=1)
    among = seen.swapaxes(0, 1).reshape(10, -1)
    across = (
        (factors.T @ seen.reshape(-1, 30)).reshape(-1, 10, 3).transpose(1, 2, 0).reshape(10, -1)
    )
    inner = np.kron(np.eye(3), factors.T @ factors)
    return np.block([[among @ among.T, across], [across.T, inner]])


def measure_left(products: Array, turns: Array, farthest: Array) -> Array:
    """What is left of the change of a vector with turns and units (…, 3, 3) of the gyro, as shares.

    Parameters: the sums of `sum_products`; `farthest` (3,), a bias so far off costs as much as all
    the change, or (6,) with a speed of what is felt. Without that, a bias of 57 fields would
    explain small turns by a gyro in the wrong unit.
    """
    shape, size = turns.shape[:-2], len(products)
    wanted = np.zeros((*shape, size))
    wanted[..., 0], wanted[..., 1:10] = 1.0, -turns.reshape(*shape, 9)
    by_unknown = _spread_unknowns(turns, size)[..., : len(farthest), :]
    taken = by_unknown @ products
    gram, along = taken @ by_unknown.swapaxes(-1, -2), taken @ wanted[..., None]
    gram = gram + products[0, 0] * np.diag(farthest**-2.0)
    unknown = (np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ along)[..., 0]
    left = wanted - (unknown[..., None, :] @ by_unknown)[..., 0, :]
    far = ((unknown / farthest) ** 2).sum(axis=-1)
    square = np.maximum(((left @ products) * left).sum(axis=-1), 0.0)
    rounding = np.finfo(float).eps * float(np.trace(products[1:10, 1:10]))
    return np.asarray(far + square / max(float(products[0, 0]), rounding, 1e-300))


def _spread_unknowns(turns: Array, size: int) -> Array:
    """What a bias and a speed along each axis change in the terms of `sum_products`, (…, 6, size).

    A bias along b: ω' × e_b, of which e_c holds ε_kbc ω'_k. A speed along b: dω'/dt × e_b, and of
    −(ω' × e_b) × ω' = ω' (ω' · e_b) − e_b (ω' · ω') what is e_c ω_j ω_k.
    """
    shape = turns.shape[:-2]
    spread = np.zeros((*shape, 6, size))
    of_axis = spread[..., 10:].reshape(*shape, 6, 3, -1)
    crossed = np.einsum("kbc,...kj->...bcj", _LEVI_CIVITA, turns)
    of_axis[..., :3, :, :3] = crossed
    if size > 19:
        towards = np.einsum("...cj,...bk->...bcjk", turns, turns)
        away = np.einsum("bc,...ij,...ik->...bcjk", np.eye(3), turns, turns)
        of_axis[..., 3:, :, 3:6] = crossed
        of_axis[..., 3:, :, 6:] = (towards - away).reshape(*shape, 3, 3, 9)
    spread[..., 10:] = of_axis.reshape(*shape, 6, -1)
    return spread
