"""The vehicle's level as its accelerometer reads it, for so it is read when headings are taken.

An accelerometer's bias b is taken out of every down d before the field is compared with it, but
whoever takes a heading has the tilt from the accelerometer as it reads. On a vehicle that stays
near level the two differ by one turn of all rows, which the bias and the turn between the sensors
share as they like. So the calibration is turned along, W → exp(ρ) W: then what is not known of b
does not touch the heading either. The turn that leaves least of the downs' differences δd,

    Σ |δd − ρ × d|² → min,   δd = −(b − (b·d) d)/g,   (1 − ⟨d dᵀ⟩) ρ = −⟨d⟩ × b/g,

is none for a sensor that was turned all ways.

A sensor that does not keep near one level has none to keep: there the bias is known well.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inertial.attitude import Inertial
from agonic.inertial.problem import pose, with_tilt
from agonic.inertial.start import Solved
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.coverage import KEEPS_LEVEL
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.vectors import skew
from agonic.units import STANDARD_GRAVITY_M_S2

_STEADY = 1e-3
"""Weight of no turn about the mean down, which downs that hardly differ do not tell."""


def keep_level(solved: Solved) -> Solved:
    """The estimate in axes whose level is the one that the accelerometer reads, bias and all.

    A matrix without a turn of its own cannot be turned, and stays; so does that of a sensor which
    was turned all ways.
    """
    problem = solved.problem
    near = float(np.linalg.norm(solved.felt.down.mean(axis=0))) > KEEPS_LEVEL
    if problem.gauge != FREE or problem.model != "full" or not near:
        return solved
    lean = find_lean(solved.felt.down)
    turn = make_rotation(lean @ solved.errors[:3])
    felt = _turn_felt(solved.felt, turn, lean)
    assert problem.shared is not None
    tilted = with_tilt(solved.samples, felt)
    posed = pose(tilted, solved.reference, felt, solved.settings, problem.shared.taken_out)
    solution = solved.found.solution
    jacobian = _turn_parameters(solved, turn, lean)
    m = problem.basis.shape[1]
    params = solution.params.copy()
    params[:m] = jacobian[:m, :m] @ params[:m]
    back = np.linalg.inv(jacobian)
    solution = solution._replace(
        params=params,
        covariance=jacobian @ solution.covariance @ jacobian.T,
        information=back.T @ solution.information @ back,
    )
    return solved._replace(
        found=solved.found._replace(solution=solution),
        problem=posed[0],
        scale=posed[1],
        samples=tilted,
        felt=felt,
    )


def find_lean(down: Array) -> Array:
    """The turn of level by each m/s² of an accelerometer's bias, (3, 3) rad.

    Parameters: downs (n, 3) of a vehicle in its axes.

    >>> find_lean(np.tile([0.0, 0.0, 1.0], (2, 1))).round(3).tolist()
    [[0.0, 0.102, 0.0], [-0.102, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """
    mean = down.mean(axis=0)
    told = np.eye(3) - down.T @ down / len(down) + _STEADY * np.outer(mean, mean)
    return np.asarray(-np.linalg.solve(told, skew(mean)) / STANDARD_GRAVITY_M_S2) + 0.0


def _turn_felt(felt: Inertial, turn: Array, lean: Array) -> Inertial:
    """The attitude that was felt, in turned axes; an error of the bias leans these as well."""
    down = felt.down @ turn.T
    down_by = turn @ felt.down_by
    down_by[:, :, :3] += skew(down) @ lean
    ahead = None if felt.ahead is None else felt.ahead @ turn.T
    return felt._replace(down=down, down_by=down_by, ahead=ahead)


def _turn_parameters(solved: Solved, turn: Array, lean: Array) -> Array:
    """Derivatives (p, p) of the parameters in turned axes by those before: W' = exp(lean b) W."""
    problem, p = solved.problem, len(solved.found.solution.params)
    basis = problem.basis
    m, first = basis.shape[1], p - len(solved.sds)
    turned = np.eye(12)
    turned[3:, 3:] = np.kron(turn, np.eye(3))
    jacobian = np.eye(p)
    back = np.linalg.pinv(basis)
    jacobian[:m, :m] = back @ turned @ basis
    matrix = (turned @ basis @ solved.found.solution.params[:m])[3:].reshape(3, 3)
    by_bias = np.stack([(skew(axis) @ matrix).ravel() for axis in lean.T], axis=1)
    jacobian[:m, first : first + 3] = back[:, 3:] @ by_bias * solved.sds[:3]
    return jacobian
