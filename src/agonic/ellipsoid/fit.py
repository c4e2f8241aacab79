"""`fit_ellipsoid`: from samples, with everything that rows can tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Mask
from agonic.calibration.affine import Affine
from agonic.ellipsoid.evidence import assess
from agonic.ellipsoid.problem import Posed, make_calibration_of, normalise_start, pose, rows_of
from agonic.ellipsoid.settings import (
    CITATIONS,
    STATED_DIP_DEG,
    Fixed,
    Gauge,
    Method,
    Model,
    Settings,
)
from agonic.ellipsoid.solve import (
    Found,
    choose_model,
    list_numbers,
    no_ellipsoid,
    seek,
    solve_algebraic,
    solve_likelihood,
)
from agonic.errors import CoverageError
from agonic.fit import Fit, ModelTest
from agonic.health import Finding, check_resolution, figure, inspect
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation import moments
from agonic.maths.equation.maximum_likelihood import estimate_part
from agonic.model.posterior import find_posterior
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples


def open_ellipsoid_parts(
    samples: Samples,
    reference: Reference | None = None,
    *,
    near: Affine | None = None,
    **settings: Any,
) -> Callable[[Mask], Affine]:
    """What gives the calibration by some of the rows (n,), as `fit_ellipsoid_alone` of them does.

    The minimum is sought from that of all rows, with their noise; where a part has another, or a
    model is still to be chosen, it is fitted by itself."""
    chosen = Settings(**settings)
    model = chosen.model

    def fit_alone(rows: Mask) -> Affine:
        known = None if reference is None else reference.select(rows)
        return fit_ellipsoid_alone(samples.select(rows), known, near=near, **settings)

    if model == "auto" or chosen.method != "likelihood":
        return fit_alone
    posed = pose(samples, reference, chosen.method)
    start = None if near is None else normalise_start(near, posed.scale)
    problem = posed.problem(model, chosen.soft_iron_sd)
    try:
        found = seek(problem, posed.robust(chosen), chosen.seed, start)
    except (OverflowError, np.linalg.LinAlgError):
        return fit_alone

    def fit(rows: Mask) -> Affine:
        some = np.flatnonzero(rows[posed.usable])
        part = estimate_part(problem, found, some)
        if part is None:
            return fit_alone(rows)
        numbers = list_numbers(part, model)
        return make_calibration_of(samples, numbers, posed.scale, chosen.gauge)

    return fit


MAX_LEFT_OF_CONSTANT = 0.5
"""What one magnitude for all rows leaves, over what those of the rows do: below, they are wrong."""
LEFT_UNSEEN = 1e-3
"""Of the field: what magnitudes leave less of it errs a heading by no more than 0.1°."""
MOST_LEFT = 0.02
"""Of the field: what a measured magnitude leaves more of it is no scatter of a magnetometer."""
_HELD = 1e-9  # of what the readings' own size suggests: a gain beyond that ran away


def fit_ellipsoid(
    samples: Given,
    reference: Reference | ArrayLike | None = None,
    *,
    unit: str | None = None,
    model: Model = "auto",
    method: Method = "likelihood",
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    gauge: Gauge = "symmetric",
    inclination_deg: float | None = None,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that put every calibrated reading at the field's magnitude.

    Minimises, with r the distance from the ellipsoid in raw space,

        Σ ρ(r_i/σ) + |prior|²/2,   r = (|W(raw − bias)| − F)/|Wᵀû|

    Parameters
    ----------
    samples : readings of one sensor, also as an array (n, 3), a table or the path of a recording
        (`as_samples`); times are used to find correlation and changes.
    reference : magnitude F, constant or per sample (n,), nT, also as a number. Without one the mean
        gain is set to 1 and the result keeps the unit of the readings; `fit.remarks` says so.
    unit : of readings that are an array or do not say.
    model : "sphere" (bias, one gain), "diagonal" (three gains), "full" (symmetric matrix), or
        "auto": the full one, of very few readings a sphere.
    method : "likelihood", "adjusted" (one pass, consistent), and the published "li-griffiths" and
        "linear" for comparison (both biased by noise; robust and prior do not apply).
    robust : down-weight outliers by Tukey's loss when a reading stands out.
    soft_iron_sd : standard deviation of the Gaussian prior on W/gain − identity; None for none.
    gauge : "symmetric", or "triangular" which keeps the z axis.
    inclination_deg : dip at which the heading's standard error is stated, degrees; default: that
        of the reference's place, or 60. seed : of the random starts.

    Returns a `Fit`; `fit.ok` and `fit.status` say whether to use it. Raises `CoverageError` where
    nothing can be fitted at all.

    Source: maximum likelihood with Huber's sandwich covariance (Huber 1981); adjusted least
    squares (Markovsky, Kukush & Van Huffel 2004); Li & Griffiths (2004).

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u = rng.normal(size=(2000, 3))
    >>> field = 50_000 * u / np.linalg.norm(u, axis=1, keepdims=True)
    >>> samples = Samples(field=field + [3000.0, -500.0, 100.0] + rng.normal(size=(2000, 3)) * 100)
    >>> fit = fit_ellipsoid(samples, Reference.constant(50_000))
    >>> bool(np.all(np.abs(fit.calibration.bias - [3000, -500, 100]) < 4 * fit.sd[:3]))
    True
    """
    samples, reference = as_samples(samples, unit), Reference.of(reference, unit)
    settings = Settings(
        model=model,
        method=method,
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        gauge=gauge,
        inclination_deg=find_inclination_deg(inclination_deg, reference),
        seed=seed,
    )
    return _fit(samples, reference, settings)


