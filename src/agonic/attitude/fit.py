"""`fit_levelled`, `fit_vector`: from samples to a `Fit` aided by attitude, the choice of gauge, the
estimate, the evidence."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Mask
from agonic.attitude.calibration import (
    find_parameters,
    make_calibration,
)
from agonic.attitude.evidence import assess, find_dip_deg, find_down
from agonic.attitude.problem import (
    TURN,
    Gauge,
    Model,
    Scale,
    Settings,
    estimate_usable,
    is_robust,
    list_considered,
    name_missing_hold,
    normalise,
    select_usable,
)
from agonic.calibration.affine import Affine
from agonic.errors import CoverageError
from agonic.fit import Fit, ModelTest
from agonic.health import MIN_READINGS, figure, find_usable_rows
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation.affine import FREE, SYMMETRIC
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate, estimate_part
from agonic.maths.equation.noisy_terms import correct_for_current_noise
from agonic.maths.equation.priors import compute_turn
from agonic.maths.estimation.inference import wald
from agonic.model.posterior import find_posterior
from agonic.reference import Reference
from agonic.samples import Samples

CHANNELS = {"levelled": ("magnitude", "dip"), "vector": ("magnitude", "dip", "azimuth")}
"""What each fit takes of an attitude."""
TURN_SIGNIFICANT = 1e-4
"""A turn between sensor and vehicle is told when chance would make it this seldom."""


def fit_channels(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    name: str,
) -> Fit:
    """The fit of a calibration to the channels that are known; `name` is for the record. Where roll
    and pitch are known, a turn between sensor and vehicle shows in the dip: it is part of the fit,
    under a prior. A known heading determines it; the magnitude alone never shows it."""
    problem, scale, usable = _pose(samples, reference, channels, settings)
    found = estimate_usable(problem, usable, settings)
    with name_missing_hold():
        return make_fit(found, problem, scale, samples, usable, settings, name)


def fit_channels_alone(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    near: Affine | None = None,
) -> Affine:
    """The calibration of `fit_channels` without its evidence, of which parts of a log make no use.
    The minimum is sought from `near` first, where that is given, or else as there."""
    problem, scale, usable = _pose(samples, reference, channels, settings)
    start = None if near is None else find_parameters(near, problem, scale)
    found = estimate_usable(problem, usable, settings, start)
    with name_missing_hold():
        return make_calibration(found, problem, scale, samples, settings, "part")


def open_channels_parts(
    samples: Samples,
    reference: Reference,
    channels: tuple[str, ...],
    settings: Settings,
    near: Affine | None = None,
) -> Callable[[Mask], Affine]:
    """What gives the calibration by some of the rows (n,), as `fit_channels_alone` of them does.
    The minimum is sought from that of all rows, with their noise; a part that has another is fitted
    by itself."""
    problem, scale, usable = _pose(samples, reference, channels, settings)
    start = None if near is None else find_parameters(near, problem, scale)
    found = estimate_usable(problem, usable, settings, start)
    used = select_usable(problem, usable)

    def fit(rows: Mask) -> Affine:
        part = estimate_part(used, found, np.flatnonzero(rows[usable]))
        if part is None:
            own_rows = samples.select(rows), reference.select(rows)
            return fit_channels_alone(*own_rows, channels, settings, near)
        return make_calibration(part, problem, scale, samples, settings, "part")

    return fit


def _pose(
    samples: Samples, reference: Reference, channels: tuple[str, ...], settings: Settings
) -> tuple[Problem, Scale, Mask]:
    """The problem of all rows, its scale, and which rows can be used."""
    usable = find_usable(samples)
    if "azimuth" in channels:
        usable = usable & samples.heading_known
        if usable.sum() < MIN_READINGS:
            raise CoverageError(
                f"the heading is known in {int(usable.sum())} usable readings only",
                turns="record until the source of the heading has settled, or fit by roll and "
                "pitch",
            )
    gauge: str = settings.gauge
    if gauge == "auto":
        gauge = SYMMETRIC if "dip" not in channels else FREE
    problem, scale = normalise(samples, reference, channels, gauge, settings)
    return problem, scale, usable


def find_usable(samples: Samples) -> Mask:
    """The rows that a fit can use; raises `CoverageError` where they are too few."""
    usable = find_usable_rows(samples.field)
    if usable.sum() < MIN_READINGS:
        reasons = [f"{n} rows: {why}" for why, n in samples.rejected.items()]
        if not usable.all():
            reasons.append(f"{int((~usable).sum())} readings clipped or stuck")
        left_out = f" (left out: {', '.join(reasons)})" if reasons else ""
        raise CoverageError(
            f"{int(usable.sum())} usable readings are too few for a fit with the attitude"
            f"{left_out}",
            turns="record a few minutes of turning through all headings",
        )
    return usable


def make_fit(
    found: Estimate,
    problem: Problem,
    scale: Scale,
    samples: Samples,
    usable: Mask,
    settings: Settings,
    name: str,
) -> Fit:
    """The fit of an estimate from the usable rows, with what it leaves open and its evidence."""
    part = select_usable(problem, usable)
    tests: tuple[ModelTest, ...] = ()
    if settings.gauge == "auto" and problem.dip is not None and problem.across is None:
        tests = (_turn_test(problem, found),)
    if part.shared is None and "second" not in settings.sources:
        part, found = correct_for_current_noise(part, found, is_robust(part, settings))
    posterior, turned = None, False
    if settings.model == "full":
        considered = list_considered(found, part, scale)
        turned = TURN in considered
        posterior = find_posterior(
            part,
            found,
            None if samples.time is None else samples.time[usable],
            scale.centre / scale.size,
            inclination_deg=find_dip_deg(part, settings),
            down=find_down(part),
            considered=considered,
            alone=part.shared is not None,
        )
    if posterior is not None:
        found = posterior.average(found)
    affine = make_calibration(found, problem, scale, samples, settings, name)
    at = (problem, scale, samples, usable, tests, turned, settings, posterior)
    return assess(affine, found, *at)


def _turn_test(problem: Problem, found: Estimate) -> ModelTest:
    """Wald's test that the matrix is symmetric: no turn between the sensor and the attitude. It
    decides what is said. The turn stays in the fit under its prior, for what a test does not see is
    not zero, and standard errors of a matrix without it would not contain it."""
    turn, covariance = compute_turn(problem.basis, found.solution)
    # errors of the attitude last, and what lasts is known from few independent readings
    independent = len(problem.points) / found.noise["dip"].correlation
    statistic, p = wald(turn, covariance, independent)
    axes = "the axes of roll and pitch" if problem.shared is None else "the accelerometer"
    degrees = figure(float(np.degrees(np.linalg.norm(turn))))
    if p > TURN_SIGNIFICANT:
        words = f"no sign of a turn between the sensor and {axes}"
    elif problem.shared is None:
        words = (
            f"the sensor is misaligned by {degrees}° from {axes}, or their zero is wrong by the "
            "same amount: the heading's standard error allows for either"
        )
    else:
        words = f"the sensor is misaligned by {degrees}° from {axes}"
    return ModelTest(smaller=SYMMETRIC, larger=FREE, statistic=statistic, p_value=p, sentence=words)


def fit_vector(
    samples: Given,
    reference: Reference | ArrayLike | None,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that turn every reading into the field of the place in body axes.

    Beside magnitude and dip as in `fit_levelled`, the azimuth, with e horizontal, in body axes by
    the known attitude, and square to the field:

        u·e = 0

    Each kind of residual is weighted by its
    own scatter, so a heading of poor quality does no harm to what roll and pitch determine.

    Parameters
    ----------
    samples : with `roll_deg`, `pitch_deg` and `heading_deg`; the heading must not come from the
        magnetometer itself.
    reference : (n, 3) or constant, `Reference.vector` in the frame n.

    model, gauge, sources, robust, soft_iron_sd, turn_sd_deg, inclination_deg, seed : as in
        `fit_levelled`; the matrix is free by default.

    Returns a `Fit`. Raises as `fit_levelled`.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> flown = simulate("flight", n=2000, stray_nT_A=(0.0, 0.0, 0.0))
    >>> fit = fit_vector(flown.samples, Reference.vector(flown.field_n, frame="n"))
    >>> bool((abs(fit.calibration.bias - flown.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    chosen = Settings.of(locals())
    samples, reference = as_samples(samples), Reference.required(reference)
    return fit_channels(samples, reference, CHANNELS["vector"], chosen, "vector")


def fit_levelled(
    samples: Given,
    reference: Reference | ArrayLike | None,
    *,
    model: Model = "full",
    gauge: Gauge = "auto",
    sources: Sequence[str] = (),
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    turn_sd_deg: float | None = 2.0,
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that give every reading the magnitude and the dip of the place.

    With d the direction of down by roll and pitch, u = W (raw − bias), z = u·d, h = |u − z d|:

        √(z² + h²) = F,   H z − Z h = 0,   F² = H² + Z²,

    both as distances in raw space, each weighted by the scatter of its own residuals. This is the
    pair z = Z, h = H, turned so that errors of roll and pitch stay in one of the two. The heading
    never enters, so it may be wrong or missing.

    Parameters
    ----------
    samples : with `roll_deg` and `pitch_deg`.
    reference : (n, 2) or constant, `Reference.horizontal_vertical`: the horizontal and vertical
        intensity; or a vector (n, 3) in the frame n as `ag.wmm().along(samples)` gives it.
    model : "full" (default), "diagonal" or "sphere".
    gauge : "symmetric" (nine numbers), "free" (twelve: a small turn between the sensor and the
        axes of roll and pitch as well), or "auto": free.
    sources : what disturbs on board, recorded in the samples: "current_A", "throttle", "second"
        (a second magnetometer); the result is then an `Interference`.
    robust : down-weight outliers by Tukey's loss when a reading stands out.
    soft_iron_sd : standard deviation of the prior on the symmetric part of W/gain − identity.
    turn_sd_deg : that of the prior on the turn, about each axis.
    inclination_deg : dip at which the heading's standard error is stated; default: the place's.
    seed : of the search for where to start.

    Returns a `Fit`. Raises `LogError` without roll and pitch, `UnitError` for a reference that is a
    magnitude only, and `CoverageError` where nothing can be fitted at all.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981).

    Examples
    --------
    >>> from agonic.simulation import simulate
    >>> flown = simulate("flight", n=4000, noise=20.0, stray_nT_A=(0.0, 0.0, 0.0))
    >>> place = Reference.horizontal_vertical(25_000.0, 43_301.27)
    >>> fit = fit_levelled(flown.samples, place)
    >>> bool((abs(fit.calibration.bias - flown.truth.bias) < 4 * fit.sd[:3]).all())
    True
    """
    chosen = Settings.of(locals())
    samples, reference = as_samples(samples), Reference.required(reference)
    return fit_channels(samples, reference, CHANNELS["levelled"], chosen, "levelled")
