"""`fit_ellipsoid`: from samples, with everything that rows can tell."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Mask
from agonic.calibration.affine import Affine
from agonic.ellipsoid.calibration import make_calibration, make_calibration_of
from agonic.ellipsoid.evidence import (
    assess,
    name_uncertainty,
    rows_of,
    wanted_magnitude,
    widen_by_change,
)
from agonic.ellipsoid.problem import normalise_start, pose
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
    no_ellipsoid,
    solve_algebraic,
    solve_likelihood,
)
from agonic.errors import CoverageError
from agonic.fit import Fit, ModelTest
from agonic.health import (
    Fitted,
    check_resolution,
    describe_model_errors,
    examine_model,
    inspect,
    widen,
)
from agonic.health.adequacy import ModelError
from agonic.logs.any_form import Given, as_samples
from agonic.maths.equation import moments
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples

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
        "auto": the smallest that nested tests do not reject.
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
    samples, reference = as_samples(samples, unit), Reference.of(reference)
    settings = Settings(
        model=model,
        method=method,
        robust=robust,
        soft_iron_sd=soft_iron_sd,
        gauge=gauge,
        inclination_deg=find_inclination_deg(inclination_deg, reference),
        seed=seed,
    )
    return _fit(samples, reference, settings)[0]


def fit_ellipsoid_and_estimates(
    samples: Samples, reference: Reference | None = None, **settings: Any
) -> tuple[Fit, tuple[Estimate, Estimate] | None]:
    """The fit of `fit_ellipsoid`, and the estimates before and after its residuals told how they
    scatter, where it is by likelihood: for `open_ellipsoid_parts`.

    >>> turned = Samples(field=50_000 * np.random.default_rng(0).normal(size=(20, 3)))
    >>> fit_ellipsoid_and_estimates(turned, model="sphere")[1] is None
    False
    """
    dip = find_inclination_deg(settings.get("inclination_deg"), reference)
    return _fit(samples, reference, Settings(**{**settings, "inclination_deg": dip}))


def _fit(
    samples: Samples, reference: Reference | None, settings: Settings
) -> tuple[Fit, tuple[Estimate, Estimate] | None]:
    """The fit with its evidence, and the estimates that it is of."""
    found, affine, usable, tests = _solve(samples, reference, settings)
    errors = _find_model_errors(found, affine, samples, reference, usable, settings)
    wider = widen(affine, errors, found.plain)
    fit = assess(found, wider, samples, reference, usable, tests, settings.inclination_deg)
    fit = widen_by_change(fit, errors)
    fit = fit.with_findings(*describe_model_errors(errors, fit.findings, samples.unit))
    return name_uncertainty(fit, found.plain, errors), found.estimates


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

    The minimum is sought from `near` only, where that is given.

    >>> turned = Samples(field=50_000 * np.random.default_rng(0).normal(size=(20, 3)))
    >>> fit_ellipsoid_alone(turned, model="sphere").model
    'sphere'
    """
    return _solve(samples, reference, Settings(**settings), near)[1]


def _solve(
    samples: Samples,
    reference: Reference | None,
    settings: Settings,
    near: Affine | None = None,
) -> tuple[Found, Affine, Mask, tuple[ModelTest, ...]]:
    """What was found, its noise in the unit of the readings, as a calibration too; the rows that
    could be used; the tests of models."""
    method = settings.method
    posed = pose(samples, reference, method)
    scale, points = posed.scale, posed.points
    start = None if near is None else normalise_start(near, scale)

    def attempt(model: Fixed) -> Found:
        if method != "likelihood":
            return solve_algebraic(moments.accumulate(points, np.zeros(3), 1.0), model, method)
        problem = posed.problem(model, settings.soft_iron_sd)
        return solve_likelihood(problem, model, posed.robust(settings), settings.seed, start)

    try:
        found, tests = choose_model(attempt, settings.model, len(points), method)
    except OverflowError:  # an axis that never moves leaves the fit without any hold
        raise _without_hold(samples) from None
    if not _HELD < np.linalg.norm(found.matrix) < 1 / _HELD:
        raise _without_hold(samples)
    affine = replace(
        make_calibration_of(samples, found, scale, settings.gauge),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings=settings.recorded(reference),
            method=CITATIONS[method],
        ),
    )
    assert affine.noise is not None
    plain = found.plain
    if plain is not None:
        alone = found._replace(covariance=plain)
        plain = make_calibration(alone, scale, samples.unit, settings.gauge).covariance
    return found._replace(noise=affine.noise, plain=plain), affine, posed.usable, tests


def _find_model_errors(
    found: Found,
    affine: Affine,
    samples: Samples,
    reference: Reference | None,
    usable: Mask,
    settings: Settings,
) -> tuple[ModelError, ...]:
    """What the residuals of the usable rows show that the model does not have."""
    if found.weights is None:
        return ()
    rows = rows_of(usable)
    magnitude = wanted_magnitude(affine, reference, len(samples))
    prior = np.zeros((9, 9))
    if settings.soft_iron_sd is not None:
        gain = float(np.trace(affine.matrix)) / 3
        prior[3:, 3:] = np.eye(6) / (settings.soft_iron_sd * gain) ** 2
    return examine_model(
        Fitted(
            calibration=affine,
            readings=samples.field[rows],
            time=None if samples.time is None else samples.time[rows],
            weights=found.weights,
            wanted=magnitude if len(magnitude) == 1 else magnitude[rows],
            noise=found.noise,
            correlation=found.correlation,
            prior=prior,
            inclination_deg=settings.inclination_deg,
        )
    )


def _without_hold(samples: Samples) -> CoverageError:
    """The error of readings whose fit runs away, with what they themselves give away of it."""
    across = float(np.ptp(samples.field, axis=0).max())
    found = [*inspect(samples), check_resolution(samples.field, across / 2, samples.unit)]
    cause = next((one for one in found if one is not None and one.severity == "refuse"), None)
    return no_ellipsoid() if cause is None else CoverageError(cause.what, turns=cause.move)
