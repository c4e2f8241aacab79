"""The evidence for a calibration on a sensor's readings, just fitted or given; and what gravity
says of its axes."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.coverage import compute_coverage
from agonic.ellipsoid.problem import describe_result, rows_of, state_accuracy
from agonic.ellipsoid.solve import Found
from agonic.errors import AgonicError
from agonic.fit import Fit, ModelTest, gather_evidence
from agonic.health import (
    check_axes,
    check_magnitude,
    check_resolution,
    check_scale,
    find_usable_rows,
    inspect,
)
from agonic.maths.equation.channels import compute_distances
from agonic.maths.equation.coverage import count_visits
from agonic.maths.estimation.noise.residuals import estimate_noise
from agonic.maths.rotations.attitude import down_b
from agonic.model.posterior import Posterior
from agonic.model.verdict import examine_beside_terms, judge
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2


def check_by_gravity(fit: Fit, samples: Samples, reference: Reference | None) -> Fit:
    """The fit, with a finding where its axes are not those of the accelerometer in the same rows.

    Magnitude cannot see exchanged or reversed axes. Without an accelerometer roll and pitch tell
    where gravity was. Parameters: the fit of these samples and its reference, whose vertical part,
    where it is known, tells up from down.
    """
    beside, force = _find_force(samples)
    if force is None or fit.verdict == "refused":
        return fit
    used = slice(None) if fit.weights is None else fit.weights > 0
    calibration = fit.calibration
    assert calibration.magnitude is not None
    found = check_axes(
        calibration.correct(samples.field[used]),
        force[used],
        calibration.magnitude,
        _upwards(reference),
        beside,
    )
    return fit if found is None else fit.with_findings(found)


def _find_force(samples: Samples) -> tuple[str, Array | None]:
    """What tells where gravity was, and the specific force (n, 3) by it."""
    if samples.acceleration is not None or samples.roll_deg is None or samples.pitch_deg is None:
        return "the accelerometer beside it", samples.acceleration
    down = down_b(samples.roll_deg, samples.pitch_deg)
    return "roll and pitch", -STANDARD_GRAVITY_M_S2 * down


def _upwards(reference: Reference | None) -> bool | None:
    """Whether the field points up, where the reference knows."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        return None
    if reference.kind == "vector" and reference.frame != "n":
        return None
    return bool(np.mean(reference.horizontal_and_vertical(len(reference.values))[:, 1]) < 0)


WEAKEST_FIELD = 22_000.0
"""The Earth's field at the ground is nowhere weaker (South Atlantic), nT."""


def evaluate(
    calibration: Affine,
    samples: Samples,
    reference: Reference | None = None,
    *,
    inclination_deg: float = 60.0,
    by_magnitude: bool = True,
) -> Fit:
    """A calibration with what these samples say of it; nothing is fitted.

    Parameters as in `fit_ellipsoid`; without a reference the calibration's own magnitude counts.
    `by_magnitude` is false for one aided by attitude: readings in a plane are no fault then.

    >>> from agonic.simulation import random_calibration
    >>> given = random_calibration(np.random.default_rng(0))
    >>> evaluate(given, Samples(field=np.eye(3) * 50_000))
    Traceback (most recent call last):
    agonic.errors.AgonicError: the calibration carries no covariance; fit it again with agonic
    """
    if calibration.covariance is None or calibration.magnitude is None:
        raise AgonicError("the calibration carries no covariance; fit it again with agonic")
    if calibration.model == "ellipse":
        raise AgonicError(
            f"the calibration of {calibration.sensor} is of two axes; needed are three"
        )
    usable = find_usable_rows(samples.field)
    magnitude = wanted_magnitude(calibration, reference, len(samples))
    residuals, _ = compute_distances(samples.field, calibration.bias, calibration.matrix, magnitude)
    residuals = residuals[rows_of(usable)]
    noise = estimate_noise(residuals, robust=True, parameters=0)
    found = Found(
        calibration.model,
        calibration.bias,
        calibration.matrix,
        calibration.covariance,
        noise.sd,
        noise.correlation,
        residuals,
        noise.loss.weight((residuals / noise.sd) ** 2),
    )
    return assess(
        found,
        calibration,
        samples,
        reference,
        usable,
        (),
        inclination_deg,
        attitude_aided=not by_magnitude,
    )


def wanted_magnitude(affine: Affine, reference: Reference | None, n: int) -> Array:
    """The magnitude that the calibrated field should have, (1,) or (n,), in its unit."""
    assert affine.magnitude is not None
    if reference is None or affine.unit_out != "nT":
        return np.array([affine.magnitude])
    return reference.magnitudes(n)


def _states_reference(affine: Affine) -> bool:
    """Whether a calibration that is only looked at was made with a reference."""
    settings = affine.provenance.settings
    by_magnitude = settings.get("fit", "ellipsoid") == "ellipsoid"
    return not (by_magnitude and str(settings.get("reference", "none")).startswith("none"))


def _known_radius(affine: Affine, reference: Reference | None) -> float | None:
    """What the readings' radius is at least, as far as their unit tells."""
    if affine.unit_in != "nT":
        return None
    return affine.magnitude if reference else WEAKEST_FIELD


def assess(
    found: Found,
    affine: Affine,
    samples: Samples,
    reference: Reference | None,
    usable: Mask,
    tests: tuple[ModelTest, ...],
    inclination_deg: float,
    *,
    attitude_aided: bool = False,
    posterior: Posterior | None = None,
) -> Fit:
    """The fit: residuals of every row, coverage, findings and remarks.

    `found` gives noise, in the unit of the readings, weights and the solver's numbers, of the rows
    `usable` (n,).
    """
    residuals, normals = compute_distances(
        samples.field, affine.bias, affine.matrix, wanted_magnitude(affine, reference, len(samples))
    )
    weights = np.zeros(len(samples))
    weights[rows_of(usable)] = 1.0 if found.weights is None else found.weights
    field = affine.correct(samples.field)
    coverage = compute_coverage(affine, count_visits(field[rows_of(weights > 0)]), inclination_deg)
    fit = Fit(
        calibration=affine,
        n=int(usable.sum()),
        residuals=residuals,
        weights=weights,
        noise=found.noise,
        correlation=found.correlation,
        condition=found.condition,
        iterations=found.iterations,
        converged=found.converged,
        coverage=coverage,
        tests=tests,
        findings=inspect(samples),
        shares={} if posterior is None else posterior.list_shares(),
        accuracy=state_accuracy(affine, coverage),
        remarks=(
            *describe_result(affine, tests, reference is not None or _states_reference(affine)),
            *(one.said for one in (posterior.shares if posterior else ()) if one.said),
        ),
    )
    if fit.verdict == "refused":
        return fit.with_findings()
    known = _known_radius(affine, reference)
    evidence = gather_evidence(fit, affine, samples, samples.field, normals, usable, known)
    facts = examine_beside_terms(evidence, posterior, attitude_aided=attitude_aided)
    fit = fit.with_findings(*facts, *judge(posterior, evidence, facts))
    if not any(finding.name == "static" for finding in fit.findings):
        fit = fit.with_findings(check_resolution(samples.field, evidence.radius, samples.unit))
    if fit.verdict == "refused":
        return fit
    stated = reference is not None or _states_reference(affine)
    gain = find_gain(affine)
    size = check_magnitude(affine.magnitude, affine.unit_in, gain if stated else None)
    return fit.with_findings(check_scale(gain, affine.unit_in), size)


def find_gain(affine: Affine) -> float:
    """The gain of the whole, by the volume, which no turn of the axes changes."""
    return float(np.cbrt(np.linalg.det(affine.matrix)))
