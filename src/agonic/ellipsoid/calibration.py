"""From a fit in normalised coordinates to a `Fit` in the units of the readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.ellipsoid.solve import Found
from agonic.fit import Fit, ModelTest
from agonic.health import Finding, check_scale, figure, sort_findings
from agonic.maths.equation import gauge as gauges
from agonic.reference import Reference

Gauge = Literal["symmetric", "triangular"]
Scale = gauges.Units

CITATIONS = {
    "likelihood": ("huber-1981", "beaton-tukey-1974"),
    "adjusted": ("markovsky-kukush-vanhuffel-2004", "kukush-markovsky-vanhuffel-2004"),
    "li-griffiths": ("li-griffiths-2004", "nikolaev-2023"),
    "linear": ("li-griffiths-2004",),
}


def calibration(found: Found, scale: Scale, unit: str, gauge: Gauge) -> Affine:
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


def settings(
    model: str, method: str, gauge: str, reference: Reference | None, **more: Any
) -> Mapping[str, Any]:
    """What the user chose, for the provenance."""
    if reference is None:
        words = "none: mean gain set to 1"
    else:
        f = reference.magnitudes(len(reference.values))
        size = f"{f[0]:g} nT" if len(f) == 1 else f"{f.min():g} to {f.max():g} nT per sample"
        words = f"{size} ({reference.source})"
    return {
        "fit": "ellipsoid",
        "model": model,
        "method": method,
        "gauge": gauge,
        "reference": words,
        **more,
    }


def scale_finding(affine: Affine) -> Finding | None:
    """A wrong unit or a wrong reference."""
    return check_scale(float(np.trace(affine.matrix) / 3), affine.unit_in)


def remarks(
    affine: Affine, coverage: Coverage, tests: tuple[ModelTest, ...], reference_known: bool
) -> tuple[str, ...]:
    """How good the result is, in words."""
    assert affine.sd is not None
    assert affine.magnitude is not None
    unit = affine.unit_in
    said = [
        accuracy(
            float(affine.sd[:3].max()), unit, coverage.heading_sd_deg, coverage.inclination_deg
        ),
        *(test.sentence for test in tests[:1]),
    ]
    if not reference_known:
        said.append(unscaled(affine.magnitude, unit))
    return tuple(said)


def accuracy(bias_sd: float, unit: str, heading_sd_deg: float, inclination_deg: float) -> str:
    """How well the result is known."""
    return (
        f"bias known to {figure(bias_sd)} {unit}, a level heading to "
        f"{figure(heading_sd_deg)}° at {inclination_deg:.0f}° dip"
    )


def unscaled(magnitude: float, unit: str) -> str:
    """What was done for want of a reference."""
    return (
        "no reference magnitude was given, so the mean gain is set to 1 "
        f"(magnitude {figure(magnitude, 5)} {unit})"
    )


def finished(fit: Fit, more: tuple[Finding | None, ...]) -> Fit:
    """The fit with further findings, refusals first; a refused fit boasts of no accuracy."""
    fit = replace(fit, findings=sort_findings((*fit.findings, *more)))
    return replace(fit, remarks=()) if fit.verdict == "refused" else fit
