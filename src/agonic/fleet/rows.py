"""The rows of a population: of one calibration, of what could not be calibrated, and column by
column of many sensors fitted to moments."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.coverage import Coverage
from agonic.ellipsoid.many_sensors import Fits
from agonic.ellipsoid.problem import describe_missing_scale
from agonic.ellipsoid.solve import SIGNIFICANT, describe_test
from agonic.fit import Accuracy
from agonic.health import Finding, check_scale, verdict_of
from agonic.health.finding import sentences
from agonic.health.readings import check_rejected
from agonic.logs.large.grouped_moments import Grouped
from agonic.model.verdict import check_coverage
from agonic.population import Row
from agonic.population.population import AXES, COLUMNS, ENTRIES, make_column
from agonic.recording.calibrated import Calibrated
from agonic.samples import Samples


def make_row(calibrated: Calibrated, **known: Any) -> Row:
    """The row of one calibrated sensor; its figures are those of `agonic calibrate --json`. `known`
    are the fields of `Row` that no calibration tells: sensor, source, key, settings …."""
    fit, verification = calibrated.fit, calibrated.verification
    found = fit.calibration
    names = FREE_PARAMETERS if found.gauge == "free" else PARAMETERS
    figures: dict[str, Any] = {
        **dict(zip(PARAMETERS[:3], found.bias.tolist(), strict=True)),
        **dict(zip([f"matrix_{k}" for k in ENTRIES], found.matrix.ravel().tolist(), strict=True)),
        **dict(zip([f"{k}_sd" for k in names], map(_make_finite, fit.sd.tolist()), strict=False)),
    }
    return Row(
        **known,
        **describe_samples(calibrated.samples),
        rows=fit.n,
        method=calibrated.method,
        model=found.model,
        gauge=found.gauge,
        verdict=calibrated.verdict,
        status=calibrated.status,
        findings=tuple(_list_findings(calibrated)),
        unit_out=found.unit_out,
        **figures,
        magnitude=_make_finite(found.magnitude),
        noise=_make_finite(fit.noise),
        spread_before=_make_finite(verification.spread_before),
        spread_after=_make_finite(verification.spread_after),
        residual_rms=_make_finite(verification.residual_rms),
        heading_sd_deg=_make_finite(fit.coverage.heading_sd_deg),
    )


def make_refused_row(status: str, *, samples: Samples | None = None, **known: Any) -> Row:
    """The row of a log, or of a sensor in it, that could not be calibrated at all."""
    facts = {} if samples is None else describe_samples(samples)
    return Row(verdict="refused", status=status, **facts, **known)


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
    except (OverflowError, ValueError):  # beyond all dates, or not a number
        return None


def _make_finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


Columns = dict[str, NDArray[Any]]


def make_columns(
    fits: Fits, grouped: Grouped, *, unit: str, scaled: bool, inclination_deg: float, **known: Any
) -> Columns:
    """The columns of n sensors fitted to moments, in their order. `unit` is that of the readings,
    `scaled` whether the magnitude was known; `known` are columns that are the same for all. Of the
    matrix, the lower half is the upper."""
    n, begin = len(fits), datetime(1970, 1, 1, tzinfo=UTC)
    found = [_find(fits, grouped, k, unit) for k in range(n)]
    of_sensor: dict[str, Any] = {
        "sensor": grouped.sensors,
        "rows": grouped.count,
        "start": [_add_seconds(begin, seconds) for seconds in grouped.start.tolist()],
        "duration_s": grouped.duration_s,
        "temperature_C": grouped.temperature_C,
        "findings": [tuple(finding.name for finding in each) for each in found],
        "verdict": list(map(verdict_of, found)),
        "status": [
            _describe(fits, k, each, unit, scaled, inclination_deg) for k, each in enumerate(found)
        ],
        "model": fits.model.astype(object),
        "magnitude": fits.magnitude,
        "noise": fits.noise,
        "spread_before": grouped.spread,
        "spread_after": fits.spread,
        "residual_rms": fits.spread * fits.magnitude,
        "heading_sd_deg": fits.heading_sd_deg,
        **{f"bias_{axis}": fits.bias[:, i] for i, axis in enumerate(AXES)},
        **{f"matrix_{entry}": fits.matrix[:, k // 3, k % 3] for k, entry in enumerate(ENTRIES)},
        **{f"{name}_sd": sd for name, sd in zip(PARAMETERS, fits.sd.T, strict=True)},
    }
    own = {"method": "adjusted", "gauge": "symmetric", "unit_in": unit}
    of_all = {**known, **own, "unit_out": "nT" if scaled else unit}
    blank = {field.name: field.default for field in fields(Row)}
    return {
        name: make_column(name, of_sensor.get(name, [of_all.get(name, blank[name])] * n))
        for name in COLUMNS
    }


def _find(fits: Fits, grouped: Grouped, k: int, unit: str) -> list[Finding]:
    """What moments give away of one sensor."""
    if fits.refusal[k]:
        return [Finding("coverage", "refuse", str(fits.refusal[k]))]
    found: list[Finding | None] = []
    if not fits.heading_sd_deg[k] < 2.0:  # a finding begins there
        unseen = Coverage(
            cells=np.zeros(80, np.int64),
            filled=0.0,
            field_sd=np.zeros(80),
            field_sd_max=0.0,
            heading_sd_deg=float(fits.heading_sd_deg[k]),
            inclination_deg=0.0,
        )
        found.append(check_coverage(unseen))
    found.append(check_scale(float(np.trace(fits.matrix[k])) / 3, unit))
    if grouped.left_out[k]:
        lost, total = int(grouped.left_out[k]), int(grouped.count[k] + grouped.left_out[k])
        found += check_rejected({"NaN or infinite field": lost}, total)
    return [finding for finding in found if finding is not None]


def _describe(
    fits: Fits, k: int, found: list[Finding], unit: str, scaled: bool, inclination_deg: float
) -> str:
    """The sentence of one sensor, as `Fit.status` has it."""
    grave = [finding.sentence for finding in found if finding.severity != "note"]
    notes = [finding.sentence for finding in found if finding.severity == "note"]
    if any(finding.severity == "refuse" for finding in found):
        return sentences(*grave, *notes)
    variance = max(fits.covariance[k, i, i] for i in range(3))
    said = [
        Accuracy(
            bias_sd=float(variance) ** 0.5,
            unit=unit,
            own_deg=float(fits.heading_sd_deg[k]),
            inclination_deg=inclination_deg,
            alone=True,
        ).sentence
    ]
    p, upright = fits.p_values[k].tolist()
    if p == p:
        tilted = upright <= SIGNIFICANT
        said.append(describe_test("sphere", p, bool(fits.discerned[k]), tilted))
    if not scaled:
        said.append(describe_missing_scale(float(fits.magnitude[k]), unit))
    return sentences(*grave, *said, *notes)
