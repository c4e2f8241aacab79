"""What is said and shown of true north by a gyrotheodolite."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from agonic.alignment.figures import draw_residuals
from agonic.alignment.maths.north import Swing, evaluate_swing_deg
from agonic.alignment.north.platform import Aligned
from agonic.alignment.north.result import NorthFit
from agonic.alignment.session.north import SwingRecord
from agonic.report.axes import Axis, Columns
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.markup import Markup
from agonic.report.section import Section, Table
from agonic.report.strips import caption, level, line, plot, spread
from agonic.report.time_axis import along_rows

METHODS = {"swing": "damped sinusoid", "reversal": "turning points", "transit": "transits"}
PLATFORM_HEAD = ("Orientation", "Heading", "x, nT", "y, nT", "z, nT")


def describe_north(fit: NorthFit) -> Document:
    """North by every method, the swing, azimuths, and the alignment; a refused one has no numbers.

    >>> from agonic.alignment.north import fit_north
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
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        entries={} if refused else _entries(fit),
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
        value = format_angle(found.reading_deg, 3600 * found.sd_deg)
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
        sd = "   ".join(
            f"{axis} {significant(float(s), 2)}″"
            for axis, s in zip("xyz", fit.aligned.sd_arcsec, strict=True)
        )
        entries["Alignment"] = f"with the platform, about the magnetometer's {sd}"
    return entries


def _sections(fit: NorthFit) -> list[Section]:
    sections = []
    record, swing, aligned = fit.session.swing, fit.swing, fit.aligned
    if record is not None and swing is not None:
        sections.append(Section("The swing", [lambda: draw_swing(record, swing)]))
    if aligned is not None:
        rows = Table(PLATFORM_HEAD, _platform_rows(aligned), "numbers small")
        sections.append(
            Section(
                "Residuals of the platform",
                [
                    lambda: draw_residuals(
                        aligned.solution.residuals,
                        aligned.solution.residuals_sd,
                        aligned.orientation,
                    ),
                    rows,
                ],
            )
        )
    return sections


def _platform_rows(aligned: Aligned) -> list[list[str]]:
    """Each orientation of the platform: its heading and what is left."""
    return [
        [
            str(number),
            f"{group_digits(float(heading), 4)}°",
            *(group_digits(float(v), 3) for v in left),
        ]
        for number, heading, left in zip(
            aligned.orientation, aligned.heading_deg, aligned.solution.residuals, strict=True
        )
    ]


def _numbers(fit: NorthFit) -> dict[str, Any]:
    values = {
        "north_deg": fit.north_deg,
        "north_sd_arcsec": fit.sd_arcsec,
        "by": {
            name: {
                "gyro_north_deg": found.reading_deg,
                "sd_arcsec": 3600 * found.sd_deg,
                "freedom": found.freedom,
            }
            for name, found in fit.by.items()
        },
        "transit_constant": fit.constant,
        "transit_constant_sd": fit.constant_sd,
        "period_s": fit.period_s,
        "azimuths": [asdict(azimuth) for azimuth in fit.azimuths],
    }
    if fit.aligned is None:
        return values
    return values | {
        "n": len(fit.aligned.orientation),
        "matrix_mb": fit.aligned.rot_mb,
        "sd_arcsec": fit.aligned.sd_arcsec,
        "worst_sd_arcsec": fit.aligned.worst_sd_arcsec,
        "residuals_nT": fit.aligned.solution.residuals,
        "chi2": fit.aligned.solution.chi2,
        "freedom": fit.aligned.solution.freedom,
    }


def draw_swing(record: SwingRecord, swing: Swing) -> list[Markup]:
    """Readings of the circle over time with the gyro's north across, and what the fit leaves."""
    x, along = along_rows(record.time_s, np.arange(len(record.time_s)))
    columns, reading = Columns(x, along), record.reading_deg
    low, high = float(reading.min()), float(reading.max())
    room = 0.06 * max(high - low, 1e-9)
    circle = Axis("reading of the circle, °", low - room, high + room)
    course = [
        level(circle, float(swing.params[0]), "noise"),
        line(columns, circle, columns.mean(reading), "mean"),
    ]
    left = 3600 * (reading - evaluate_swing_deg(swing.params, record.time_s - record.time_s[0]))
    limit = 1.1 * max(float(np.abs(left).max()), 1e-9)
    y = Axis("residual, ″", -limit, limit)
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
