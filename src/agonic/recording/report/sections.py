"""The parts of the report about one sensor, what to do first at the top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from agonic.recording.calibrated import Calibrated
from agonic.recording.report import figures, sphere
from agonic.recording.report.next_move import next_move
from agonic.recording.report.quantities import mixes
from agonic.recording.report.residuals import FEWEST, Residuals, parted, residuals_of
from agonic.recording.report.tables import method, numbers
from agonic.report import blocks, tables
from agonic.report.digits import counted, degrees, grouped, minused, percent, quantity
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, data_script, element
from agonic.report.strips import beyond_words, captioned
from agonic.report.verdict import sentence

TURNING = "Drag to turn (start sideways on a touch screen) or use the arrow keys; Home turns back."


def sensor(number: int, result: Calibrated, exports: Sequence[str], most: int) -> Markup:
    """Everything about one sensor; `most` points of it are drawn."""
    name, residuals = f"sensor-{number}", residuals_of(result)
    parts = [
        element("h2", result.samples.name, id=f"{name}-name"),
        blocks.verdict(result.verdict, minused(sentence(result.status)), move=next_move(result)),
        _key_figures(result),
        _part("Numbers", numbers(result), _logged_note(result)),
        _part("Sphere before and after", *_spheres(result, most)),
        _part("Magnitude and residuals", *_residuals(result, residuals)),
        _part("Verification", _held_out_note(result), tables.checks(result.verification)),
        _part("Method and model", method(result)),
        _part("Findings", tables.findings(result.fit.findings)),
        _part("Coverage", *_coverage(result)),
        _part("Exports", _exports(exports)),
        _part("Provenance", tables.provenance(result.fit.calibration, result.samples)),
        data_script(sphere.sphere_data(result, residuals, most), id=f"{name}-data"),
    ]
    return element(
        "article", *parts, id=name, aria_labelledby=f"{name}-name", data_source=f"{name}-data"
    )


def _part(title: str, *content: str) -> Markup:
    return blocks.part(title, *content, level="h3")


def _key_figures(result: Calibrated) -> Markup:
    """The four numbers to look at first."""
    fit, verification = result.fit, result.verification
    coverage = fit.coverage
    return blocks.key_figures(
        [
            ("Spread of magnitude", tables.spread(verification), "held out, before → after"),
            (
                "Heading standard error",
                degrees(coverage.heading_sd_deg),
                f"level, at {grouped(coverage.inclination_deg)}° inclination",
            ),
            (
                "Noise",
                quantity(fit.noise, unit_label(fit.calibration.unit_in), 2),
                "one reading on one axis",
            ),
            (
                "Coverage",
                f"{np.count_nonzero(coverage.cells)} of {len(coverage.cells)}",
                f"directions, from {counted(fit.n, 'reading')}",
            ),
        ]
    )


def _logged_note(result: Calibrated) -> Markup:
    logged = result.samples.logged
    if mixes(result.fit.calibration):
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
    return element("p", text, " ± is one standard error.", class_="aside")


def _spheres(result: Calibrated, most: int) -> list[Markup]:
    """Two canvases that turn together, with what they show in words."""
    before, after = result.verification.spread_before, result.verification.spread_after
    limit = percent(sphere.deviation_limit(result))
    return [
        element(
            "div",
            _picture(
                "before",
                f"Raw readings, whose magnitude spreads by {percent(before)}.",
                "Before: readings as logged, the bias in the middle; the cross is where a reading "
                "of zero lies.",
            ),
            _picture(
                "after",
                f"Calibrated readings, whose magnitude spreads by {percent(after)}; "
                f"{sphere.coverage_words(result)}.",
                "After: the calibrated field and the 80 directions; those never seen are red.",
            ),
            class_="pair",
        ),
        element(
            "p",
            element("span", f"−{limit} "),
            element("i", class_="ramp"),
            element("span", f" +{limit}"),
            " magnitude against its mean, in the same colours before and after",
            class_="legend",
        ),
        element(
            "p",
            _thinned_note(len(result.samples), most),
            " ",
            element("span", TURNING, class_="screen-only"),
            class_="aside",
        ),
    ]


def _picture(part: str, shows: str, caption: str, **attributes: str) -> Markup:
    canvas = element(
        "canvas",
        shows,
        data_part=part,
        tabindex=0,
        role="img",
        aria_label=f"{shows} Arrow keys turn it.",
    )
    return element("figure", canvas, element("figcaption", caption), **attributes)


def _thinned_note(n: int, most: int) -> str:
    if n <= most:
        return f"All {grouped(n)} readings are drawn."
    return f"{grouped(most)} of {grouped(n)} readings are drawn, evenly chosen."


def _residuals(result: Calibrated, residuals: Residuals) -> list[Markup]:
    """The magnitude over time; residuals over time, as a histogram and over the sphere."""
    noise = quantity(residuals.noise, residuals.unit, 2)
    over_time = {
        "range": "least to largest",
        "mean": "mean, weighted as in the fit",
        "noise": f"± noise, {noise}",
    }
    if parted(result) is not None:
        over_time["held-out"] = "held out of the fit"
    return [
        captioned(
            "Magnitude over time",
            figures.magnitude_strip(result),
            {"before": "before", "after": "after the correction"},
        ),
        captioned(
            "Residuals over time",
            figures.residual_strip(result, residuals),
            over_time,
            beyond_words(residuals.values, residuals.limit, residuals.unit),
        ),
        *_other_kinds(result, residuals, over_time),
        element("div", _histogram(residuals, noise), _residual_sphere(residuals), class_="pair"),
    ]


def _other_kinds(
    result: Calibrated, residuals: Residuals, legend: Mapping[str, str]
) -> list[Markup]:
    """The residuals that the attitude gives: how far the field is from its dip and its azimuth."""
    strips = []
    for kind, channel in result.fit.channels.items():
        if kind == "magnitude":
            continue
        own = replace(residuals, values=channel.residuals, noise=channel.noise)
        noise = quantity(channel.noise, residuals.unit, 2)
        keys = {**legend, "noise": f"± scatter, {noise}: the sensor’s noise and the attitude’s"}
        strips.append(
            captioned(
                f"Residuals of the {kind} over time",
                figures.residual_strip(result, own),
                keys,
                beyond_words(own.values, own.limit, own.unit),
            )
        )
    return strips


def _histogram(residuals: Residuals, noise: str) -> Markup:
    doubted = int(np.sum(residuals.weights < 0.5))
    return captioned(
        "Histogram of residuals",
        figures.residual_histogram(residuals),
        {"bars": "readings", "normal": f"normal curve of the noise, {noise}"},
        f"{counted(doubted, 'reading')} {'counts' if doubted == 1 else 'count'} less than half in "
        "the fit.",
    )


def _residual_sphere(residuals: Residuals) -> Markup:
    shows = f"Mean residual of each direction. {residuals.worst}"
    return _picture(
        "residuals",
        shows,
        f"{shows} Near half and far half of the sphere; full colour at "
        f"±{quantity(residuals.mean_limit, residuals.unit, 2)}, "
        f"blank with fewer than {FEWEST} readings.",
        class_="wide",
    )


def _held_out_note(result: Calibrated) -> Markup:
    held_out = result.verification.held_out
    if held_out is None:
        text = "Checked on other readings than the fit has seen."
    elif parted(result) is None:
        text = (
            f"Each of {counted(int(held_out.sum()), 'reading')} was judged by a fit to other parts "
            "of the log, which had not seen it."
        )
    else:
        text = f"Checked on {counted(int(held_out.sum()), 'reading')} held out of the fit."
    return element("p", text, class_="aside")


def _coverage(result: Calibrated) -> list[Markup]:
    """Which directions were seen, and which turns are missing."""
    coverage = result.fit.coverage
    seen = element("p", f"{sphere.coverage_words(result)} ({percent(coverage.filled)}).")
    if result.verdict == "good":
        return [seen, element("p", "No further turns are needed.")]
    if coverage.turns:
        return [seen, element("p", element("strong", "Turns to add: "), sentence(coverage.turns))]
    return [seen]


def _exports(exports: Sequence[str]) -> Markup:
    if not exports:
        return element("p", "No files were written.")
    return element("ul", *(element("li", element("code", name)) for name in exports))
