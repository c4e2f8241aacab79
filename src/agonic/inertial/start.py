"""The first estimate, beside the attitude that is felt, and the field where it is not known."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.fit import find_usable
from agonic.attitude.problem import Scale, estimate_usable, refine_usable
from agonic.errors import CoverageError
from agonic.health import MIN_READINGS
from agonic.inertial.attitude import Inertial, estimate_attitude
from agonic.inertial.maths.factors import Headings
from agonic.inertial.maths.joint import Joint
from agonic.inertial.problem import (
    INCLINATION_SD,
    Settings,
    pose,
    standard_deviations,
    with_tilt,
    without_errors,
)
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.new_rows import find_fresh
from agonic.reference import Reference
from agonic.samples import Samples

SLOW_M_S = 0.2
"""Of a sensor that is turned in the hand, or a vehicle that turns where it stands."""
MIN_SPEED_EVIDENCE = 10.0
"""A speed is taken to be there where it makes the readings e^10 times as probable."""
_ROUNDS = 4
_START_ROWS = 1500  # rows to start with
_HEMISPHERE_ROWS = 500  # rows to tell the hemisphere
FOUND = "found beside accelerometer and gyro"
"""The source of a field whose dip is not that of a place."""
_DIPS = np.radians([65.0, -65.0, 20.0, -20.0])
_ALIKE = 1.2  # sd of the dip over that of the magnitude: no other dip fits better
MATTERS = np.repeat([0.02, np.radians(0.1), 0.005, 0.2], 3)
"""Errors of the accelerometer, m/s², of the gyro, rad/s and scale, and a speed, m/s, that are too
small to act twice."""


class Solved(NamedTuple):
    """An estimate with the problem that it solves, of which rows, and the attitude it rests on.
    `walk_deg`, °/√s, is by how much the gyro walks away from the attitudes of a joint estimate,
    `tilt_noise` the variance of the errors of their tilt over that of the tilt itself;
    `contradictory` where no such attitudes were found; `joined` is that estimate, and its
    problem."""

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
    headings: Headings | None = None
    walk_deg: float = 0.0
    tilt_noise: float = 0.0
    contradictory: bool = False
    joined: tuple[Problem, Joint] | None = None

    @property
    def errors(self) -> Array:
        """The errors of the unit that were found, (q,)."""
        return np.asarray(self.found.solution.params[-len(self.sds) :] * self.sds)


def find_field(
    samples: Samples, given: Reference | None, settings: Settings
) -> tuple[Reference, Array]:
    """Horizontal and vertical intensity that readings and inertial unit agree on, and the unknowns
    that were found with them. Without a magnitude it is the one that makes the mean gain one. Some
    hundred rows tell which of several dips leads to the least noise, for the dip of the wrong
    hemisphere is a minimum too; but one by which the dip scatters as little as the magnitude is the
    right one. Only that is refined, by some thousand rows."""
    felt = estimate_attitude(samples)
    rows = np.flatnonzero(felt.known)
    rows = rows[:: max(1, len(rows) // _START_ROWS)]
    some, felt = samples.select(rows), felt.subset(rows)
    settings = replace(settings, speed_sd_m_s=SLOW_M_S)
    none = np.zeros(len(standard_deviations(felt, settings)))
    spread = float(np.linalg.norm(some.field.std(axis=0)))
    sizes = np.full(len(samples), spread) if given is None else given.magnitudes(len(samples))
    sizes = np.broadcast_to(sizes, len(samples))

    def pose_at(dip: float) -> tuple[Mask, Problem, Scale]:
        place = make_dipping(sizes, dip).select(rows)
        return pose_felt(some, place, felt, settings, none)[1:]

    tried: list[tuple[float, float, Array]] = []
    for dip in _DIPS:
        usable, problem, _ = pose_at(dip)
        found = estimate_usable(problem, thin_out(usable, _HEMISPHERE_ROWS), settings)
        params = found.solution.params
        noise = sum(float(np.log(one.sd)) for one in found.noise.values())
        likely = abs(_find_dip(dip, params)) < np.pi / 2
        tried.append((noise if likely else np.inf, dip, params))
        if likely and found.noise["dip"].sd < _ALIKE * found.noise["magnitude"].sd:
            break
    _, dip, params = min(tried, key=lambda one: one[0])
    usable, problem, scale = pose_at(dip)
    params = refine_usable(problem, usable, settings, params).solution.params
    _, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    gain = float(np.trace(matrix)) / 3 * scale.magnitude / scale.size
    near = np.append(params[:-1], 0.0)  # the dip is that of the reference now
    return make_dipping(sizes / gain if given is None else sizes, _find_dip(dip, params)), near


def _find_dip(dip: float, params: Array) -> float:
    """The dip that unknowns make of an assumed one, rad."""
    return dip + INCLINATION_SD * float(params[-1])


def make_dipping(sizes: Array, dip: float) -> Reference:
    """The field (n,) of a dip, rad."""
    return Reference.horizontal_vertical(sizes * np.cos(dip), sizes * np.sin(dip), source=FOUND)


def choose_speed(
    samples: Samples, reference: Reference, settings: Settings, near: Array | None = None
) -> Solved:
    """The estimate of a vehicle that hardly moves, or of one that keeps a speed in turns. A speed
    in a steady turn leans the vertical just as a bias of the accelerometer does, so it is taken to
    be there only where it makes the residuals much smaller."""
    still = _solve_with(samples, reference, settings, SLOW_M_S, near)
    if still.felt.ahead is None:
        return still
    noise, unknowns = still.found.noise, still.found.solution.params[-len(still.sds) :]
    worse = max(noise[channel].sd for channel in ("dip", "azimuth")) > 1.2 * noise["magnitude"].sd
    if not worse and np.abs(unknowns).max() <= 2.0:  # the vertical is as good as the readings
        return still
    near = still.found.solution.params.copy()
    near[len(near) - len(still.sds) + 9 :][:3] *= SLOW_M_S / settings.speed_sd_m_s
    moving = _solve_with(samples, reference, settings, settings.speed_sd_m_s, near)
    return moving if _compare_lengths(moving, still) > MIN_SPEED_EVIDENCE else still


def _compare_lengths(one: Solved, other: Solved) -> float:
    """The logarithm of how much more probable one estimate makes the readings than another. Both
    count as many independent rows, those of the longer correlation: rows that one takes to be
    independent and the other not would outweigh everything else."""
    gain = _describe_length(other) - _describe_length(one)
    for channel, noise in one.found.noise.items():
        against = other.found.noise[channel]
        n = len(one.found.residuals[channel]) / max(noise.correlation, against.correlation)
        gain += n * float(np.log(against.sd / noise.sd))
    return gain


def _describe_length(solved: Solved) -> float:
    """Minus the logarithm of what the priors make of an estimate, by Laplace's approximation."""
    found, problem = solved.found, solved.problem
    length = 0.0
    prior = problem.prior(problem.soft_iron_sd)
    if prior is not None:
        residuals = prior(found.solution.params)[0]
        length += float(residuals @ residuals) / 2
    # unknowns in units of their priors: what of these the readings leave
    covariance = found.solution.covariance[-len(solved.sds) :, -len(solved.sds) :]
    return length - float(np.linalg.slogdet(covariance)[1]) / 2


