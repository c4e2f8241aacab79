"""What is said and shown of true north by a gyrotheodolite."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from agonic.alignment.figures import draw_residuals, draw_settings, make_residual_axis
from agonic.alignment.findings import judge, write_by_axis
from agonic.alignment.maths.north import Swing, evaluate_swing_deg
from agonic.alignment.maths.stretches import average, find_rows
from agonic.alignment.north.di_flux import DiFluxFit
from agonic.alignment.north.fit import NorthFit
from agonic.alignment.session.laboratory import SwingRecord
from agonic.readable import make_record
from agonic.report.axes import Columns, along_rows, fit_axis
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.markup import Markup
from agonic.report.section import Section, Table, list_inputs
from agonic.report.strips import caption, level, line, plot, spread

SETTING_HEAD = ("Setting", "Horizontal circle", "Zenith circle", "Fluxgate", "Residual")
METHODS = {"swing": "damped sinusoid", "reversal": "turning points", "transit": "transits"}
PLATFORM_HEAD = ("Orientation", "Heading", "x, nT", "y, nT", "z, nT")


def describe_north(fit: NorthFit) -> Document:
    """North by every method, the swing, azimuths, and the alignment; a refused one has no numbers.

    >>> from agonic.alignment.north.fit import fit_north
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> made = describe_north(fit_north(simulate_north().session))
    >>> print(made.to_text().splitlines()[0])
    ✓ simulated: good (north by a gyrotheodolite, damped sinusoid)
    >>> made.to_html().count('<figure class="strip"')
    3
    """
    refused = fit.verdict == "refused"
    return Document(
        schema="agonic/fit-north@1",
        kind="North by a gyrotheodolite",
        name=fit.session.name or "north",
        method=f"north by a gyrotheodolite, {METHODS[fit.method]}",
        **judge(fit),
        entries=_entries(fit),
        sections=[] if refused else _sections(fit),
        values={"method": fit.method, **({} if refused else _numbers(fit))},
        calibration=None if refused else fit.calibration,
        styles=["alignment.css"],
    )


def format_angle(value_deg: float, sd_arcsec: float) -> str:
    """An angle with its standard error, where that is known.

    >>> format_angle(12.5, 3.0), format_angle(12.5, np.nan)
    ('12.50000° ± 3.0″', '12.50000°')
    """
    known = f" ± {significant(sd_arcsec, 2)}″" if np.isfinite(sd_arcsec) else ""
    return f"{group_digits(value_deg, 5)}°{known}"


def _entries(fit: NorthFit) -> dict[str, str]:
    """What was found, by a short name."""
    north = format_angle(fit.north_deg, fit.sd_arcsec)
    entries = {"North": f"{north} on the circle, constant included"}
    for name, found in fit.by.items():
        value = format_angle(found.reading_deg, found.sd_arcsec)
        entries[name.capitalize()] = f"{value}, gyro north by {METHODS[name]}"
    if fit.constant is not None and fit.constant_sd is not None:
        constant = with_sd(fit.constant, fit.constant_sd)
        entries["c"] = f"{constant} degrees per unit of amplitude and s"
    if fit.period_s is not None:
        entries["Period"] = quantity(fit.period_s, "s", 5)
    for azimuth in fit.azimuths:
        faces = azimuth.collimation_arcsec
        both = f", collimation {group_digits(faces, 1)}″" if np.isfinite(faces) else ""
        value = format_angle(azimuth.azimuth_deg, azimuth.sd_arcsec)
        entries[azimuth.name] = f"azimuth {value}{both}"
    if fit.aligned is not None:
        sd = write_by_axis(fit.aligned.sd_arcsec)
        entries["Alignment"] = f"with the platform, about the magnetometer's {sd}"
    return entries


def _sections(fit: NorthFit) -> list[Section]:
    sections = []
    record, swing, aligned = fit.session.swing, fit.swing, fit.aligned
    if record is not None and swing is not None:
        sections.append(Section("The swing", [lambda: draw_swing(record, swing)]))
    if aligned is not None:
        found, numbers = aligned.solution, aligned.orientation
        rows = [
            [str(n), f"{group_digits(float(at), 4)}°", *(group_digits(float(v), 3) for v in left)]
            for n, at, left in zip(numbers, aligned.heading_deg, found.residuals, strict=True)
        ]
        drawn = partial(draw_residuals, found.residuals, found.residuals_sd, numbers)
        table = Table(PLATFORM_HEAD, rows, "numbers small")
        sections.append(Section("Residuals of the platform", [drawn, table]))
    return sections


def _numbers(fit: NorthFit) -> dict[str, Any]:
    if fit.aligned is None:
        return make_record(fit)
    return make_record(fit) | {
        "n": len(fit.aligned.orientation),
        **make_record(fit.aligned),
        "residuals_nT": fit.aligned.solution.residuals,
        "chi2": fit.aligned.solution.chi2,
        "freedom": fit.aligned.solution.freedom,
    }


def draw_swing(record: SwingRecord, swing: Swing) -> list[Markup]:
    """Readings of the circle over time with the gyro's north across, and what the fit leaves."""
    x, along = along_rows(record.time_s, np.arange(len(record.time_s)))
    columns, reading = Columns(x, along), record.reading_deg
    circle = fit_axis("reading of the circle, °", reading)
    course = [
        level(circle, float(swing.params[0]), "noise"),
        line(columns, circle, columns.mean(reading), "mean"),
    ]
    left = 3600 * (reading - evaluate_swing_deg(swing.params, record.time_s - record.time_s[0]))
    y = make_residual_axis(left, "″")
    rest = [
        spread(columns, y, left, "range"),
        level(y, 0.0, "noise"),
        line(columns, y, columns.mean(left), "mean"),
    ]
    return [
        caption(
            "The circle following the gyro",
            plot(x, circle, course, "Readings of the circle over time"),
            {"mean": "reading", "noise": "the gyro’s north"},
        ),
        caption(
            "What the damped sinusoid leaves",
            plot(x, y, rest, "Residuals of the readings over time"),
            {"range": "least to largest", "mean": "mean"},
        ),
    ]


