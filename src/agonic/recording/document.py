"""What is said and shown of a calibrated recording: its page, its text and its JSON."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from agonic.recording import figures
from agonic.recording.calibrated import Calibrated
from agonic.recording.choice.fits import describe_latency
from agonic.recording.numbers import (
    describe_heading,
    describe_method,
    describe_origin,
    list_details,
    list_entries,
    list_numbers,
)
from agonic.recording.quantities import Residuals, compute_residuals, find_held_out, mixes_sensors
from agonic.recording.sections import (
    describe_disturbers,
    describe_ladder,
    say_overview,
    summarise_ladder,
)
from agonic.recording.values import FIELDS, list_values
from agonic.report import tables
from agonic.report.digits import count, group_digits, percent, quantity
from agonic.report.document import Document
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup
from agonic.report.section import Block, Section, Table, aside
from agonic.report.verdict import MEANINGS, WHEN_GOOD, moves, sentence

if TYPE_CHECKING:
    from agonic.ellipse.result import EllipseFit

SUMMARY = (
    "Sensor",
    "Verdict",
    "Readings",
    "Spread of magnitude",
    "Heading standard error",
    "Noise",
)


class Written(NamedTuple):
    """The files of one sensor, and what its exports do not hold or do."""

    files: list[str]
    warnings: list[str]
    texts: Mapping[str, str] = MappingProxyType({})
    """What stands in the small ones, by their name."""


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
    written = {name: Written([*files], []) for name, files in (exports or {}).items()}
    return describe_recording(results, title=title, written=written).to_html()


def describe_recording(
    results: Sequence[Calibrated],
    *,
    title: str = "",
    written: Mapping[str, Written] | None = None,
    failures: Iterable[tuple[str, str]] = (),
    schema: str = "agonic/calibrate@1",
) -> Document:
    """What is said and shown of every magnetometer of a log."""
    most = figures.MOST_POINTS // max(len(results), 1)
    sensors = [
        describe_sensor(
            result,
            (written or {}).get(result.samples.name),
            number=k,
            most=most,
        )
        for k, result in enumerate(results, start=1)
    ]
    failed = list(failures)
    sensors += [_describe_failure(*failure) for failure in failed]
    files = {name: one.files for name, one in (written or {}).items()}
    overview = partial(say_overview, results, failed, files) if len(sensors) > 1 else None
    rows = [_summarise(k, result) for k, result in enumerate(results, start=1)]
    return Document(
        schema=schema,
        kind="Magnetometer calibration",
        name=title,
        status="" if sensors else "No magnetometer was found in the log.",
        about=describe_origin(results),
        sections=[Section("", [Table(SUMMARY, rows, style="summary")])] if len(rows) > 1 else (),
        sensors=sensors,
        scripts=["canvas.js", "sphere.js", "copy.js", "interval.js"],
        data={"icosphere": figures.list_corners},
        overview=overview,
    )


def _summarise(number: int, result: Calibrated) -> list[str]:
    """A sensor's row of the table at the head of a page with several."""
    unit = unit_label(result.fit.calibration.unit_in)
    figures_of_fit = [
        tables.spread(result.verification),
        describe_heading(result)[0],
        quantity(result.fit.noise, unit, 2),
    ]
    if result.verdict == "refused":  # good numbers of a fit not to be used would invite using it
        figures_of_fit = [tables.NOTHING] * len(figures_of_fit)
    return [
        element("a", result.samples.name, href=f"#sensor-{number}"),
        tables.mark(result.verdict, MEANINGS[result.verdict][0]),
        group_digits(result.fit.n),
        *figures_of_fit,
    ]


def _describe_failure(sensor: str, why: str) -> Document:
    """What is said of a sensor that could not be fitted at all: refused, every figure null."""
    said = sentence(why.rstrip("."))
    known = {"sensor": sensor, "verdict": "refused", "status": said}
    lists = dict.fromkeys(("findings", "ladder", "disturbers", "checks", "files", "warnings"), ())
    return Document(
        name=sensor,
        verdict="refused",
        status=said,
        values=dict.fromkeys(FIELDS) | known | lists,
    )


def describe_sensor(
    result: Calibrated,
    written: Written | None = None,
    *,
    number: int = 1,
    most: int = figures.MOST_POINTS,
) -> Document:
    """What is said and shown of one sensor. `number` counts the sensors of a page, on which `most`
    points are drawn of this one."""
    fit, calibration = result.fit, result.fit.calibration
    files, warnings, texts = written or Written([], [])
    if result.samples.axes == "xy":
        from agonic.ellipse.document import describe_ellipse  # few logs have two axes

        return describe_ellipse(cast("EllipseFit", fit), files, warnings)
    refused = result.verdict == "refused"
    residuals = cache(lambda: compute_residuals(result))
    latency = "" if result.latency is None else describe_latency(result.latency)
    return Document(
        schema="agonic/fit@1",
        name=result.samples.name,
        method=f"{result.method}, {calibration.model} model, {group_digits(fit.n)} readings",
        verdict=result.verdict,
        status=sentence(result.status.removesuffix(latency).strip()),  # which has a line of its own
        findings=(*fit.findings, *result.failed),
        move=choose_move(result),
        remarks=warnings,
        key_figures=() if refused else _list_key_figures(result),
        entries=list_entries(result) | summarise_ladder(result),
        details=list_details(result) | {"Ladder": ""},  # which the section says whole
        entries_title="",
        refused_numbers=True,
        sections=[
            *_list_sections(result, residuals, most),
            Section("Exports", [_list_files(files, texts)]),
        ],
        values=list_values(result, files, warnings),
        calibration=calibration,
        samples=result.samples,
        data={f"sensor-{number}-data": lambda: figures.pack_sphere(result, residuals(), most)},
        command=_write_command(result),
    )


