"""The row of a calibration, and of what could not be calibrated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from typing import Any

from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.population import Row
from agonic.population.population import ENTRIES
from agonic.recording.calibrated import Calibrated
from agonic.samples import Samples


def make_row(
    calibrated: Calibrated,
    *,
    sensor: str,
    source: str,
    sha256: str = "",
    key: str = "",
    calibration: str | None = None,
    report: str | None = None,
    settings: str = "",
    version: str = "",
) -> Row:
    """The row of one calibrated sensor; its figures are those of `agonic calibrate --json`."""
    fit, verification = calibrated.fit, calibrated.verification
    found = fit.calibration
    names = FREE_PARAMETERS if found.gauge == "free" else PARAMETERS
    sd = dict(zip(names, map(_make_finite, fit.sd.tolist()), strict=False))
    bias = dict(zip(PARAMETERS[:3], found.bias.tolist(), strict=True))
    entries = zip(ENTRIES, found.matrix.ravel().tolist(), strict=True)
    return Row(
        sensor=sensor,
        source=source,
        sha256=sha256,
        key=key,
        **describe_samples(calibrated.samples),
        rows=fit.n,
        method=calibrated.method,
        model=found.model,
        gauge=found.gauge,
        verdict=calibrated.verdict,
        status=calibrated.status,
        findings=tuple(_list_findings(calibrated)),
        unit_out=found.unit_out,
        **bias,
        **{f"matrix_{name}": value for name, value in entries},  # type: ignore[arg-type]
        **{f"{name}_sd": value for name, value in sd.items()},  # type: ignore[arg-type]
        magnitude=_make_finite(found.magnitude),
        noise=_make_finite(fit.noise),
        spread_before=_make_finite(verification.spread_before),
        spread_after=_make_finite(verification.spread_after),
        residual_rms=_make_finite(verification.residual_rms),
        heading_sd_deg=_make_finite(fit.coverage.heading_sd_deg),
        calibration=calibration,
        report=report,
        settings=settings,
        version=version,
    )


def make_refused_row(
    status: str, *, sensor: str, source: str, samples: Samples | None = None, **known: Any
) -> Row:
    """The row of a log, or of a sensor in it, that could not be calibrated at all."""
    facts = {} if samples is None else describe_samples(samples)
    return Row(sensor=sensor, source=source, verdict="refused", status=status, **facts, **known)


def describe_samples(samples: Samples) -> Mapping[str, Any]:
    """What the readings themselves say of a row."""
    start, duration = None, None
    if samples.time is not None and len(samples):
        first, last = float(samples.time[0]), float(samples.time[-1])
        start, duration = _add_seconds(samples.epoch, first), last - first
    warm = samples.temperature
    return {
        "channel": samples.name,
        "device_id": samples.device_id,
        "start": start,
        "duration_s": duration,
        "temperature_C": None if warm is None or not len(warm) else float(warm.mean()),
        "unit_in": samples.unit,
    }


def _list_findings(calibrated: Calibrated) -> Iterator[str]:
    """The names of what was found, the gravest first; a check that failed is among them."""
    findings, checks = calibrated.fit.findings, calibrated.verification.checks
    for severity in ("refuse", "check", "note"):
        yield from (finding.name for finding in findings if finding.severity == severity)
        if severity == "check":
            yield from (f"held out: {check.name}" for check in checks if check.passed is False)


def _add_seconds(epoch: datetime | None, seconds: float) -> datetime | None:
    if epoch is None:
        return None
    try:
        return epoch + timedelta(seconds=seconds)
    except OverflowError:
        return None


def _make_finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
