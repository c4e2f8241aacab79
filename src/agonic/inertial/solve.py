"""The estimate from samples, acceleration and rates: felt first, then with the attitude free."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.fit import estimate_usable, find_usable, refine_usable
from agonic.attitude.problem import Scale
from agonic.errors import CoverageError
from agonic.health import FEWEST
from agonic.inertial.attitude import Inertial, feel_attitude
from agonic.inertial.maths.joint import estimate_jointly
from agonic.inertial.problem import (
    make_log,
    orient,
    pose,
    standard_deviations,
    with_tilt,
    without_errors,
)
from agonic.inertial.settings import Settings
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.reference import Reference
from agonic.samples import Samples

SLOW_M_S = 0.2
"""Of a sensor that is turned in the hand, or a vehicle that turns where it stands."""
CLEARLY = 10.0
"""A speed is taken to be there where it makes the readings e^10 times as probable."""
_ROUNDS = 4
MATTERS = np.repeat([0.02, np.radians(0.1), 0.005, 0.2], 3)
"""Errors of the accelerometer, m/s², of the gyro, rad/s and scale, and a speed, m/s, that are too
small to act twice."""


class Solved(NamedTuple):
    """An estimate with the problem that it solves, of which rows, and the attitude it rests on."""

    found: Estimate
    problem: Problem
    scale: Scale
    samples: Samples
    reference: Reference
    usable: Mask
    felt: Inertial
    sds: Array
    settings: Settings
    gain: Array | None = None

    @property
    def errors(self) -> Array:
        """The errors of the unit that were found, (q,)."""
        return np.asarray(self.found.solution.params[-len(self.sds) :] * self.sds)


def solve(samples: Samples, reference: Reference, settings: Settings) -> Solved:
    """The estimate: first beside the attitude that is felt, then with the attitude free."""
    solved = choose_speed(samples, reference, settings)
    return _free_attitude(solved) if solved.felt.ahead is not None else solved


def solve_beside(
    samples: Samples, reference: Reference, felt: Inertial, errors: Array, settings: Settings
) -> Solved:
    """The same where the attitude is felt already, errors of the unit (q,) taken out."""
    sds = standard_deviations(felt, settings)
    posed = pose_felt(samples, reference, felt, settings, errors / sds)
    tilted, usable, problem, scale = posed
    found = estimate_usable(problem, usable, settings)
    solved = Solved(found, problem, scale, tilted, reference, usable, felt, sds, settings)
    return _free_attitude(solved) if felt.ahead is not None else solved


def _free_attitude(solved: Solved) -> Solved:
    """The joint estimate, attitudes free, from the one beside the attitude that was felt."""
    found, samples = solved.found, solved.samples
    params, q, noise = found.solution.params, len(solved.sds), found.noise["magnitude"]
    felt = feel_attitude(without_errors(samples, solved.errors))
    joint = estimate_jointly(
        solved.problem,
        make_log(samples, felt, solved.sds, solved.settings.accelerometer_scale_sd),
        params,
        orient(solved.problem, samples, felt, params),
        solved.usable.astype(np.float64),
        noise.sd,
        noise.loss,
    )
    p = len(params)
    solution = found.solution._replace(params=joint.params[:p], covariance=joint.covariance[:p, :p])
    noises = {**found.noise, "magnitude": noise._replace(sd=float(joint.sds[0]))}
    weights = np.minimum(found.weights, joint.weights[solved.usable])
    taken_out = joint.params[p - q : p]
    again = feel_attitude(without_errors(samples, taken_out * solved.sds))
    posed = pose_felt(samples, solved.reference, again, solved.settings, taken_out)
    tilted, usable, problem, scale = posed
    return solved._replace(
        found=found._replace(solution=solution, noise=noises, weights=weights),
        problem=problem,
        scale=scale,
        samples=tilted,
        usable=usable,
        felt=again,
        gain=joint.gain,
    )


def choose_speed(samples: Samples, reference: Reference, settings: Settings) -> Solved:
    """The estimate of a vehicle that hardly moves, or of one that keeps a speed in turns.

    A speed in a steady turn leans the vertical just as a bias of the accelerometer does, so it is
    taken to be there only where it makes the residuals much smaller.
    """
    still = _solve_with(samples, reference, settings, SLOW_M_S)
    if still.felt.ahead is None or not _leans(still):
        return still
    moving = _solve_with(samples, reference, settings, settings.speed_sd_m_s)
    gain = _describe_length(still) - _describe_length(moving)
    return moving if gain > CLEARLY else still


def _leans(solved: Solved) -> bool:
    """Whether the vertical is worse than the readings, or its errors larger than they should be."""
    noise, unknowns = solved.found.noise, solved.found.solution.params[-len(solved.sds) :]
    worse = max(noise[channel].sd for channel in ("dip", "azimuth")) > 1.2 * noise["magnitude"].sd
    return bool(worse or np.abs(unknowns).max() > 2.0)


def _describe_length(solved: Solved) -> float:
    """Minus the logarithm of the probability of the readings, by Laplace's approximation."""
    found, problem = solved.found, solved.problem
    length = 0.0
    for channel, noise in found.noise.items():
        n = len(found.residuals[channel]) / noise.correlation
        length += n * float(np.log(noise.sd))
    prior = problem.prior(problem.soft_iron_sd)
    if prior is not None:
        residuals = prior(found.solution.params)[0]
        length += float(residuals @ residuals) / 2
    # unknowns in units of their priors: what of these the readings leave
    covariance = found.solution.covariance[-len(solved.sds) :, -len(solved.sds) :]
    return length - float(np.linalg.slogdet(covariance)[1]) / 2


def _solve_with(
    samples: Samples, reference: Reference, settings: Settings, speed_sd_m_s: float
) -> Solved:
    """The estimate from the rows whose attitude is known.

    The errors of the inertial unit act to first order, so those that were found are taken out and
    the attitude is felt again, until little is left.
    """
    felt = feel_attitude(samples)
    known = np.flatnonzero(felt.known)
    if len(known) < FEWEST:
        raise CoverageError(
            f"accelerometer and gyro tell the attitude of {len(known)} readings only",
            turns="record without pauses, and the acceleration with every reading",
        )
    part, reference = samples.select(known), reference.select(known)
    settings = replace(settings, speed_sd_m_s=speed_sd_m_s)
    sds = standard_deviations(felt, settings)
    taken_out, found = np.zeros(len(sds)), None
    for _ in range(_ROUNDS):
        felt = felt.subset(known)
        tilted, usable, problem, scale = pose_felt(part, reference, felt, settings, taken_out)
        if found is None:
            found = estimate_usable(problem, usable, settings)
        else:
            found = refine_usable(problem, usable, settings, found.solution.params)
        unknowns = found.solution.params[-len(sds) :]
        if np.abs((unknowns - taken_out) * sds / MATTERS[: len(sds)]).max() < 1.0:
            break
        taken_out = unknowns
        felt = feel_attitude(without_errors(samples, taken_out * sds))
    assert found is not None
    return Solved(found, problem, scale, tilted, reference, usable, felt, sds, settings)


def pose_felt(
    samples: Samples, reference: Reference, felt: Inertial, settings: Settings, taken_out: Array
) -> tuple[Samples, Mask, Problem, Scale]:
    """The samples with the tilt that was felt, those that are usable, and their problem."""
    tilted = with_tilt(samples, felt)
    return tilted, find_usable(tilted), *pose(tilted, reference, felt, settings, taken_out)
