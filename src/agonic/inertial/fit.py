"""`fit_inertial`: for what cannot be turned over, from raw accelerometer and gyro."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.calibration import make_calibration
from agonic.attitude.fit import estimate_usable, find_usable, make_fit, refine_usable
from agonic.attitude.problem import Scale
from agonic.attitude.settings import Gauge, Model
from agonic.calibration.affine import Affine
from agonic.errors import CoverageError
from agonic.fit import Fit
from agonic.health import FEWEST
from agonic.inertial.attitude import SETTLING_S, Inertial, feel_attitude
from agonic.inertial.covariance import add_inertial_noise
from agonic.inertial.known_mistakes import check_turning
from agonic.inertial.problem import pose, standard_deviations, with_tilt, without_errors
from agonic.inertial.result import InertialFit
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


class _Solved(NamedTuple):
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


def fit_inertial(
    samples: Samples,
    reference: Reference,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    accelerometer_sd_m_s2: float = 0.1,
    gyro_bias_sd_deg_s: float = 1.0,
    gyro_scale_sd: float = 0.02,
    speed_sd_m_s: float = 10.0,
    stretch_s: float = 30.0,
    seed: int = 0,
) -> InertialFit:
    """Bias and matrix by magnitude, dip and azimuth of the field beside accelerometer and gyro.

    With d down and e level, as the inertial unit feels them, and u = W (raw − bias):

        |u| = F,   u·d = F sin I,   atan2(u·(d × e), u·e) = ψ_k in every stretch k of time.

    The heading ψ_k of a stretch is never needed. The accelerometer's bias, the gyro's bias and
    scale, and a small turn between magnetometer and inertial unit are unknowns under priors; each
    of the three kinds of residual is weighted by its own scatter. Without a gyro, or without times,
    the azimuth is left out and each row's acceleration tells down.

    Parameters
    ----------
    samples : with `acceleration`, and best `rotation_rate` and `time`.
    reference : horizontal and vertical intensity: `Reference.horizontal_vertical`, or a vector in
        the frame n as `ag.wmm().along(samples)` gives it.

    model, gauge, sources, robust, soft_iron_sd, turn_sd_deg, inclination_deg, seed : as in
        `fit_levelled`.
    accelerometer_sd_m_s2 : standard deviation of the prior on each axis of its bias.
    gyro_bias_sd_deg_s, gyro_scale_sd : those of the gyro's bias, degrees a second, and scale.
    speed_sd_m_s : that of a speed which the vehicle keeps in turns, on each of its axes.
    stretch_s : seconds over which the gyro is trusted to keep a heading.

    Returns an `InertialFit`. Raises `LogError` without acceleration, `UnitError` for a reference
    that is a magnitude only, and `CoverageError` where nothing can be fitted at all.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981); the joint model after
    Huang, Hendeby & Skog, arXiv 2505.16662 (2025); variable projection (Golub & Pereyra 1973).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> made = simulate("circle", tilt_deg=8.0, n=2000)
    >>> bare = made.samples.with_columns(roll_deg=None, pitch_deg=None, heading_deg=None)
    >>> fit = fit_inertial(bare, Reference.vector(made.field_n, frame="n"))
    >>> bool((abs(fit.calibration.bias - made.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    settings = Settings(
        model=model,
        gauge=gauge,
        sources=tuple(sources),
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        turn_sd_deg=turn_sd_deg,
        inclination_deg=inclination_deg,
        accelerometer_sd_m_s2=accelerometer_sd_m_s2,
        gyro_bias_sd_deg_s=gyro_bias_sd_deg_s,
        gyro_scale_sd=gyro_scale_sd,
        speed_sd_m_s=speed_sd_m_s,
        stretch_s=stretch_s,
        seed=seed,
    )
    solved = _solve(samples, reference, settings)
    fit = make_fit(
        _with_inertial_noise(solved),
        solved.problem,
        solved.scale,
        solved.samples,
        solved.usable,
        solved.settings,
        "inertial",
    )
    q = len(solved.sds)
    errors = solved.found.solution.params[-q:] * solved.sds
    variances = np.diag(solved.found.solution.covariance)[-q:]
    fit = fit.with_findings(check_turning(samples))
    return InertialFit(
        **{f.name: getattr(fit, f.name) for f in fields(Fit)},
        samples=solved.samples,
        reference=solved.reference,
        felt=solved.felt,
        inertial_errors=errors,
        inertial_sd=np.sqrt(variances) * solved.sds,
        settings=solved.settings,
    )


def _with_inertial_noise(solved: _Solved) -> Estimate:
    """The estimate with what the noise of accelerometer and gyro leaves open."""
    rows, time = np.flatnonzero(solved.usable), solved.samples.time
    if time is None or solved.felt.ahead is None:
        return solved.found
    errors = solved.found.solution.params[-len(solved.sds) :] * solved.sds
    felt = feel_attitude(without_errors(solved.samples, errors))  # nothing but noise is left
    part = solved.problem.subset(rows)
    return add_inertial_noise(solved.found, part, time[rows], felt, SETTLING_S)


def fit_part(whole: InertialFit, samples: Samples, reference: Reference) -> Affine:
    """The calibration by some of the rows of a fit, beside the attitude that the fit felt."""
    rows = whole.find_rows(samples)
    felt = feel_attitude(samples) if rows is None else whole.felt.subset(rows)
    settings = whole.settings
    sds = standard_deviations(felt, settings)
    tilted, usable, problem, scale = _posed(
        samples, reference, felt, settings, whole.inertial_errors / sds
    )
    found = estimate_usable(problem, usable, settings)
    return make_calibration(found, problem, scale, tilted, settings, "inertial")


def _solve(samples: Samples, reference: Reference, settings: Settings) -> _Solved:
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


def _leans(solved: _Solved) -> bool:
    """Whether the vertical is worse than the readings, or its errors larger than they should be."""
    noise, unknowns = solved.found.noise, solved.found.solution.params[-len(solved.sds) :]
    worse = max(noise[channel].sd for channel in ("dip", "azimuth")) > 1.2 * noise["magnitude"].sd
    return bool(worse or np.abs(unknowns).max() > 2.0)


def _describe_length(solved: _Solved) -> float:
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
) -> _Solved:
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
        tilted, usable, problem, scale = _posed(part, reference, felt, settings, taken_out)
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
    return _Solved(found, problem, scale, tilted, reference, usable, felt, sds, settings)


def _posed(
    samples: Samples, reference: Reference, felt: Inertial, settings: Settings, taken_out: Array
) -> tuple[Samples, Mask, Problem, Scale]:
    """The samples with the tilt that was felt, those that are usable, and their problem."""
    tilted = with_tilt(samples, felt)
    return tilted, find_usable(tilted), *pose(tilted, reference, felt, settings, taken_out)
