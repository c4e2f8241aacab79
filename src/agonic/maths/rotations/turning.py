"""How much of the change of a vector the rates of a gyro explain, with its axes and unit renamed.

A vector v that stands still turns in a sensor that turns at ω by dv/dt = (v − b) × ω, b being what
the sensor reads too much. With the axes of the gyro renamed by T, and its unit s times the right
one, the same holds for s T ω.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.low_pass import low_pass
from agonic.maths.rotations.vectors import skew

_MOST = 4000
_LEVI_CIVITA = skew(np.eye(3)).swapaxes(1, 2)


def sum_products(
    vectors: Array, rate: Array, time: Array, smoothed_s: float, *, centred: bool = False
) -> Array:
    """Sums over the rows of products of what the residual of any renaming is made of, (19, 19).

    With f the vectors about their mean, the change c − f × ω' − ω' × b of a row under a rate
    ω' = s T ω is a sum of the change c itself, of the nine f × e_k ω_j, times s T_kj, and of the
    nine e_c ω_j: all renamings have their squares and best biases from these sums, and no row is
    seen again.

    Parameters: vectors (n, 3) and rate (n, 3) at time (n,), `smoothed_s` over which both are
    averaged; `centred` where the vectors are taken as they are, and b is small.
    """
    step = float(np.median(np.diff(time)))
    every = max(1, len(time) // _MOST)
    vectors, rate = (low_pass(v, step, smoothed_s) for v in (vectors, rate))
    # no rate is larger than noise where nothing turns; a gap's change is not that of a row
    change = np.gradient(vectors, time, axis=0)[::every]
    size = np.sqrt((change**2).sum(axis=1))
    usual = size < 10 * np.median(size) + 1e-12
    vectors, rate, change = vectors[::every][usual], rate[::every][usual], change[usual]
    about = vectors if centred else vectors - vectors.mean(axis=0)
    crossed = skew(about).swapaxes(1, 2)  # (n, k, 3): f × e_k
    turned = (crossed[:, :, None] * rate[:, None, :, None]).reshape(-1, 9, 3)
    moved = (np.eye(3)[:, None] * rate[:, None, :, None]).reshape(-1, 9, 3)
    parts = np.concatenate([change[:, None], turned, moved], axis=1).swapaxes(1, 2).reshape(-1, 19)
    return np.asarray(parts.T @ parts)


def measure_left(products: Array, turns: Array, farthest: float) -> Array:
    """What is left of the change of a vector with turns and units (…, 3, 3) of the gyro, as shares.

    Parameters: the sums of `sum_products`; a bias `farthest` off costs as much as all the change.
    Without that, a bias of 57 fields would explain small turns by a gyro in the wrong unit.
    """
    shape = turns.shape[:-2]
    wanted = np.zeros((*shape, 19))
    wanted[..., 0], wanted[..., 1:10] = 1.0, -turns.reshape(*shape, 9)
    by_bias = np.zeros((*shape, 3, 19))  # ω' × e_b, of which e_c holds ε_kbc ω'_k
    by_bias[..., 10:] = np.einsum("kbc,...kj->...bcj", _LEVI_CIVITA, turns).reshape(*shape, 3, 9)
    taken = by_bias @ products
    gram, along = taken @ by_bias.swapaxes(-1, -2), taken @ wanted[..., None]
    gram = gram + products[0, 0] / farthest**2 * np.eye(3)
    bias = (np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ along)[..., 0]
    left = wanted - (bias[..., None, :] @ by_bias)[..., 0, :]
    far = (bias**2).sum(axis=-1) / farthest**2
    square = ((left @ products) * left).sum(axis=-1)
    return np.asarray(far + square / max(float(products[0, 0]), 1e-300))
