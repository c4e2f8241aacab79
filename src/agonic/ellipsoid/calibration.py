"""From a fit in normalised coordinates to a calibration in the units of the readings."""

from __future__ import annotations

from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.ellipsoid.settings import Gauge
from agonic.ellipsoid.solve import Found
from agonic.fit import ModelTest, describe_accuracy
from agonic.health import figure
from agonic.maths.equation import gauge as gauges

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


def describe_result(
    affine: Affine, coverage: Coverage, tests: tuple[ModelTest, ...], reference_known: bool
) -> tuple[str, ...]:
    """How good the result is, in words."""
    assert affine.sd is not None
    assert affine.magnitude is not None
    unit = affine.unit_in
    said = [
        describe_accuracy(
            float(affine.sd[:3].max()), unit, coverage.heading_sd_deg, coverage.inclination_deg
        ),
        *(test.sentence for test in tests[:1]),
    ]
    if not reference_known:
        said.append(describe_missing_scale(affine.magnitude, unit))
    return tuple(said)


def describe_missing_scale(magnitude: float, unit: str) -> str:
    """What was done for want of a reference."""
    return (
        "no reference magnitude was given, so the mean gain is set to 1 "
        f"(magnitude {figure(magnitude, 5)} {unit})"
    )
