"""What a calibration over temperature does to the readings of a log."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.base import Calibration
from agonic.calibration.thermal import Thermal
from agonic.report import tables as common
from agonic.report.digits import counted, grouped, minused
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.strips import BINS, Axis, Columns, captioned, marked, plot, spread
from agonic.report.time_axis import along_time
from agonic.samples import Samples
from agonic.thermal import figures
from agonic.verification import Verification

_MOST = 180
"""Columns along the temperature."""


def used(
    calibration: Calibration, thermal: Thermal, samples: Samples, verification: Verification
) -> list[Markup]:
    """The checks, and the magnitude over temperature and time, before and after."""
    assert samples.temperature is not None
    keys = {"before": "before", "after": "after the correction"}
    beyond = thermal.outside(samples.temperature)
    low, high = figures.seen_range(thermal)
    coldest, warmest = float(samples.temperature.min()), float(samples.temperature.max())
    said = (
        f"{counted(len(samples), 'reading')} of {samples.name} at {coldest:.1f} to "
        f"{warmest:.1f} °C."
    )
    if beyond.any():
        said += (
            f" {grouped(int(beyond.sum()))} of them lie outside {low:.1f} to {high:.1f} °C, for "
            "which the calibration was made: there it is extrapolated (marked at the foot)."
        )
        keys["extrapolated"] = "extrapolated"
    unit = unit_label(calibration.unit_out)
    parts = [element("p", minused(said)), common.checks(verification)]
    warm = _axis("temperature, °C", samples.temperature)
    drawn = _strip(warm, samples.temperature, verification, unit, beyond, _MOST)
    parts.append(captioned("Magnitude over temperature", drawn, keys))
    if samples.time is not None and len(samples) > 1:
        time = samples.time
        x, along = along_time(time, float(time[0]), float(time[-1]))
        drawn = _strip(x, along, verification, unit, beyond, BINS)
        parts.append(captioned("Magnitude over time", drawn, keys))
    return parts


def _axis(label: str, values: Array) -> Axis:
    low, high = float(values.min()), float(values.max())
    return Axis(label, low, high if high > low else low + 1.0)


def _strip(
    x: Axis,
    along: Array,
    verification: Verification,
    unit: str,
    beyond: Mask,
    most: int,
) -> Markup:
    """Least to largest magnitude of each column, before and after."""
    before, after = verification.magnitude_before, verification.magnitude_after
    ends = np.percentile(np.concatenate([before, after]), (0.25, 99.75))
    margin = max(0.05 * float(ends[1] - ends[0]), 1e-6 * float(ends[1]), 1e-9)
    y = Axis(f"magnitude, {unit}", float(ends[0]) - margin, float(ends[1]) + margin)
    columns = Columns(x, along, most)
    layers = [spread(columns, y, before, "before"), spread(columns, y, after, "after")]
    if beyond.any():
        layers.append(marked(columns, beyond, "extrapolated"))
    return plot(x, y, layers, f"Magnitude over {x.label}, before and after")