def _list_sections(
    result: Calibrated, residuals: Callable[[], Residuals], most: int
) -> list[Section]:
    """The figures and tables; numbers, residuals and checks of a refused fit folded away."""
    refused, shares = result.verdict == "refused", result.fit.shares
    bar = [tables.draw_shares(shares)] if shares and not refused else []
    swung = any(rung.errors_deg for rung in result.ladder)
    numbers, *others = (
        Section("Numbers", [lambda: list_numbers(result), _explain_numbers(result)]),
        Section("Magnitude and residuals", [lambda: figures.draw_residuals(result, residuals())]),
        Section(
            "Verification", [_describe_held_out(result), lambda: tables.checks(result.verification)]
        ),
    )
    return [
        Section("What the heading's error is made of", bar),
        Section("Sphere before and after", [lambda: figures.draw_spheres(result, most)]),
        Section(
            "Heading before and after", [lambda: figures.draw_headings(result)] if swung else []
        ),
        describe_ladder(result),
        *([] if refused else [numbers]),
        describe_disturbers(result),
        *([_fold([numbers, *others])] if refused else others),
        Section("Method and model", [lambda: describe_method(result)]),
        Section("Coverage", _describe_coverage(result)),
    ]


def _write_command(result: Calibrated) -> str:
    """What calibrates the sensor anew; nothing where it was not read from a file."""
    samples = result.samples
    if samples.source is None:
        return ""
    return (
        f"agonic calibrate {shlex.quote(samples.source.name)} --sensor {shlex.quote(samples.name)}"
    )


def choose_move(result: Calibrated) -> str:
    """What to do first: the move of the gravest finding, or of the first check that failed."""
    if result.verdict == "good":
        return WHEN_GOOD
    failed = [check.meaning for check in result.verification.checks if check.passed is False]
    return next(
        (m for m in (*moves(result.fit.findings), result.fit.coverage.turns, *failed) if m),
        result.status,
    )


def _list_key_figures(result: Calibrated) -> list[tuple[str, str, str]]:
    """The four numbers to look at first."""
    fit, cells = result.fit, result.fit.coverage.cells
    heading, place = describe_heading(result)
    noise = quantity(fit.noise, unit_label(fit.calibration.unit_in), 2)
    return [
        (SUMMARY[3], tables.spread(result.verification), "held out, before → after"),
        (SUMMARY[4], heading, place),
        (SUMMARY[5], noise, "one reading on one axis"),
        (
            "Coverage",
            f"{np.count_nonzero(cells)} of {len(cells)}",
            f"directions, from {count(fit.n, 'reading')}",
        ),
    ]


def _fold(sections: Sequence[Section]) -> Section:
    """What a refused fit found, folded away: it fits its own readings, and is wrong beyond them."""
    said = "Numbers, residuals and checks of the refused fit: not to be used"

    def draw() -> Markup:
        inside = (section.to_html("h3") for section in sections)
        return element("details", element("summary", said), *inside, class_="folded")

    return Section("", [draw])


def _explain_numbers(result: Calibrated) -> Markup:
    logged = result.samples.logged
    if mixes_sensors(result.fit.calibration):
        text = (
            "field = weights @ readings + weights of the second @ its readings + constant. In such "
            "a mix neither sensor has a bias or scale factors of its own."
        )
    elif logged is None:
        text = "The log holds no earlier correction to compare with."
    else:
        text = (
            f"“In the log” is the correction found there ({logged.source}). It was taken out of "
            "the readings before this calibration was made."
        )
    return aside(text, " ± is one standard error.")


def _describe_held_out(result: Calibrated) -> Markup:
    held_out = result.verification.held_out
    if held_out is None:
        text = "Checked on other readings than the fit has seen."
    elif find_held_out(result) is None:
        text = (
            f"Each of {count(int(held_out.sum()), 'reading')} was judged by a fit to other parts "
            "of the log, which had not seen it."
        )
    else:
        text = f"Checked on {count(int(held_out.sum()), 'reading')} held out of the fit."
    return aside(text)


def _describe_coverage(result: Calibrated) -> list[Block]:
    """Which directions were seen, and which orientations are missing."""
    coverage = result.fit.coverage
    seen = f"{figures.describe_coverage(result)} ({percent(coverage.filled)})."
    if result.verdict == "good":
        return [seen, "No further orientations are needed."]
    if not coverage.turns:
        return [seen]
    return [seen, element("p", element("strong", "Turns to add: "), sentence(coverage.turns))]


def _list_files(files: Sequence[str], texts: Mapping[str, str]) -> Markup:
    if not files:
        return element("p", "No files were written.")
    return markup(*(tables.show_file(Path(name).name, texts.get(name)) for name in files))
