"""`fit_ellipsoid`: from samples, with everything that rows can tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple, get_args

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.ellipsoid.calibration import CITATIONS, Gauge, Scale, calibration, settings
from agonic.ellipsoid.evidence import rows_of, with_evidence
from agonic.ellipsoid.solve import (
    Fixed,
    Found,
    Method,
    Model,
    algebraic,
    choose,
    likelihood,
    no_ellipsoid,
)
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.fit import Fit, ModelTest
from agonic.health import FEWEST, find_usable_rows, inspect
from agonic.maths.equation import likelihood as ellipsoid
from agonic.maths.equation import moments
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples


def fit_ellipsoid(
    samples: Samples,
    reference: Reference | None = None,
    *,
    model: Model = "auto",
    method: Method = "likelihood",
    robust: bool = True,
    soft_iron_sd: float | None = 0.1,
    gauge: Gauge = "symmetric",
    inclination_deg: float = 60.0,
    seed: int = 0,
) -> Fit:
    """Bias and matrix that put every calibrated reading at the field's magnitude.

    Minimises Σ ρ(r_i/σ) + |prior|²/2, r = (|W(raw − bias)| − F)/|Wᵀû| the distance from the
    ellipsoid in raw space.

    Parameters
    ----------
    samples : readings of one sensor; times are used to find correlation and changes.
    reference : magnitude F, constant or per sample, nT. Without one the mean gain is set to 1 and
        the result keeps the unit of the readings; `fit.remarks` says so.
    model : "sphere" (bias, one gain), "diagonal" (three gains), "full" (symmetric matrix), or
        "auto": the smallest that nested tests do not reject.
    method : "likelihood", "adjusted" (one pass, consistent), and the published "li-griffiths" and
        "linear" for comparison (both biased by noise; robust and prior do not apply).
    robust : down-weight outliers with Tukey's loss where a reading stands out.
    soft_iron_sd : standard deviation of the Gaussian prior on W/gain − identity; None for none.
    gauge : "symmetric", or "triangular" which keeps the z axis.
    inclination_deg : dip at which the heading's standard error is stated, degrees. seed : of the
        random starts.

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
    asked = Asked(model, method, robust, soft_iron_sd, gauge, inclination_deg, seed)
    found, affine, usable, tests = _solved(samples, reference, asked)
    assert affine.noise is not None
    return with_evidence(
        found._replace(noise=affine.noise),
        affine,
        samples,
        reference,
        usable,
        tests,
        inclination_deg,
    )


def ellipsoid_alone(
    samples: Samples, reference: Reference | None = None, **settings: Any
) -> Affine:
    """The calibration of `fit_ellipsoid` without its evidence, of which parts of a log make no use.

    >>> turned = Samples(field=50_000 * np.random.default_rng(0).normal(size=(20, 3)))
    >>> ellipsoid_alone(turned, model="sphere").model
    'sphere'
    """
    return _solved(samples, reference, Asked(**settings)).affine


class Asked(NamedTuple):
    """The settings of `fit_ellipsoid`."""

    model: Model = "auto"
    method: Method = "likelihood"
    robust: bool = True
    soft_iron_sd: float | None = 0.1
    gauge: Gauge = "symmetric"
    inclination_deg: float = 60.0
    seed: int = 0


class _Solved(NamedTuple):
    """What was found, as a calibration too; the rows that could be used; the tests of models."""

    found: Found
    affine: Affine
    usable: Mask
    tests: tuple[ModelTest, ...]


def _solved(samples: Samples, reference: Reference | None, asked: Asked) -> _Solved:
    """The estimate, and the calibration that it is in the units of the readings."""
    model, method, robust, soft_iron_sd, gauge, _, seed = asked
    check_choice("model", model, get_args(Model))
    check_choice("method", method, get_args(Method))
    check_choice("gauge", gauge, get_args(Gauge))
    usable = find_usable_rows(samples.field)
    scale, magnitude = normalised(samples, reference, usable, method)
    points = (samples.field[rows_of(usable)] - scale.centre) / scale.size

    def attempt(chosen: Fixed) -> Found:
        if method != "likelihood":
            return algebraic(moments.accumulate(points, np.zeros(3), 1.0), chosen, method)
        problem = ellipsoid.Problem(points, magnitude, chosen, soft_iron_sd)
        enough = len(points) >= 2 * FEWEST  # to tell a stray from the rest
        return likelihood(problem, chosen, robust and enough, seed)

    try:
        found, tests = choose(attempt, model, len(points), method)
    except OverflowError:  # an axis that never moves leaves the fit without any hold
        raise _without_hold(samples) from None
    chosen = settings(
        model, method, gauge, reference, robust=robust, soft_iron_sd=soft_iron_sd, seed=seed
    )
    affine = _labelled(calibration(found, scale, samples.unit, gauge), samples, chosen, method)
    return _Solved(found, affine, usable, tests)


def _without_hold(samples: Samples) -> CoverageError:
    """The error of readings whose fit runs away, with what they themselves give away of it."""
    refused = (found for found in inspect(samples) if found.severity == "refuse")
    cause = next(refused, None)
    return no_ellipsoid() if cause is None else CoverageError(cause.what, turns=cause.move)


def normalised(
    samples: Samples, reference: Reference | None, usable: Mask, method: str
) -> tuple[Scale, Array]:
    """Centre and size of the readings, and magnitudes scaled to mean one, (1,) or (n,)."""
    readings = samples.field[rows_of(usable)]
    centre = np.ones(len(readings)) @ readings / len(readings)
    size = float(np.linalg.norm(readings - centre) / np.sqrt(len(readings)))
    if size <= 1e-9 * float(np.linalg.norm(centre)):
        raise CoverageError(
            "the readings never change: the sensor did not turn, or it is stuck",
            turns="turn it about all three axes while recording",
        )
    if reference is None:
        return Scale(centre, size, None), np.ones(1)
    magnitudes = reference.magnitudes(len(samples))
    if len(magnitudes) > 1:
        if method != "likelihood":
            raise AgonicError(
                f"method {method!r} needs a constant magnitude; use method='likelihood'"
            )
        magnitudes = magnitudes[usable]
    mean = float(magnitudes.mean())
    return Scale(centre, size, mean, reference.sd), magnitudes / mean


def _labelled(affine: Affine, samples: Samples, chosen: Mapping[str, Any], method: str) -> Affine:
    """The calibration with its sensor, frame, range and provenance."""
    return replace(
        affine,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity.of(samples),
        provenance=Provenance(inputs=(samples.origin,), settings=chosen, method=CITATIONS[method]),
    )
