"""The evidence for a calibration on a sensor's readings, just fitted or given."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.coverage import cover
from agonic.ellipsoid.calibration import finished, remarks, scale_finding
from agonic.ellipsoid.solve import Found
from agonic.errors import AgonicError
from agonic.fit import Fit, ModelTest
from agonic.health import (
    Evidence,
    Finding,
    examine,
    examine_attitude_aided,
    find_usable_rows,
    inspect,
)
from agonic.maths.equation import likelihood
from agonic.maths.equation.affine import correct
from agonic.maths.equation.coverage import count_visits
from agonic.maths.estimation.noise import estimate_noise
from agonic.reference import Reference
from agonic.samples import Samples

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
    `by_magnitude` is false for one that the attitude taught: readings in a plane are no fault then.

    >>> from agonic.simulation import random_calibration
    >>> given = random_calibration(np.random.default_rng(0))
    >>> evaluate(given, Samples(field=np.eye(3) * 50_000))
    Traceback (most recent call last):
    agonic.errors.AgonicError: the calibration carries no covariance; fit it again with agonic
    """
    if calibration.covariance is None or calibration.magnitude is None:
        raise AgonicError("the calibration carries no covariance; fit it again with agonic")
    usable = find_usable_rows(samples.field)
    wanted = _wanted(calibration, reference, len(samples))
    residuals, _ = likelihood.distances(samples.field, calibration.bias, calibration.matrix, wanted)
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
    return with_evidence(
        found,
        calibration,
        samples,
        reference,
        usable,
        (),
        inclination_deg,
        examine if by_magnitude else examine_attitude_aided,
    )


def _wanted(affine: Affine, reference: Reference | None, n: int) -> Array:
    """The magnitude that the calibrated field should have, (1,) or (n,), in its unit."""
    assert affine.magnitude is not None
    if reference is None or affine.unit_out != "nT":
        return np.array([affine.magnitude])
    return reference.magnitudes(n)


def _known_radius(affine: Affine, reference: Reference | None) -> float | None:
    """What the readings' radius is at least, as far as their unit tells."""
    if affine.unit_in != "nT":
        return None
    return affine.magnitude if reference else WEAKEST_FIELD


def rows_of(mask: Mask) -> slice | Mask:
    """An index for the rows that a mask names, which copies nothing where it names them all."""
    return slice(None) if mask.all() else mask


def with_evidence(
    found: Found,
    affine: Affine,
    samples: Samples,
    reference: Reference | None,
    usable: Mask,
    tests: tuple[ModelTest, ...],
    inclination_deg: float,
    examined: Callable[[Evidence], tuple[Finding, ...]] = examine,
) -> Fit:
    """The fit: residuals of every row, coverage, findings and remarks.

    `found` tells noise, weights and the solver's numbers, its noise in the unit of the readings.
    """
    assert affine.magnitude is not None
    assert affine.covariance is not None
    residuals, normals = likelihood.distances(
        samples.field, affine.bias, affine.matrix, _wanted(affine, reference, len(samples))
    )
    kept = rows_of(usable)
    weights = np.zeros(len(samples))
    weights[kept] = 1.0 if found.weights is None else found.weights
    field = correct(samples.field, affine.bias, affine.matrix)
    coverage = cover(
        count_visits(field[rows_of(weights > 0)]),
        affine.magnitude,
        affine.bias,
        affine.matrix,
        affine.covariance,
        gauge=affine.gauge,
        inclination_deg=inclination_deg,
    )
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
        remarks=remarks(affine, coverage, tests, reference is not None),
    )
    gain = float(np.trace(affine.matrix) / 3)
    evidence = Evidence(
        readings=samples.field[kept],
        time=None if samples.time is None else samples.time[kept],
        residuals=residuals[kept],
        weights=weights[kept],
        normals=normals[kept],
        bias=affine.bias,
        shape=affine.matrix / gain,
        radius=affine.magnitude / gain,
        noise=found.noise,
        correlation=found.correlation,
        coverage=coverage,
        unit=samples.unit,
        known_radius=_known_radius(affine, reference),
    )
    if fit.verdict == "refused":
        return finished(fit, ())
    wrong = examined(evidence)
    refused = any(finding.severity == "refuse" for finding in wrong)
    return finished(fit, (*wrong, None if refused else scale_finding(affine)))
