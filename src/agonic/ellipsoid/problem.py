"""From samples to what the estimator takes, points of about one about their centre and magnitudes,
and from a fit in these coordinates to a calibration in the units of the readings."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.coverage import Coverage
from agonic.ellipsoid.settings import Fixed, Gauge, Settings
from agonic.ellipsoid.solve import Found
from agonic.errors import AgonicError, CoverageError
from agonic.fit import Accuracy, ModelTest
from agonic.health import MIN_READINGS, figure, find_rounding, find_usable_rows
from agonic.maths.equation import gauge as gauges
from agonic.maths.equation.channels import Problem
from agonic.model.term import Term
from agonic.model.terms.reference import Course, follow_magnitude, list_reference_terms
from agonic.reference import Reference
from agonic.samples import Samples

Scale = gauges.Units


def make_calibration(found: Found, scale: Scale, unit: str, gauge: Gauge) -> Affine:
    """The calibration in the units of the readings, scale and gauge made explicit."""
    bias, matrix, covariance, magnitude = gauges.convert_to_units(
        found.bias, found.matrix, found.covariance, scale, gauge
    )
    return Affine(
        bias=bias,
        matrix=matrix,
        covariance=covariance,
        unit_in=unit,
        unit_out=unit if scale.magnitude is None else "nT",
        gauge=gauge,
        model=found.model,
        magnitude=float(magnitude),
        noise=found.noise * scale.size,
    )


def make_calibration_of(samples: Samples, found: Found, scale: Scale, gauge: Gauge) -> Affine:
    """The same with whose readings it is of."""
    return replace(
        make_calibration(found, scale, samples.unit, gauge),
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=samples.frame,
        frame_out=samples.frame,
        validity=Validity.of(samples),
    )


def state_accuracy(affine: Affine, coverage: Coverage) -> Accuracy:
    """How well the result is known."""
    assert affine.sd is not None
    return Accuracy(
        bias_sd=float(affine.sd[:3].max()),
        unit=affine.unit_in,
        own_deg=coverage.heading_sd_deg,
        inclination_deg=coverage.inclination_deg,
        alone=True,
    )


def describe_result(
    affine: Affine, tests: tuple[ModelTest, ...], reference_known: bool
) -> tuple[str, ...]:
    """What else there is to say of the result."""
    assert affine.magnitude is not None
    said = [test.sentence for test in tests[:1]]
    if not reference_known:
        said.append(describe_missing_scale(affine.magnitude, affine.unit_in))
    return tuple(said)


def describe_missing_scale(magnitude: float, unit: str) -> str:
    """What was done for want of a reference."""
    return (
        "no reference magnitude was given, so the mean gain is set to 1 "
        f"(magnitude {figure(magnitude, 5)} {unit})"
    )


class Posed(NamedTuple):
    """Which rows are usable (n,), their scale, points (k, 3) and magnitudes, (1,) or (k,), what
    rounding scatters a point, and the course of the magnitudes where they were measured."""

    usable: Mask
    scale: Scale
    points: Array
    magnitude: Array
    rounding: float
    course: Course | None = None

    def problem(self, model: Fixed, soft_iron_sd: float | None) -> Problem:
        """The problem of one model."""
        return Problem(self.points, self.magnitude, model, soft_iron_sd, rounding=self.rounding)

    def list_terms(self) -> tuple[Term, ...]:
        """What a magnitude that was measured at every row may be wrong by."""
        size = self.scale.magnitude
        if self.course is None or size is None:
            return ()
        return list_reference_terms(self.course.rate, self.scale.sd / size, size)

    @property
    def origin(self) -> Array:
        """What is to be added to points (3,) for readings from zero, over the same size."""
        return np.asarray(self.scale.centre / self.scale.size)

    def robust(self, settings: Settings) -> bool:
        """Whether outliers are down-weighted: there are enough readings to tell one from the
        rest."""
        return settings.robust and len(self.points) >= 2 * MIN_READINGS


def pose(samples: Samples, reference: Reference | None, method: str) -> Posed:
    """What samples and reference ask of the estimator."""
    usable = find_usable_rows(samples.field)
    scale, magnitude = normalise(samples, reference, usable, method)
    points = (samples.field[rows_of(usable)] - scale.centre) / scale.size
    rounding = find_rounding(samples.field) / scale.size
    if reference is None or reference.kind != "magnitude" or len(magnitude) < len(points):
        return Posed(usable, scale, points, magnitude, rounding)
    time = None if samples.time is None else samples.time[rows_of(usable)]
    course = follow_magnitude(magnitude, time)
    return Posed(usable, scale, points, course.values, rounding, course)


def rows_of(mask: Mask) -> slice | Mask:
    """An index for the rows that a mask names, which copies nothing where it names them all."""
    return slice(None) if mask.all() else mask


def normalise_start(near: Affine, scale: Scale) -> tuple[Array, Array]:
    """Bias and matrix of a calibration for readings of size one about their centre."""
    assert near.magnitude is not None
    return (near.bias - scale.centre) / scale.size, near.matrix * (scale.size / near.magnitude)


def normalise(
    samples: Samples, reference: Reference | None, usable: Mask, method: str
) -> tuple[Scale, Array]:
    """Centre and size of the readings, and magnitudes scaled to mean one, (1,) or (n,)."""
    readings = samples.field[rows_of(usable)]
    centre = np.ones(len(readings)) @ readings / len(readings)
    size = float(np.linalg.norm(readings - centre) / np.sqrt(len(readings)))
    if size <= 1e-9 * float(np.linalg.norm(centre)):
        raise CoverageError(
            "there is one usable reading only"
            if len(readings) == 1
            else "the readings never change: the sensor did not turn, or it is stuck",
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