def _fit(samples: Samples, reference: Reference | None, settings: Settings) -> Fit:
    """The fit with all that is known of it."""
    solved = _solve(samples, reference, settings)
    posed, found, posterior = solved.posed, solved.found, None
    usable, at_rows = posed.usable, rows_of(posed.usable)
    if found.estimate is not None:
        time = None if samples.time is None else samples.time[at_rows]
        terms = posed.list_terms()
        posterior = find_posterior(
            posed.problem(found.model, settings.soft_iron_sd),
            found.estimate,
            time,
            posed.origin,
            inclination_deg=settings.inclination_deg,
            shrink=settings.model == "auto" and settings.soft_iron_sd is not None,
            terms=terms,
        )
        if posterior is not None and terms:  # which have what the reference may be wrong by
            posed = posed._replace(scale=posed.scale._replace(sd=0.0))
        if posterior is not None:
            params = posterior.params
            if found.model != "full":  # a smaller model, which was asked for, keeps its estimate
                params = found.estimate.solution.params
            averaged = posterior._replace(params=params).average(found.estimate)
            found = list_numbers(averaged, found.model)
    affine = _make_affine(posed, found, samples, reference, settings)
    assert affine.noise is not None
    found = found._replace(noise=affine.noise)
    at = (samples, reference, usable, solved.tests, settings.inclination_deg)
    fit = assess(found, affine, *at, posterior=posterior)
    if fit.verdict == "refused":
        return fit
    return fit.with_findings(_check_magnitudes(solved, samples, settings))


def _check_magnitudes(solved: _Solved, samples: Samples, settings: Settings) -> Finding | None:
    """The refusal of magnitudes that change from row to row as the readings do not: they leave much
    of the field, or one for all rows leaves far less."""
    course, magnitude = solved.posed.course, solved.posed.scale.magnitude
    if course is None or magnitude is None:
        return None
    alone = _solve(samples, Reference.constant(magnitude), settings).found
    left, least = (one.noise * float(np.trace(one.matrix)) / 3 for one in (solved.found, alone))
    left = float(np.hypot(left, course.noise))
    if left < (MOST_LEFT if least > MAX_LEFT_OF_CONSTANT * left else LEFT_UNSEEN):
        return None
    given, by_one = (figure(noise * magnitude) for noise in (left, least))
    return Finding(
        "scale",
        "refuse",
        f"the magnitudes of the reference leave {given} nT of the readings, one magnitude for all "
        f"{by_one} nT: they are not those of the field at the sensor",
        "look which column is the scalar instrument, whether it works, and at its clock",
    )


def find_inclination_deg(given: float | None, reference: Reference | None) -> float:
    """The dip at which the heading's standard error is stated."""
    of_place = None if reference is None else reference.inclination_deg
    return next(dip for dip in (given, of_place, STATED_DIP_DEG) if dip is not None)


def fit_ellipsoid_alone(
    samples: Samples,
    reference: Reference | None = None,
    *,
    near: Affine | None = None,
    **settings: Any,
) -> Affine:
    """The calibration of `fit_ellipsoid` without its evidence, of which parts of a log make no use.

    The minimum is sought from `near` only, where that is given."""
    chosen = Settings(**settings)
    solved = _solve(samples, reference, chosen, near)
    return _make_affine(solved.posed, solved.found, samples, reference, chosen)


class _Solved(NamedTuple):
    """What was asked, what was found of it, and the tests of smaller models."""

    posed: Posed
    found: Found
    tests: tuple[ModelTest, ...]


def _solve(
    samples: Samples,
    reference: Reference | None,
    settings: Settings,
    near: Affine | None = None,
) -> _Solved:
    method = settings.method
    posed = pose(samples, reference, method)
    points = posed.points
    start = None if near is None else normalise_start(near, posed.scale)

    def attempt(model: Fixed) -> Found:
        if method != "likelihood":
            return solve_algebraic(moments.accumulate(points, np.zeros(3), 1.0), model, method)
        problem = posed.problem(model, settings.soft_iron_sd)
        return solve_likelihood(problem, model, posed.robust(settings), settings.seed, start)

    try:
        found, tests = choose_model(attempt, settings.model, len(points))
    except OverflowError:  # an axis that never moves leaves the fit without any hold
        raise _without_hold(samples) from None
    if not _HELD < np.linalg.norm(found.matrix) < 1 / _HELD:
        raise _without_hold(samples)
    return _Solved(posed, found, tests)


def _make_affine(
    posed: Posed,
    found: Found,
    samples: Samples,
    reference: Reference | None,
    settings: Settings,
) -> Affine:
    """The calibration, with where it is from."""
    return replace(
        make_calibration_of(samples, found, posed.scale, settings.gauge),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings=settings.recorded(reference),
            method=CITATIONS[settings.method],
        ),
    )


def _without_hold(samples: Samples) -> CoverageError:
    """The error of readings whose fit runs away, with what they themselves give away of it."""
    across = float(np.ptp(samples.field, axis=0).max())
    found = [*inspect(samples), check_resolution(samples.field, across / 2, samples.unit)]
    cause = next((one for one in found if one is not None and one.severity == "refuse"), None)
    return no_ellipsoid() if cause is None else CoverageError(cause.what, turns=cause.move)
