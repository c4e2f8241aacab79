"""`fit_ellipse`: a two-axis compass, from readings while the vehicle turned level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.coverage import OPEN_DEG, Coverage, compute_coverage
from agonic.ellipse.maths.conic import find_start
from agonic.ellipse.result import TURN, EllipseFit, examine_circle
from agonic.ellipsoid.problem import make_calibration_of, pose, rows_of
from agonic.ellipsoid.solve import Found, list_numbers
from agonic.errors import AgonicError, CoverageError
from agonic.health import MIN_READINGS, figure
from agonic.maths.equation.channels import compute_distances
from agonic.maths.equation.coverage import count_visits
from agonic.maths.equation.maximum_likelihood import refine
from agonic.model.posterior import Posterior, find_posterior
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples


def fit_ellipse(
    samples: Samples, reference: Reference | None = None, *, robust: bool = True, seed: int = 0
) -> EllipseFit:
    """Bias and matrix in the plane that put the readings of a level two-axis compass on a circle.

    Minimises, with r the distance from the ellipse,

        Σ ρ(r_i/σ),   r = (|W(raw − bias)| − H)/|Wᵀû|

    by the five unknowns bias x y and W xx yy xy, W symmetric, beside the terms of every fit.

    Parameters
    ----------
    samples : readings with `axes="xy"`, while the vehicle turned level through all headings.
    reference : with the horizontal intensity H of the place. Without one the mean gain is set to 1;
        a heading needs no more.
    robust : down-weight outliers by Tukey's loss where a reading stands out. seed : of the starts.

    Returns an `EllipseFit`, refused where less than three quarters of the circle was seen. A turn
    of the sensor about the vertical is none of its unknowns: a deviation card has it (A).

    Raises `CoverageError` for readings too few or that never change, `AgonicError` for samples
    with a z axis.

    Source: Caruso (2000), Applications of magnetic sensors for low cost compass systems, IEEE
    Position Location and Navigation Symposium, 177–184, doi 10.1109/PLANS.2000.838300.

    Examples
    --------
    >>> angle, rng = np.radians(np.arange(0.0, 720.0)), np.random.default_rng(1)
    >>> circle = 20_000 * np.stack([np.cos(angle), -np.sin(angle), 0 * angle], axis=1)
    >>> noise = rng.normal(size=(720, 3)) * [50, 50, 0]
    >>> level = Samples(field=circle + [3000.0, -500.0, 0.0] + noise, axes="xy")
    >>> fit = fit_ellipse(level)
    >>> fit.verdict, bool(np.all(np.abs(fit.bias - [3000, -500, 0]) <= 4 * fit.sd[:3]))
    ('good', True)
    """
    if samples.axes != "xy":
        raise AgonicError(
            f'{samples.name} has three axes; fit_ellipsoid takes them all, and axes="xy" with '
            "zeros along z says that there are two"
        )
    _refuse_few(samples.field[:, :2])
    place, dip_deg = _find_place(samples, reference)
    posed = pose(samples, place, "likelihood")
    problem = posed.problem("ellipse", None)
    estimate = refine(problem, find_start(posed.points[:, :2], seed), robust)
    time = None if samples.time is None else samples.time[rows_of(posed.usable)]
    posterior = find_posterior(problem, estimate, time, posed.origin, inclination_deg=0.0)
    found = list_numbers(posterior.average(estimate) if posterior else estimate, "ellipse")
    told = "none: mean gain set to 1" if place is None else place.describe()
    calibration = replace(  # along z the mean gain, so that it can be undone
        make_calibration_of(samples, found, posed.scale, "symmetric"),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings={"fit": "ellipse", "robust": robust, "seed": seed, "reference": told},
            method=("huber-1981", "beaton-tukey-1974", "caruso-2000"),
        ),
    )
    return _assess(samples, calibration, posed.usable, found, posterior, dip_deg)


def _refuse_few(readings: Array) -> None:
    if len(readings) < MIN_READINGS:
        raise CoverageError(
            f"{len(readings)} readings cannot determine the five unknowns of an ellipse",
            turns="record a few hundred readings while the vehicle turns through all headings",
        )
    if float(np.ptp(readings, axis=0).min()) <= 1e-9 * float(np.abs(readings).max()):
        raise CoverageError(
            "an axis never changes: the sensor did not turn, or it is stuck",
            turns="turn the vehicle level through all headings while recording",
        )


def _find_place(
    samples: Samples, reference: Reference | None
) -> tuple[Reference | None, float | None]:
    """The mean horizontal intensity of the reference, as a magnitude, and its dip."""
    if reference is None:
        return None, None
    if reference.kind not in ("vector", "horizontal-vertical"):
        raise AgonicError(
            "the magnitude of the whole field was given, of which a level compass measures the "
            "horizontal part only: give the place (--at LAT,LON) instead, or neither, for headings "
            "need no magnitude"
        )
    h, z = reference.horizontal_and_vertical(len(samples)).mean(axis=0)
    level = Reference.constant(float(h), sd=reference.sd, source=reference.source)
    return level, float(np.degrees(np.arctan2(z, h)))


def _assess(
    samples: Samples,
    calibration: Affine,
    usable: Mask,
    found: Found,
    posterior: Posterior | None,
    dip_deg: float | None,
) -> EllipseFit:
    """The fit with its evidence."""
    raw, size = samples.field, np.array([calibration.magnitude])
    residuals, normals = compute_distances(raw, calibration.bias, calibration.matrix, size)
    weights = np.zeros(len(samples))
    weights[rows_of(usable)] = found.weights
    used, field = weights > 0, calibration.correct(raw)
    coverage = compute_coverage(calibration, count_visits(field[used]), 0.0)
    before, after = (np.linalg.norm(one[used], axis=1) for one in (raw, field))
    assert calibration.noise is not None
    fit = EllipseFit(
        samples=samples,
        calibration=calibration,
        n=len(samples),
        residuals=residuals,
        weights=weights,
        noise=calibration.noise,
        correlation=found.correlation,
        condition=found.condition,
        iterations=found.iterations,
        converged=found.converged,
        coverage=coverage,
        heading_sd_deg=min(coverage.heading_sd_deg, OPEN_DEG),
        spread_before=float(before.std() / before.mean()),
        spread_after=float(after.std() / after.mean()),
        inclination_deg=dip_deg,
        shares={} if posterior is None else posterior.list_shares(),
        remarks=_describe(calibration, coverage, dip_deg),
    )
    seen = replace(coverage, filled=fit.seen_deg / 360.0, turns=TURN, of="circle")
    fit = replace(fit, coverage=seen)
    return fit.with_findings(*examine_circle(fit, usable, normals, posterior))


def _describe(affine: Affine, coverage: Coverage, dip_deg: float | None) -> tuple[str, ...]:
    assert affine.sd is not None
    bias_sd, heading_sd = figure(float(affine.sd[:2].max())), figure(coverage.heading_sd_deg)
    said = f"standard error: bias {bias_sd} {affine.unit_in}, heading {heading_sd}°"
    if dip_deg is None:
        size = figure(affine.magnitude or 0.0, 5)
        return (
            f"{said} (level)",
            "no place was given, so the mean gain is set to 1 (horizontal intensity "
            f"{size} {affine.unit_in}); headings need no more",
        )
    tilt = figure(float(np.tan(np.radians(abs(dip_deg)))))
    return (f"{said} (level; each degree of tilt adds up to {tilt}°)",)
