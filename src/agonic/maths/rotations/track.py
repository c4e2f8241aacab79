"""The attitude of a record as states a fraction of a second apart, carried between them by a gyro.

The states are attitudes R of axes b in steady axes i; an error δ of each, small and in axes i,
R → exp(δ) R, is what gets estimated. Between two states the gyro's turns hold, and what it says
otherwise than the states is spread evenly: Log(R₂ (R₁ D)ᵀ) over the time between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.filters.smoother import Sums, sum_residuals
from agonic.maths.rotations.attitude import integrate_rates, make_rotation

SPACING_S = 0.5
"""Between two states."""


class Track(NamedTuple):
    """Where the states of a record are, and how the gyro turned between them.

    `nodes` (N,) are the rows with a state; each row lies in the interval after node `interval`
    (n,), by the `share` (n,) of it; `joined` (N − 1,) is false over a pause. `turned` (n, 3, 3) is
    the gyro's turn from the node to the row, and `step` (N − 1, 3, 3) that to the next node.
    """

    nodes: Index
    interval: Index
    share: Array
    joined: Mask
    turned: Array
    step: Array


def lay_track(time: Array, rate: Array, parts: list[Index], spacing_s: float = SPACING_S) -> Track:
    """The track of rows (n,) with rates (n, 3), rad/s, in parts without a pause, in order."""
    n = len(time)
    interval, share = np.zeros(n, dtype=np.intp), np.zeros(n)
    turned, step = np.empty((n, 3, 3)), []
    nodes: list[Index] = []
    joined: list[Mask] = []
    count = 0
    for rows in parts:
        local = time[rows]
        number = np.floor((local - local[0]) / spacing_s).astype(np.intp)
        own = np.flatnonzero(np.diff(number, prepend=-1))
        own = np.unique(np.append(own[own < len(rows) - 1], [0, len(rows) - 1]))
        left = np.clip(np.searchsorted(own, np.arange(len(rows)), side="right") - 1, 0, None)
        left = np.minimum(left, max(len(own) - 2, 0))
        axes = integrate_rates(rate[rows], local).as_matrix() if len(rows) > 1 else np.eye(3)[None]
        back = np.swapaxes(axes[own], 1, 2)
        turned[rows] = back[left] @ axes
        interval[rows] = count + left
        if len(own) > 1:
            share[rows] = (local - local[own[left]]) / (local[own[left + 1]] - local[own[left]])
        nodes.append(rows[own])
        step.append(back[:-1] @ axes[own[1:]])
        joined.append(np.ones(len(own) - 1, dtype=bool))
        if rows is not parts[-1]:
            step.append(np.eye(3)[None])
            joined.append(np.zeros(1, dtype=bool))
        count += len(own)
    return Track(
        np.concatenate(nodes), interval, share, np.concatenate(joined), turned, np.concatenate(step)
    )


def find_slips(track: Track, states: Array) -> Array:
    """By how much the states (N, 3, 3) turn more than the gyro between them, (N − 1, 3), axes i."""
    from scipy.spatial.transform import Rotation  # slow to load

    carried = states[:-1] @ track.step
    slip = Rotation.from_matrix(states[1:] @ np.swapaxes(carried, 1, 2)).as_rotvec()
    return np.where(track.joined[:, None], slip, 0.0)


def find_attitudes(track: Track, states: Array) -> Array:
    """The attitude of each row, (n, 3, 3)."""
    slip = np.concatenate([find_slips(track, states), np.zeros((1, 3))])[track.interval]
    spread = make_rotation(slip * track.share[:, None])
    return np.asarray(spread @ states[track.interval] @ track.turned)


def sum_rows(
    track: Track, residuals: Array, by_state: Array, by_params: Array, weights: Array
) -> Sums:
    """The sums of residuals (n, 3), which a state moves by (n, 3, 3) and parameters by (n, 3, p).

    Rows in order of time; weights (n,).
    """
    count, last = len(track.nodes), track.share
    first = 1.0 - last
    starts = np.flatnonzero(np.diff(track.interval, prepend=-1))
    which = track.interval[starts]

    def gather(values: Array) -> Array:
        whole = np.zeros((count, *values.shape[1:]))
        whole[which] = np.add.reduceat(values, starts, axis=0)
        return whole

    turned = np.swapaxes(by_state, 1, 2) * weights[:, None, None]
    square, cross = turned @ by_state, turned @ by_params
    pull = np.einsum("nij,nj->ni", turned, residuals)
    diagonal = gather(square * (first**2)[:, None, None])
    diagonal[1:] += gather(square * (last**2)[:, None, None])[:-1]
    mixed = gather(cross * first[:, None, None])
    mixed[1:] += gather(cross * last[:, None, None])[:-1]
    weighted = by_params * weights[:, None, None]
    return Sums(
        diagonal,
        gather(square * (first * last)[:, None, None])[:-1],
        mixed,
        np.tensordot(weighted, by_params, axes=([0, 1], [0, 1])),
        gather(pull * first[:, None]),
        gather(pull * last[:, None]),
        gather(np.einsum("nip,ni->np", weighted, residuals)),
        float(weights @ (residuals**2).sum(axis=1)),
        3.0 * float(weights.sum()),
    )


def sum_slips(
    track: Track, slips: Array, by_params: Array, time: Array, counts: Array
) -> tuple[Sums, Array]:
    """The sums of what the gyro disagrees with the states, a random walk of one in a second, and
    the squares (N − 1,) of its steps, of which a Gaussian walk makes three.

    Parameters: slips (N − 1, 3), what parameters add to them (N − 1, 3, p), times (n,), and how
    much each step counts (N − 1,).
    """
    span = np.diff(time[track.nodes])
    weights = np.where(track.joined, 1.0 / np.maximum(span, 1e-9), 0.0)
    squares = weights * (slips**2).sum(axis=1)
    turn = np.broadcast_to(np.eye(3), (len(span), 3, 3))
    sums = sum_residuals(slips, weights * counts, by_params, -turn, turn)
    return sums._replace(size=3.0 * float(counts[track.joined].sum())), squares


def integrate_over_steps(track: Track, values: Array, time: Array, parts: list[Index]) -> Array:
    """∫ values dt from node to node, (N − 1, …), of rows (n, …); zero over pauses."""
    whole = np.zeros_like(values)
    for rows in parts:
        if len(rows) > 1:
            half = np.diff(time[rows]).reshape(-1, *[1] * (values.ndim - 1)) / 2
            area = (values[rows][1:] + values[rows][:-1]) * half
            whole[rows[1:]] = np.cumsum(area, axis=0)
    found = whole[track.nodes[1:]] - whole[track.nodes[:-1]]
    return np.asarray(np.where(track.joined.reshape(-1, *[1] * (values.ndim - 1)), found, 0.0))
