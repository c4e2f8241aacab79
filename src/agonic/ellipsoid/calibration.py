"""From a fit in normalised coordinates to a calibration in the units of the readings."""

from __future__ import annotations

from dataclasses import replace

from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.coverage import Coverage
from agonic.ellipsoid.settings import Gauge
from agonic.ellipsoid.solve import Found
from agonic.fit import Accuracy, ModelTest
from agonic.health import figure
from agonic.maths.equation import gauge as gauges
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
