"""How a sensor is turned against what tells down beside it, at any angle, by the vertical field.

Of raw readings and down d in body axes, with the turn R from the sensor to the body, soft iron E
and the bias b, the vertical part of the field is the same in every row,

    dᵀ R (1 + E) (raw − b) = Z.

It is linear in the products d_i raw_j, in d (the bias) and one (Z), so cross-products of these by
blocks of time tell all: a Gauss–Newton search over R and E from every turn by right angles, and by
how R moves as blocks are left out, how well it is known. R and −R leave the same, for the
sign of Z is free.

Source: Gauss–Newton on rotations as Kok, Hol & Schön (2017), Foundations and Trends in Signal
Processing 11, 1.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.right_angles import right_angles
from agonic.maths.rotations.vectors import skew

BLOCKS = 16
"""Of time, by which scores scatter: errors of an attitude last for seconds to minutes."""
JOINED = (1, 2, 4)
"""Blocks that are taken together."""
APART_RAD = 0.5
"""Turns that differ by more are others."""
LEAST_MISFIT = 1e-3
"""Of the field: what any accelerometer and sensor leave."""
_ITERATIONS = 12
_INDEPENDENT = 400.0  # rows, of correlated ones, that weigh soft iron against the misfit


class TurnBeside(NamedTuple):
    """The turn (3, 3) from the sensor's axes to those of the body, and its covariance (3, 3), rad²,
    about body axes; what the vertical part varies by, over the readings' size, rms: with that turn,
    with none, and with the best `rival`."""

    turn: Array
    covariance: Array
    misfit: float
    unturned: float
    rival: float

    @property
    def angle(self) -> float:
        """The size of the turn, rad."""
        return float(np.arccos(np.clip((np.trace(self.turn) - 1) / 2, -1.0, 1.0)))

    @property
    def about(self) -> Array:
        """The turn as a rotation vector (3,), rad; of less than half a turn."""
        off = (self.turn - self.turn.T)[[2, 0, 1], [1, 2, 0]] / 2
        return np.asarray(off / max(float(np.sinc(self.angle / np.pi)), 1e-12))

    @property
    def sd(self) -> float:
        """The standard error about the axis that is known least, rad."""
        return float(np.sqrt(max(float(np.linalg.eigvalsh(self.covariance)[-1]), 0.0)))


def find_turn_beside(readings: Array, down: Array, soft_iron_sd: float) -> TurnBeside:
    """The turn that leaves the vertical part of the field most steady.

    Parameters: readings (n, 3) in order of time, down (n, 3) in body axes, and how far the sensor's
    matrix may be from its mean gain.
    """
    seen = readings - readings.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum(seen**2, axis=1))))
    products = (down[:, :, None] * (seen / max(size, 1e-300))[:, None, :]).reshape(-1, 9)
    table = np.column_stack([products, down, np.ones(len(down))])
    edges = np.linspace(0, len(table), BLOCKS + 1).astype(int)
    blocks = np.stack([table[a:b].T @ table[a:b] for a, b in pairwise(edges)]) / len(table)
    gram = blocks.sum(axis=0)
    across = gram[:9, 9:]
    left = gram[:9, :9] - across @ np.linalg.pinv(gram[9:, 9:], 1e-12, True) @ across.T
    turns, irons = right_angles().copy(), np.zeros((24, 5))
    misfit = np.maximum(measure_misfit(left, turns, irons), LEAST_MISFIT)
    for _ in range(_ITERATIONS):
        turns, irons = _step(left, turns, irons, misfit, soft_iron_sd)
        misfit = np.maximum(measure_misfit(left, turns, irons), LEAST_MISFIT)
    best = int(np.argmin(misfit + _price(irons, misfit.min(), soft_iron_sd)))
    trace = np.einsum("ij,kij->k", turns[best], turns)
    others = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)) > APART_RAD
    found = turns[best], irons[best], float(misfit[best])
    return TurnBeside(
        turn=turns[best],
        covariance=_find_covariance(blocks, *found, soft_iron_sd),
        misfit=found[2],
        unturned=float(measure_misfit(left, np.eye(3)[None], np.zeros((1, 5)))[0]),
        rival=float(misfit[others].min(initial=np.inf)),
    )


_SHAPES = np.array(
    [
        np.diag([1.0, -1.0, 0.0]),
        np.diag([1.0, 1.0, -2.0]) / np.sqrt(3),
        *(np.eye(3)[[i]].T @ np.eye(3)[[j]] + np.eye(3)[[j]].T @ np.eye(3)[[i]]
          for i, j in ((0, 1), (0, 2), (1, 2))),
    ]
)  # fmt: skip
"""Soft iron of no mean gain, (5, 3, 3)."""
_ABOUT = np.stack([skew(axis) for axis in np.eye(3)])
"""What a small turn about each axis does, (3, 3, 3)."""


def measure_misfit(left: Array, turns: Array, irons: Array) -> Array:
    """The rms of the vertical part for turns (k, 3, 3) and soft iron (k, 5), (k,)."""
    whole = (turns @ (np.eye(3) + np.tensordot(irons, _SHAPES, 1))).reshape(-1, 9)
    return np.asarray(np.sqrt(np.maximum(np.sum((whole @ left) * whole, axis=1), 0.0)))


def _price(irons: Array, misfit: float, soft_iron_sd: float) -> Array:
    """What soft iron costs in misfit, by its prior."""
    square = np.sum(irons**2, axis=1) / soft_iron_sd**2
    return np.asarray(misfit * square / (2 * _INDEPENDENT))


def _slopes(turns: Array, irons: Array) -> tuple[Array, Array]:
    """The matrices (k, 9) and their derivatives (k, 8, 9) by three turns and five shapes."""
    whole = turns @ (np.eye(3) + np.tensordot(irons, _SHAPES, 1))
    turned = _ABOUT[None] @ whole[:, None]
    shaped = turns[:, None] @ _SHAPES[None]
    by = np.concatenate([turned, shaped], axis=1)
    return whole.reshape(-1, 9), by.reshape(len(turns), 8, 9)


def _step(
    left: Array, turns: Array, irons: Array, misfit: Array, soft_iron_sd: float
) -> tuple[Array, Array]:
    """One Gauss–Newton step of each start."""
    whole, by = _slopes(turns, irons)
    weight = (_INDEPENDENT / misfit**2)[:, None, None]
    prior = np.diag(np.r_[np.ones(3), np.full(5, soft_iron_sd**-2.0)])
    seen = by @ left
    information = weight * (seen @ np.swapaxes(by, 1, 2)) + prior
    pull = weight[:, 0] * (seen @ whole[:, :, None])[:, :, 0]
    pull[:, 3:] += irons * soft_iron_sd**-2.0
    step = -np.linalg.solve(information, pull[..., None])[..., 0]
    size = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
    step[:, :3] *= np.minimum(1.0, 0.3 / np.maximum(size, 1e-12))
    half = np.tensordot(step[:, :3], _ABOUT, 1) / 2
    moved = np.linalg.solve(np.eye(3) - half, (np.eye(3) + half) @ turns)  # Cayley's rotation
    return np.asarray(moved, dtype=np.float64), irons + step[:, 3:]


def _find_covariance(
    blocks: Array, turn: Array, iron: Array, misfit: float, soft_iron_sd: float
) -> Array:
    """The covariance of the turn by how much it moves as blocks are left out, bias and Z found
    along (jackknife over clusters; Cameron & Miller 2015, Journal of Human Resources 50, 317)."""
    whole, by = _slopes(turn[None], iron[None])
    known = blocks.sum(axis=0)[9:, 9:]
    others = -np.linalg.pinv(known, 1e-12, True) @ blocks.sum(axis=0)[9:, :9] @ whole[0]
    columns = np.zeros((13, 12))
    columns[:9, :8], columns[9:, 8:] = by[0].T, np.eye(4)
    scores = np.einsum("ip,bij,j->bp", columns, blocks, np.r_[whole[0], others])
    parts = np.einsum("ip,bij,jq->bpq", columns, blocks, columns, optimize=True)
    prior = np.zeros(12)
    prior[3:8] = (misfit / soft_iron_sd) ** 2 / _INDEPENDENT
    information = parts.sum(axis=0) + np.diag(prior) + 1e-12 * np.eye(12)
    own = np.linalg.inv(information)
    known = own @ np.diag(prior * misfit**2 / _INDEPENDENT) @ own
    found = []
    for each in JOINED:  # the longer ones hold errors that outlast the shorter
        starts = np.arange(0, BLOCKS, each)
        rest = information - np.add.reduceat(parts, starts, axis=0)
        moves = np.linalg.solve(rest, np.add.reduceat(scores, starts, axis=0)[..., None])[..., 0]
        spread = moves.T @ moves * (len(starts) - 1) / len(starts)
        found.append((spread + known)[:3, :3])
    return np.asarray(max(found, key=np.trace))
