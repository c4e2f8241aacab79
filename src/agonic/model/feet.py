"""Feet: where readings and attitudes would be without their noise, so that no column holds it.

Columns and Jacobians at readings contain the readings' own noise, which residuals contain too:
many columns then explain noise by itself.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import magnitude_residual, split
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.one_pass import find_length

_ROUNDS = 2
"""Projections onto a curved surface; two leave 1e-9 of the field for noise of a hundredth."""


def stand_on_feet(problem: Problem, estimate: Estimate) -> Problem:
    """The problem with points and directions moved so that all its residuals are zero.

    Of a channel's residual r the share σ²/σ_c² is the reading's own noise (σ the magnitude's), the
    rest the attitude's: points move by the former along the channel's gradient, then onto the
    surface, and down and across turn by what is left. So no error of a foot goes with a residual.
    """
    params = estimate.solution.params
    bias, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    points = problem.points
    for channel, noise in estimate.noise.items():
        residuals, jacobian = join_pieces(problem, channel, params)
        way = jacobian[:, :3] / np.maximum(find_length(jacobian[:, :3]), 1e-300)[:, None]
        share = min(estimate.noise["magnitude"].sd / noise.sd, 1.0) ** 2
        points = points + (share * residuals)[:, None] * way
    for _ in range(_ROUNDS):
        r, local = magnitude_residual(points, bias, matrix, problem.magnitude)
        points = points + r[:, None] * local[:, :3]
    standing = problem._replace(points=points)
    return standing if problem.dip is None else _turn(standing, bias, matrix)


def join_pieces(
    problem: Problem, channel: str, params: Array, noise_sd: float = 0.0
) -> tuple[Array, Array]:
    """Residuals (n,) and Jacobian (n, m) of a channel in one piece."""
    parts = list(pieces(problem, channel, noise_sd)(params))
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([r for r, _ in parts]), np.concatenate([j for _, j in parts])


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
