"""Errors that all rows share: the reference's, and the turn between the sensor and the attitude.

An error of the reference's dip or declination, or of the zero of roll and pitch, is the same in
every row, so no number of rows averages it out. Each is one unknown with a standard deviation; what
it moves the estimate by joins the covariance (Schmidt's consider covariance, `model.posterior`).
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.attitude.problem import Scale
from agonic.maths.equation.affine import FREE, split
from agonic.maths.equation.channels import Dip, Problem, compute_residuals, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.equation.priors import compute_turn
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.inference import wald
from agonic.maths.rotations.vectors import skew

TURN_DOUBTFUL = 0.01
"""A turn that chance makes this seldom may be the sensor's, or an error of roll and pitch."""
TURN = "misalignment of the sensor"
_SMALL = 0.1  # of a standard deviation of the reference: the residuals are linear in so little


def list_considered(estimate: Estimate, problem: Problem, scale: Scale) -> dict[str, Array]:
    """By how much errors that all rows share move the parameters, by the name of the error.

    Parameters: the problem of the rows that were fitted.
    """
    moves = find_reference_moves(estimate, problem, scale.sd / scale.magnitude)
    named = dict(zip(("dip of the reference", "azimuth of the reference"), moves, strict=False))
    turn = find_turn_move(estimate, problem) if problem.shared is None else None
    return named if turn is None else {**named, TURN: turn}


def find_reference_moves(estimate: Estimate, problem: Problem, sd: float) -> list[Array]:
    """By how much an error of one standard deviation of the reference moves the parameters.

    Parameters: `sd` of each component of the field over its magnitude. That of the magnitude joins
    elsewhere, as it scales the matrix; here are the two across the field, of dip and azimuth.
    """
    of_dip = problem.shared is not None and problem.shared.dip_by.any()
    if sd == 0.0 or problem.dip is None or of_dip:  # then the dip is among the unknowns
        return []
    small = _SMALL * sd
    dip = problem.dip
    size = np.hypot(dip.horizontal, dip.vertical)
    steeper = Dip(
        dip.down,
        dip.horizontal - small * dip.vertical / size,
        dip.vertical + small * dip.horizontal / size,
    )
    shifted = [problem._replace(dip=steeper)]
    if problem.across is not None:
        ahead = np.cross(problem.across, dip.down)
        aside = (small / dip.horizontal)[:, None] * ahead
        shifted.append(problem._replace(across=problem.across + aside))
    return [_move(estimate, problem, other) / _SMALL for other in shifted]


def _move(estimate: Estimate, problem: Problem, other: Problem) -> Array:
    """How far another problem's minimum lies from this one's, to first order: −A⁻¹ Σ Jᵀ w δr/σ²."""
    solution = estimate.solution
    known = solution.information + problem.prior_information(solution.params)
    pull = np.zeros(len(solution.params))
    for channel, noise in estimate.noise.items():
        here = compute_residuals(problem, channel, solution.params)
        change = compute_residuals(other, channel, solution.params) - here
        weight = noise.loss.curvature((here / noise.sd) ** 2) / noise.sd**2 / noise.correlation
        by_params = np.concatenate([j for _, j in pieces(problem, channel)(solution.params)])
        pull += (weight * change) @ by_params
    return -leastsq.inverse(known) @ pull


def find_turn_move(estimate: Estimate, problem: Problem) -> Array | None:
    """By how much the parameters are off if a turn that was found is not the sensor's.

    Roll and pitch with an error of their zero look the same as a misaligned sensor. Either
    may be; halfway between the two the variance is half of the square of the turn.
    """
    if problem.gauge != FREE or problem.dip is None:
        return None
    turn, covariance = compute_turn(problem.basis, estimate.solution)
    independent = len(problem.points) / estimate.noise["dip"].correlation
    if not turn.any() or wald(turn, covariance, independent).p_value > TURN_DOUBTFUL:
        return None
    m = problem.basis.shape[1]
    _, matrix = split(problem.basis @ estimate.solution.params[:m])
    xy, xz, yz = turn  # −τ_z, τ_y, −τ_x of [τ]× in W = (1 + [τ]×) S
    untwisted = skew(np.array([-yz, xz, -xy])) @ matrix
    move = np.zeros(len(estimate.solution.params))
    local = np.concatenate([np.zeros(3), untwisted.ravel()])
    move[:m] = np.linalg.lstsq(problem.basis, local, rcond=None)[0] / np.sqrt(2.0)
    return move