def describe_di_flux(fit: DiFluxFit) -> Document:
    """Declination, inclination, errors of the instrument, and the residual of each setting.

    >>> from agonic.alignment.north.di_flux import fit_di_flux
    >>> from agonic.alignment.simulation.laboratory import simulate_di_flux
    >>> made = describe_di_flux(fit_di_flux(simulate_di_flux().sheet))
    >>> print(made.to_text().splitlines()[0])
    ✓ simulated: good (absolute measurement with a fluxgate theodolite, 9 settings)
    >>> made.to_html().count("<tr>")
    10
    """
    sheet = fit.sheet
    about = ", ".join(text for text in (sheet.pillar, sheet.theodolite, sheet.sensor) if text)
    left = -np.asarray(fit.estimate.residuals)
    unit = "units of the fluxgate" if fit.scaled else "its own units"
    drawn = partial(draw_settings, left, unit)
    rows = Table(SETTING_HEAD, _setting_rows(fit), "numbers small")
    return Document(
        schema="agonic/fit-di-flux@1",
        kind=f"Absolute measurement {about}".rstrip(),
        name=sheet.name,
        method=f"absolute measurement with a fluxgate theodolite, {fit.n} settings",
        **judge(fit),
        entries=_sheet_entries(fit),
        sections=[]
        if fit.verdict == "refused"
        else [Section("Settings", [rows, drawn]), list_inputs(*sheet.sources)],
        values=_sheet_values(fit),
        styles=["alignment.css"],
    )


def _sheet_entries(fit: DiFluxFit) -> dict[str, str]:
    """What the sheet gives, by name."""
    (delta, epsilon), (delta_sd, epsilon_sd) = fit.collimation_arcsec, fit.collimation_sd_arcsec
    entries = {}
    if fit.declination_deg is not None:
        entries["Declination"] = format_angle(fit.declination_deg, fit.declination_sd_arcsec)
    mark = format_angle(fit.mark.reading_deg, 3600 * fit.mark.sd_deg)
    meridian = format_angle(fit.meridian_deg, fit.meridian_sd_arcsec)
    entries |= {
        "Inclination": format_angle(fit.inclination_deg, fit.inclination_sd_arcsec),
        "Meridian": f"{meridian} on the circle",
        "Mark": f"{mark} on the circle, telescope's collimation "
        f"{group_digits(3600 * fit.mark.collimation_deg, 1)}″",
        "δ": f"{with_sd(delta, delta_sd)}″, fluxgate to the right of the telescope",
        "ε": f"{with_sd(epsilon, epsilon_sd)}″, to greater zenith angles",
        "S₀/F": f"{with_sd(*fit.offset_arcsec)}″, the fluxgate's offset as an angle",
    }
    if fit.scaled:
        entries["S₀"] = f"{with_sd(fit.offset, fit.offset_sd)} units of the fluxgate"
    if fit.scaled and fit.sheet.magnitude is not None:
        entries["Scale"] = f"{significant(fit.scale / fit.sheet.magnitude, 4)} units per nT"
    return entries


def _setting_rows(fit: DiFluxFit) -> list[list[str]]:
    """Each setting of the circles: means of its readings, and what is left."""
    sheet = fit.sheet
    own = find_rows(sheet.setting, np.unique(sheet.setting))
    read = np.stack([sheet.horizontal_deg, sheet.zenith_deg, sheet.reading], axis=1)
    means = np.column_stack([average(read, own), -fit.estimate.residuals])
    shown = ((4, "°"), (4, "°"), (2, ""), (2, ""))
    return [
        [str(k), *(f"{group_digits(v, n)}{unit}" for v, (n, unit) in zip(row, shown, strict=True))]
        for k, row in enumerate(means.tolist(), start=1)
    ]


def _sheet_values(fit: DiFluxFit) -> dict[str, Any]:
    """The numbers for programs; without a scale those in units of the fluxgate are null."""
    values = {
        **make_record(fit),
        "freedom": fit.estimate.freedom,
        "mark_deg": fit.mark.reading_deg,
        "mark_sd_arcsec": 3600 * fit.mark.sd_deg,
        "telescope_collimation_arcsec": 3600 * fit.mark.collimation_deg,
        "magnitude_nT": fit.sheet.magnitude,
    }
    pairs = (fit.collimation_arcsec, fit.collimation_sd_arcsec, fit.offset_arcsec)
    names = ("delta", "epsilon"), ("delta_sd", "epsilon_sd"), ("offset", "offset_sd")
    for both, pair in zip(names, pairs, strict=True):
        values |= {f"{name}_arcsec": value for name, value in zip(both, pair, strict=True)}
    return values if fit.scaled else values | dict.fromkeys(("offset", "offset_sd", "scale"))
