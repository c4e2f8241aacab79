"""`record`: a calibrated sensor as one flat object for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from agonic.calibrated import Calibrated

FIELDS = (
    "sensor", "method", "reason", "model", "verdict", "status", "n", "unit", "bias_nT",
    "bias_sd_nT", "bias", "bias_sd", "matrix", "matrix_sd", "magnitude", "noise_nT", "noise",
    "correlation", "spread_before", "spread_after", "residual_rms_nT", "heading_sd_deg",
    "inclination_deg", "coverage", "findings", "checks", "files", "warnings",
)  # fmt: skip
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
    and `unit` are always there.
    """
    fit, verification = result.fit, result.verification
    calibration = fit.calibration
    in_nanotesla = calibration.unit_in == "nT"
    bias, bias_sd = calibration.bias, fit.sd[:3]
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
        "matrix_sd": fit.sd[3:],
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
