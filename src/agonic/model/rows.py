"""The rows that tell terms and noise: their footpoints, and the columns of every channel.

Feet are where readings and attitudes would be without their noise. Columns and Jacobians at
readings contain the readings' own noise, which residuals contain too: many columns then explain
noise by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import (
    Problem,
    compute_distances,
    compute_gradients,
    compute_residuals,
    pieces,
)
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.one_pass import find_length
from agonic.model.gram import Stack
from agonic.model.term import Errors, Seen

_PROJECTIONS = 2
"""Projections onto a curved surface; two leave 1e-9 of the field for noise of a hundredth."""


def move_to_footpoints(problem: Problem, estimate: Estimate) -> Problem:
    """The problem with points and directions moved so that all its residuals are zero.

    Of a channel's residual r the share σ²/σ_c² is the reading's own noise (σ the magnitude's), the
    rest the attitude's: points move by the former along the channel's gradient, then onto the
    surface, and down and across turn by what is left. So no error of a foot goes with a residual.
    """
    params = estimate.solution.params
    bias, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    points = problem.points
    for channel, noise in estimate.noise.items():
        residuals, gradients = compute_gradients(problem, channel, params)
        way = gradients / np.maximum(find_length(gradients), 1e-300)[:, None]
        share = min(estimate.noise["magnitude"].sd / noise.sd, 1.0) ** 2
        points = points + (share * residuals)[:, None] * way
    for _ in range(_PROJECTIONS):
        r, normals = compute_distances(points, bias, matrix, problem.magnitude)
        points = points - r[:, None] * normals
    standing = problem._replace(points=points)
    return standing if problem.dip is None else _turn(standing, bias, matrix)


def compute_jacobian(problem: Problem, channel: str, params: Array) -> Array:
    """The Jacobian (n, m) of a channel in one piece."""
    parts = [jacobian for _, jacobian in pieces(problem, channel)(params)]
    return np.concatenate(parts) if len(parts) > 1 else parts[0]


def _turn(problem: Problem, bias: Array, matrix: Array) -> Problem:
    """Down and across turned to the dip and azimuth of the field at each point."""
    assert problem.dip is not None
    unit = find_units(problem.points, bias, matrix)
    dip = np.arctan2(problem.dip.vertical, problem.dip.horizontal)
    down = problem.dip.down
    level = down - unit * np.sum(unit * down, axis=1, keepdims=True)
    level /= np.maximum(find_length(level), 1e-300)[:, None]
    dip = np.broadcast_to(dip, len(down))[:, None]
    down = np.sin(dip) * unit + np.cos(dip) * level
    turned = problem._replace(dip=problem.dip._replace(down=down))
    if problem.across is None:
        return turned
    across = np.cross(down, unit)
    across /= np.maximum(find_length(across), 1e-300)[:, None]
    sign = np.sign(np.sum(across * problem.across, axis=1, keepdims=True))
    return turned._replace(across=across * sign)


def find_units(points: Array, bias: Array, matrix: Array) -> Array:
    """Directions (n, 3) of the calibrated field at points (n, 3)."""
    field = (points - bias) @ matrix.T
    return np.asarray(field / np.maximum(find_length(field), 1e-300)[:, None])


FEWEST_ROWS = 12
"""Fewer rows tell nothing beside the parameters."""
MOST_ROWS = 30_000
"""Rows that tell terms and noise of all; of more, stretches in all parts of the log are taken."""
STRETCHES = 64
LEAST_WEIGHT = 0.05
"""Readings that the robust loss leaves less of are outliers, which no term explains."""
MOST_NOISE = 0.5
"""Of the field: what scatters by more is no calibration."""


class Rows(NamedTuple):
    """The problem of these rows, the same at their footpoints, what terms may depend on, their
    weights, the radius of the readings, and which share of the log's rows they are."""

    problem: Problem
    footpoints: Problem
    seen: Seen
    weights: Array
    radius: float
    share: float


def choose_rows(
    problem: Problem, estimate: Estimate, time: Array | None, origin: Array
) -> Rows | None:
    """The rows that count; None where they are too few, or scatter like no calibration.

    Parameters: `time` (n,) of all rows, `origin` (3,) to be added to points for readings from zero.
    """
    n = len(problem.points)
    kept = estimate.weights > LEAST_WEIGHT
    counted = int(kept.sum())
    if n > MOST_ROWS:
        stretch = np.arange(n) * STRETCHES // n
        kept &= np.arange(n) - np.searchsorted(stretch, stretch) < MOST_ROWS // STRETCHES
    rows = np.flatnonzero(kept)
    bias, matrix = split(problem.basis @ estimate.solution.params[: problem.basis.shape[1]])
    gain = abs(float(np.trace(matrix))) / 3
    noise = estimate.noise["magnitude"].sd * gain
    if len(rows) < FEWEST_ROWS or not 0.0 < noise < MOST_NOISE:
        return None
    part = problem.subset(rows)
    few = estimate._replace(weights=estimate.weights[rows])
    footpoints = move_to_footpoints(part, few)
    x = (footpoints.points + origin) * gain
    t = np.arange(n, dtype=float) if time is None else time
    seen = Seen(
        x=x,
        unit=find_units(footpoints.points, bias, matrix),
        time=(t[rows] - t[0]) / max(float(t[-1] - t[0]), 1e-300),
        rows=rows,
        blur=noise,
        reach=float(np.abs(x).max()),
        length=float(find_length(x).max()),
        total=n,
    )
    return Rows(part, footpoints, seen, few.weights, 1.0 / gain, len(rows) / max(counted, 1))


def stack_columns(
    rows: Rows, estimate: Estimate, errors: Sequence[Errors], channels: Sequence[str]
) -> list[Stack]:
    """Columns of parameters and terms at the footpoints, and residuals of the readings, by channel.

    A residual r(θ) is that of the true parameters θ + Δ, less J Δ, and what errors do to it:
    r = −J Δ + Σ E u + noise.
    """
    params, noise = estimate.solution.params, estimate.noise["magnitude"].sd
    roots, stacks = np.sqrt(rows.weights), []
    count = len(params) + sum(one.unknowns for one in errors) + 1
    for channel in channels:
        residuals = compute_residuals(rows.problem, channel, params, noise)
        by_params = -compute_jacobian(rows.footpoints, channel, params).T
        ways = by_params[:3] * (rows.radius * roots)
        columns = np.empty((count, len(roots)))
        np.multiply(by_params, roots, out=columns[: len(params)])
        at = len(params)
        for one in errors:
            one.along(ways, out=columns[at : at + one.unknowns])
            at += one.unknowns
        columns[-1] = residuals * roots
        stacks.append(Stack(channel, columns))
    return stacks