def _solve_with(
    samples: Samples,
    reference: Reference,
    settings: Settings,
    speed_sd_m_s: float,
    near: Array | None = None,
) -> Solved:
    """The estimate from the rows whose attitude is known. With a gyro some thousand rows are
    enough, for what they find is only where the joint estimate starts. The errors of the inertial
    unit act to first order, so those that were found are taken out and the attitude is felt again,
    until little is left."""
    felt = estimate_attitude(samples)
    known = np.flatnonzero(felt.known)
    if len(known) < MIN_READINGS:
        raise CoverageError(
            f"accelerometer and gyro determine the attitude of {len(known)} readings only",
            turns="record without pauses, and the acceleration with every reading",
        )
    part, reference = samples.select(known), reference.select(known)
    settings = replace(settings, speed_sd_m_s=speed_sd_m_s)
    sds = standard_deviations(felt, settings)
    taken_out, found = np.zeros(len(sds)), None
    for _ in range(_ROUNDS):
        felt = felt.subset(known)
        tilted, usable, problem, scale = pose_felt(part, reference, felt, settings, taken_out)
        some = usable if felt.ahead is None else thin_out(usable)
        if near is None:
            found = estimate_usable(problem, some, settings)
        else:
            found = refine_usable(problem, some, settings, near)
        near = found.solution.params
        unknowns = near[-len(sds) :]
        unit = min(len(MATTERS), 3 * (len(sds) // 3))
        if np.abs(((unknowns - taken_out) * sds)[:unit] / MATTERS[:unit]).max() < 1.0:
            break
        taken_out = unknowns
        felt = estimate_attitude(without_errors(samples, taken_out * sds))
    assert found is not None
    return Solved(found, problem, scale, tilted, reference, usable, felt, sds, settings)


def thin_out(usable: Mask, most: int = _START_ROWS) -> Mask:
    """Some thousand of the rows that are usable."""
    rows = np.flatnonzero(usable)
    some = np.zeros(len(usable), dtype=bool)
    some[rows[:: max(1, len(rows) // most)]] = True
    return some


def pose_felt(
    samples: Samples, reference: Reference, felt: Inertial, settings: Settings, taken_out: Array
) -> tuple[Samples, Mask, Problem, Scale]:
    """The samples with the tilt that was felt, those that are usable, and their problem."""
    tilted = with_tilt(samples, felt)
    usable = find_usable(tilted) & find_fresh(samples.field)
    return tilted, usable, *pose(tilted, reference, felt, settings, taken_out)
