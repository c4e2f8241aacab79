"""`record`: a calibrated sensor as one flat object for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from agonic.arrays import Array
from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS, Affine
from agonic.calibration.interference import Interference
from agonic.recording.calibrated import Calibrated

FIELDS = (
    "sensor",
    "method",
    "reason",
    "model",
    "verdict",
    "status",
    "n",
    "unit",
    "bias_nT",
    "bias_sd_nT",
    "bias",
    "bias_sd",
    "matrix",
    "matrix_sd",
    "gauge",
    "sources",
    "coefficients",
    "coefficients_sd",
    "second_sensor",
    "latency_s",
    "latency_sd_s",
    "magnitude",
    "noise_nT",
    "noise",
    "correlation",
    "spread_before",
    "spread_after",
    "residual_rms_nT",
    "heading_sd_deg",
    "inclination_deg",
    "coverage",
    "findings",
    "checks",
    "files",
    "warnings",
)
"""The keys of a record, kept stable."""


def unfitted(sensor: str, status: str) -> dict[str, Any]:
    """The record of a sensor that could not be fitted at all: refused, every figure null."""
    nothing: dict[str, Any] = dict.fromkeys(FIELDS)
    return nothing | {
        "sensor": sensor,
        "verdict": "refused",
        "status": status,
        "findings": [],
        "checks": [],
        "files": [],
        "warnings": [],
    }


def record(
    result: Calibrated, files: Sequence[str] = (), warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """What `agonic calibrate --json` says of one sensor.

    `bias_nT` and the like are null where the readings are in raw units; `bias`, `bias_sd`, `noise`
    and `unit` are always there. `matrix_sd` are the standard errors of xx, yy, zz, xy, xz, yz, in
    the gauge free of yx, zx, zy as well. `coefficients` (3, k) are what a unit of each signal of
    the `sources` adds to the readings; null without any. `latency_s` is null where none was found.
    """
    fit, verification = result.fit, result.verification
    calibration = fit.calibration
    in_nanotesla = calibration.unit_in == "nT"
    bias, bias_sd = calibration.bias, fit.sd[:3]
    size = len(FREE_PARAMETERS if calibration.gauge == "free" else PARAMETERS)
    return {
        "sensor": result.samples.name,
        "method": result.method,
        "reason": result.reason,
        "model": calibration.model,
        "verdict": result.verdict,
        "status": result.status,
        "n": fit.n,
        "unit": calibration.unit_in,
        "bias_nT": bias if in_nanotesla else None,
        "bias_sd_nT": bias_sd if in_nanotesla else None,
        "bias": bias,
        "bias_sd": bias_sd,
        "matrix": calibration.matrix,
        "matrix_sd": fit.sd[3:size],
        "gauge": calibration.gauge,
        **_sources(calibration, fit.sd[size:]),
        "latency_s": result.latency.latency_s if result.latency else None,
        "latency_sd_s": result.latency.sd_s if result.latency else None,
        "magnitude": calibration.magnitude,
        "noise_nT": fit.noise if in_nanotesla else None,
        "noise": fit.noise,
        "correlation": fit.correlation,
        "spread_before": verification.spread_before,
        "spread_after": verification.spread_after,
        "residual_rms_nT": verification.residual_rms if calibration.unit_out == "nT" else None,
        "heading_sd_deg": fit.coverage.heading_sd_deg,
        "inclination_deg": fit.coverage.inclination_deg,
        "coverage": fit.coverage.filled,
        "findings": [asdict(finding) for finding in fit.findings],
        "checks": [asdict(check) for check in verification.checks],
        "files": list(files),
        "warnings": list(warnings),
    }


def _sources(calibration: Affine, sd: Array) -> dict[str, Any]:
    """What disturbs on board, by the calibration; `sd` of the coefficients row by row."""
    if not isinstance(calibration, Interference):
        return dict.fromkeys(("sources", "coefficients", "coefficients_sd", "second_sensor"))
    return {
        "sources": calibration.sources,
        "coefficients": calibration.coefficients,
        "coefficients_sd": sd.reshape(3, -1) if len(sd) else None,
        "second_sensor": calibration.second_sensor,
    }
