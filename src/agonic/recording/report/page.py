"""`render`: the report of a log as one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from agonic.recording.calibrated import Calibrated
from agonic.recording.report import sections, sphere
from agonic.report import tables
from agonic.report.digits import degrees, grouped, quantity
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, data_script, element, markup, table
from agonic.report.page_file import assemble_page, read_static
from agonic.report.verdict import MEANINGS

SUMMARY = (
    "Sensor",
    "Verdict",
    "Readings",
    "Spread of magnitude",
    "Heading standard error",
    "Noise",
)


def render(
    results: Sequence[Calibrated],
    *,
    title: str,
    exports: Mapping[str, Sequence[str]] | None = None,
) -> str:
    """The report of every calibrated magnetometer of a log, as one self-contained HTML page.

    Parameters
    ----------
    results : one per sensor, in the order they are shown.
    title : what the report is about, usually the name of the log.
    exports : the files written for each sensor, by its name.

    Returns the page: no network, dark and light, made for screens from 360 px and for A4.

    >>> render([], title="<log>").count("&lt;log&gt;")
    2
    """
    written = exports or {}
    most = sphere.MOST_POINTS // max(len(results), 1)
    body = markup(
        _header(results, title),
        element(
            "main",
            *(
                sections.sensor(k, result, written.get(result.samples.name, ()), most)
                for k, result in enumerate(results, start=1)
            ),
        ),
        data_script(sphere.corners(), id="icosphere"),
    )
    script = read_static("canvas.js") + read_static("sphere.js")
    return assemble_page(title, body, style=read_static("report.css"), script=script)


def _header(results: Sequence[Calibrated], title: str) -> Markup:
    """What this is about, and one row for each sensor where there are several."""
    rows = [_summary_row(k, result) for k, result in enumerate(results, start=1)]
    return element(
        "header",
        element("p", "Magnetometer calibration", class_="kicker"),
        element("h1", title),
        table(SUMMARY, rows, class_="summary") if len(rows) > 1 else "",
    )


def _summary_row(number: int, result: Calibrated) -> Iterable[str]:
    unit = unit_label(result.fit.calibration.unit_in)
    return (
        element("a", result.samples.name, href=f"#sensor-{number}"),
        tables.mark(result.verdict, MEANINGS[result.verdict][0]),
        grouped(result.fit.n),
        tables.spread(result.verification),
        degrees(result.fit.coverage.heading_sd_deg),
        quantity(result.fit.noise, unit, 2),
    )
