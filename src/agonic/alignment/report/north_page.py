"""`north_page` and `di_flux_page`: north and absolute measurements as pages of their own."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths.north import swung_deg
from agonic.alignment.north import DiFluxFit, NorthFit
from agonic.alignment.report import north_text as words
from agonic.alignment.report.drawings import bars
from agonic.arrays import Array
from agonic.health import Judged
from agonic.report.blocks import header, part, verdict
from agonic.report.digits import grouped, minused
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup, table
from agonic.report.tables import definitions, findings, provenance
from agonic.report.verdict import moves

WIDE, HIGH, LEFT = 760.0, 220.0, 70.0


def north_page(fit: NorthFit, *, title: str = "") -> str:
    """North with what each method gives, the swing, azimuths and the alignment, as HTML.

    >>> from agonic.alignment.north import fit_north
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> north_page(fit_north(simulate_north().session)).count("<svg class=\\"bars\\"")
    2
    """
    parts = [part("What was found", definitions(words.north_entries(fit)))]
    if fit.swing is not None:
        parts.append(part("The swing", _swing(fit)))
    rows = words.platform_rows(fit)
    if fit.aligned is not None:
        parts.append(
            part(
                "Residuals of the platform",
                bars(fit.aligned.residuals, fit.aligned.residuals_sd, fit.aligned.orientation),
                table(words.PLATFORM_HEAD, rows, class_="numbers small"),
            )
        )
    if fit.calibration is not None:
        parts.append(part("Provenance", provenance(fit.calibration, None)))
    return page(fit, "North by a gyrotheodolite", title or fit.session.name or "north", parts)


def di_flux_page(fit: DiFluxFit, *, title: str = "") -> str:
    """An absolute measurement: declination, inclination, errors of the instrument, residuals.

    >>> from agonic.alignment.north import fit_di_flux
    >>> from agonic.alignment.simulation.di_flux import simulate_di_flux
    >>> di_flux_page(fit_di_flux(simulate_di_flux().sheet)).count("<tr>")
    10
    """
    sheet = fit.sheet
    numbers = np.unique(sheet.setting)
    rows = [
        [
            str(k + 1),
            f"{grouped(float(sheet.horizontal_deg[own].mean()), 4)}°",
            f"{grouped(float(sheet.zenith_deg[own].mean()), 4)}°",
            grouped(float(sheet.reading[own].mean()), 2),
            grouped(float(-left), 2),
        ]
        for k, (own, left) in enumerate(
            zip([sheet.setting == n for n in numbers], fit.estimate.residuals, strict=True)
        )
    ]
    head = ("Setting", "Horizontal circle", "Zenith circle", "Fluxgate", "Residual")
    parts = [
        part("What was found", definitions(words.di_flux_entries(fit))),
        part("Settings", table(head, rows, class_="numbers small")),
    ]
    about = ", ".join(text for text in (sheet.pillar, sheet.theodolite, sheet.sensor) if text)
    return page(fit, f"Absolute measurement {about}", title or sheet.name, parts)


def page(fit: Judged, kicker: str, name: str, parts: list[Markup]) -> str:
    """Verdict, parts, findings; a refused fit shows no numbers."""
    move = next(iter(moves(fit.findings)), "")
    shown = [] if fit.verdict == "refused" else parts
    body = markup(
        header(kicker, name),
        element(
            "main",
            verdict(fit.verdict, minused(fit.status), move=move),
            *shown,
            part("Findings", findings(fit.findings)),
        ),
    )
    return document(name, body, style=static("report.css") + static("alignment.css"))


def _swing(fit: NorthFit) -> Markup:
    """The readings of the record as dots, the damped sinusoid as a line, north across."""
    record, swing = fit.session.swing, fit.swing
    assert record is not None, "drawn only where there is a record"
    assert swing is not None, "drawn only where there is a record"
    since = record.time_s - record.time_s[0]
    low, high = float(record.reading_deg.min()), float(record.reading_deg.max())

    def x(t: Array) -> Array:
        return np.asarray(LEFT + (WIDE - LEFT - 6) * t / since[-1])

    def y(value: Array | float) -> Array:
        return np.asarray(8 + (HIGH - 36) * (high - np.asarray(value)) / max(high - low, 1e-12))

    fine = np.linspace(0, since[-1], 400)
    line = " ".join(
        f"{a:.1f},{b:.1f}" for a, b in zip(x(fine), y(swung_deg(swing.params, fine)), strict=True)
    )
    every = max(len(since) // 300, 1)
    dots = [
        element("circle", cx=f"{a:.1f}", cy=f"{b:.1f}", r="1.8", class_="dot")
        for a, b in zip(x(since)[::every], y(record.reading_deg)[::every], strict=True)
    ]
    north = float(y(float(swing.params[0])))
    ticks = [
        element(
            "text",
            f"{grouped(value, 3)}°",
            x=f"{LEFT - 6:g}",
            y=f"{float(y(value)) + 4:.1f}",
            class_="tick",
        )
        for value in (low, float(swing.params[0]), high)
    ]
    ends = [
        element(
            "text",
            f"{seconds:.0f} s",
            x=f"{float(x(np.array(seconds))):.1f}",
            y=f"{HIGH - 6:g}",
            class_="tick middle",
        )
        for seconds in (0.12 * since[-1], 0.5 * since[-1], 0.95 * since[-1])
    ]
    drawn = element(
        "svg",
        element("path", d=f"M{LEFT} {north:.1f}H{WIDE}", class_="zero"),
        element("polyline", points=line, class_="zero", fill="none"),
        *dots,
        *ticks,
        *ends,
        class_="bars",
        viewBox=f"0 0 {WIDE:g} {HIGH:g}",
        role="img",
        aria_label="Readings of the circle that follow the gyro",
    )
    return element(
        "figure",
        drawn,
        element("figcaption", "Circle against time; the line across is the gyro’s north"),
    )
