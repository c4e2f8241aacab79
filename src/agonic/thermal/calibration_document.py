"""What is said and shown of one calibration over temperature, alone or tried on a log."""

from __future__ import annotations

from functools import partial

import numpy as np

from agonic.arrays import Mask
from agonic.calibration.base import Calibration
from agonic.calibration.thermal import MARGIN_C, Thermal
from agonic.report import tables as blocks
from agonic.report.axes import Axis, Columns, over_time
from agonic.report.digits import count, group_digits, quantity, write_minus
from agonic.report.document import Document
from agonic.report.figure import Figure, figure
from agonic.report.labels import unit_label
from agonic.report.marks import foot, spread
from agonic.report.section import Section
from agonic.samples import Samples
from agonic.thermal import figures, tables
from agonic.thermal.fit.evidence import find_worst_sd
from agonic.thermal.fit.result import Bins, ThermalFit
from agonic.verification import Verification

STYLES = ("thermal.css",)
_MOST = 180
"""Columns along the temperature."""


def describe_calibration(
    calibration: Calibration,
    thermal: Thermal,
    *,
    title: str = "",
    samples: Samples | None = None,
    verification: Verification | None = None,
) -> Document:
    """A calibration over temperature: coefficients with their band, validity, origin.

    Parameters
    ----------
    calibration : what is applied. thermal : it, or its step that depends on temperature.
    samples, verification : readings that it was tried on, and what that showed.
    """
    sections = [Section("Validity", [describe_validity(thermal)]), *show_coefficients(thermal)]
    if samples is not None and verification is not None:
        sections.insert(0, _show_log(calibration, thermal, samples, verification))
    return Document(
        kind="Calibration over temperature",
        name=title or calibration.sensor,
        key_figures=list_key_figures(thermal, None),
        sections=sections,
        calibration=calibration,
        samples=samples,
        styles=STYLES,
    )


def show_coefficients(calibration: Thermal, bins: Bins | None = None) -> list[Section]:
    """The coefficients over temperature, drawn with the bins of the fit, and in numbers."""
    drawn = partial(figures.draw_coefficients, calibration, bins)
    return [
        Section("Coefficients over temperature", [drawn]),
        Section("Scale factors and angles", [partial(figures.draw_decomposition, calibration)]),
        Section("Numbers", [tables.list_numbers(calibration)]),
        Section("In powers of the temperature, °C", [tables.list_powers(calibration)]),
    ]


def list_key_figures(calibration: Thermal, fit: ThermalFit | None) -> list[tuple[str, str, str]]:
    """The four numbers to look at first."""
    unit, unit_out = unit_label(calibration.unit_in), unit_label(calibration.unit_out)
    bias, matrix = find_worst_sd(calibration)
    low, high = calibration.range_C
    shown = [
        ("Range", write_minus(f"{low:.0f} … {high:.0f} °C"), "temperatures that were seen"),
        ("Bias standard error", quantity(bias, unit, 2), "at the worst temperature"),
        ("Matrix × field", quantity(matrix, unit_out, 2), "standard error, the same"),
    ]
    if fit is not None:
        shown.append(("Spread of |B|", tables.format_spread(fit), "largest of the stations"))
    elif calibration.noise is not None:
        shown.append(("Noise", quantity(calibration.noise, unit, 2), "one reading on one axis"))
    return shown


def describe_validity(calibration: Thermal) -> dict[str, str]:
    """Where the calibration may be used."""
    low, high = calibration.range_C
    entries = {
        "Temperature": f"{low:.1f} to {high:.1f} °C; more than {MARGIN_C:g} °C beyond, corrections "
        "are extrapolated, with a warning",
        "Needs": "the temperature of each reading"
        + ("" if calibration.rate is None else ", and its time for how fast that changes"),
    }
    if calibration.validity.largest_reading is not None:
        unit = unit_label(calibration.unit_in)
        entries["Largest reading"] = quantity(calibration.validity.largest_reading, unit, 4)
    if calibration.magnitude is not None:
        entries["Field"] = quantity(calibration.magnitude, unit_label(calibration.unit_out), 5)
    return entries


def _show_log(
    calibration: Calibration, thermal: Thermal, samples: Samples, verification: Verification
) -> Section:
    """What the calibration does to a log: checks, magnitude over temperature and over time."""
    assert samples.temperature is not None
    beyond = thermal.outside(samples.temperature)
    low, high = thermal.range_C
    coldest, warmest = float(samples.temperature.min()), float(samples.temperature.max())
    said = (
        f"{count(len(samples), 'reading')} of {samples.name} at {coldest:.1f} to {warmest:.1f} °C."
    )
    if beyond.any():
        said += (
            f" {group_digits(int(beyond.sum()))} of them lie outside {low:.1f} to {high:.1f} °C, "
            "for which the calibration was made: there it is extrapolated (marked at the foot)."
        )
    unit = unit_label(calibration.unit_out)
    return Section(
        "On the log",
        [
            said,
            lambda: blocks.checks(verification),
            lambda: _draw_magnitudes(samples, verification, beyond, unit),
        ],
    )


def _draw_magnitudes(
    samples: Samples, verification: Verification, beyond: Mask, unit: str
) -> list[Figure]:
    """The magnitude of a log over temperature and time, before and after the correction: least to
    largest of each column."""
    assert samples.temperature is not None
    level_C, time = samples.temperature, samples.time
    low, high = float(level_C.min()), float(level_C.max())
    x = Axis("temperature, °C", low, high if high > low else low + 1.0)
    along = {"temperature": Columns(x, level_C, _MOST)}
    if time is not None and len(samples) > 1:
        along["time"] = over_time(time)
    before, after = verification.magnitude_before, verification.magnitude_after
    least, most = np.percentile(np.concatenate([before, after]), (0.25, 99.75)).tolist()
    margin = max(0.05 * (most - least), 1e-6 * most, 1e-9)
    y, drawn = Axis(f"magnitude, {unit}", least - margin, most + margin), []
    for name, columns in along.items():
        marks = [
            spread(columns, before, "before", "before"),
            spread(columns, after, "after", "after the correction"),
            foot(columns, beyond, "extrapolated", "extrapolated"),
        ]
        drawn.append(figure(f"Magnitude over {name}", columns.x, y, *marks))
    return drawn
