"""The columns of a population from fits to moments, a row a sensor."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from agonic.population.population import AXES, COLUMNS, ENTRIES, get_dtype

Columns = dict[str, NDArray[Any]]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_HEADING_LEAST_DEG = 2.0  # a finding begins there


def make_columns(
    fits: Fits, grouped: Grouped, *, unit: str, scaled: bool, inclination_deg: float, **known: Any
) -> Columns:
    """The columns of n sensors fitted to moments, in their order.

    `unit` is that of the readings, `scaled` whether the magnitude was known; `known` are columns
    that are the same for all.
    """
    columns = make_blank_columns(len(fits))
    for name, value in known.items():
        columns[name][:] = value
    columns["sensor"][:] = grouped.sensors
    columns["rows"][:] = grouped.count
    columns["duration_s"][:] = grouped.duration_s
    columns["temperature_C"][:] = grouped.temperature_C
    dated = np.flatnonzero(np.isfinite(grouped.start))
    for k in dated.tolist():
        columns["start"][k] = _EPOCH + timedelta(seconds=float(grouped.start[k]))
    columns["method"][:], columns["gauge"][:] = "adjusted", "symmetric"
    columns["unit_in"][:] = unit
    columns["unit_out"][:] = "nT" if scaled else unit
    _fill_figures(columns, fits, grouped)
    for k in range(len(fits)):
        found = _find(fits, grouped, k, unit)
        columns["findings"][k] = tuple(finding.name for finding in found)
        columns["verdict"][k] = verdict_of(found)
        columns["status"][k] = _describe(fits, k, found, unit, scaled, inclination_deg)
    return columns


def make_blank_columns(n: int) -> Columns:
    """Columns of n rows with nothing in them yet."""
    columns: Columns = {}
    for name in COLUMNS:
        kind = get_dtype(name)
        fill: Any = np.nan if kind is np.float64 else 0 if kind is np.int64 else None
        columns[name] = np.full(n, fill, dtype=kind)
        if COLUMNS[name] is str:
            columns[name][:] = ""
    return columns


def _fill_figures(columns: Columns, fits: Fits, grouped: Grouped) -> None:
    """The numbers of the fits; of the matrix, the lower half is the upper."""
    sd = fits.sd
    for i, axis in enumerate(AXES):
        columns[f"bias_{axis}"][:], columns[f"bias_{axis}_sd"][:] = fits.bias[:, i], sd[:, i]
    for k, entry in enumerate(ENTRIES):
        columns[f"matrix_{entry}"][:] = fits.matrix[:, k // 3, k % 3]
    for k, entry in enumerate(("xx", "yy", "zz", "xy", "xz", "yz")):
        columns[f"matrix_{entry}_sd"][:] = sd[:, 3 + k]
    columns["model"][:] = fits.model.astype(object)
    columns["magnitude"][:], columns["noise"][:] = fits.magnitude, fits.noise
    columns["spread_before"][:], columns["spread_after"][:] = grouped.spread, fits.spread
    columns["residual_rms"][:] = fits.spread * fits.magnitude
    columns["heading_sd_deg"][:] = fits.heading_sd_deg


def _find(fits: Fits, grouped: Grouped, k: int, unit: str) -> list[Finding]:
    """What moments give away of one sensor."""
    if fits.refusal[k]:
        return [Finding("coverage", "refuse", str(fits.refusal[k]))]
    found: list[Finding | None] = []
    if not fits.heading_sd_deg[k] < _HEADING_LEAST_DEG:
        nothing = np.zeros(80)
        found.append(
            check_coverage(
                Coverage(
                    cells=nothing.astype(np.int64),
                    filled=0.0,
                    field_sd=nothing,
                    field_sd_max=0.0,
                    heading_sd_deg=float(fits.heading_sd_deg[k]),
                    inclination_deg=0.0,
                )
            )
        )
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
