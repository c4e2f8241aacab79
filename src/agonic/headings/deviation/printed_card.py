"""The deviation card as one HTML page that needs nothing else and prints on one sheet."""

from __future__ import annotations

from collections.abc import Mapping
from string import Template
from typing import Literal, get_args

from agonic.calibration.deviation import Deviation, format_east_west, name_heading
from agonic.errors import check_choice
from agonic.headings.deviation.card import (
    WITHOUT_STATE,
    describe_power,
    format_heading,
    judge_size,
    make_coefficient_rows,
    make_rows,
    say_verdict,
)
from agonic.headings.deviation.figures import NARROW, draw_chart, load_style
from agonic.headings.deviation.fit import DeviationFit
from agonic.health import figure
from agonic.report import tables
from agonic.report.blocks import header
from agonic.report.markup import Markup, element, markup, table
from agonic.report.page_file import assemble_page, read_static

Paper = Literal["A4", "A5"]

_SHEETS = {
    "A4": {"margin": "11mm 14mm", "size": "8.2pt"},
    "A5": {"margin": "8mm 10mm", "size": "5.8pt"},
}


def card_page(
    result: Deviation | DeviationFit,
    *,
    step_deg: float = 15.0,
    title: str = "",
    details: Mapping[str, str] | None = None,
    paper: Paper = "A4",
) -> str:
    """The card as one self-contained HTML page: state, verdict, chart, table, coefficients.

    Parameters
    ----------
    result : a card, or the fit it came from, which adds readings and verdict; a refused fit has no
        table to steer by.
    step_deg : between rows. title : whose card; default: the sensor. details : lines to add, such
        as date and place. paper : the sheet that it is printed on.

    >>> page = card_page(Deviation(coefficients=[2.0, 0, 0, 0, 0], power_state="engine on"))
    >>> page.count("engine on"), "http://" in page.replace("http://www.w3.org", "")
    (1, False)
    """
    check_choice("paper", paper, get_args(Paper))
    card = result.calibration if isinstance(result, DeviationFit) else result
    refused = isinstance(result, DeviationFit) and result.verdict == "refused"
    use = [
        element("p", judge_size(card)),
        draw_chart(result),
        draw_chart(result, NARROW),
        _tables(card, step_deg),
    ]
    parts = [_state(card), _verdict(result), *([] if refused else use)]
    body = markup(
        header("Compass deviation card", title or card.sensor),
        element("main", *parts, _evidence(result, details or {})),
    )
    style = (
        Template(read_static("card.css")).substitute(paper=paper, **_SHEETS[paper]) + load_style()
    )
    return assemble_page(f"Deviation card: {title or card.sensor}", body, style=style)


def _state(card: Deviation) -> Markup:
    """What the card belongs to, before anything else."""
    state = describe_power(card)
    known = state != WITHOUT_STATE
    return element(
        "p",
        "Valid only with",
        element("strong", state),
        class_="state" if known else "state unknown",
    )


def _verdict(result: Deviation | DeviationFit) -> Markup:
    if not isinstance(result, DeviationFit):
        return Markup("")
    word, said = say_verdict(result)
    return element("p", tables.mark(result.verdict, word), f": {said}")


def _tables(card: Deviation, step_deg: float) -> Markup:
    """What a reading means, and what to steer."""
    made = make_rows(card, step_deg)
    reads = table(
        ["Compass reads", "Deviation", "± 95 %", "Magnetic"],
        [
            [
                name_heading(r.heading),
                format_east_west(r.deviation),
                "" if r.band is None else f"{r.band:.1f}°",
                format_heading(r.magnetic),
            ]
            for r in made
        ],
    )
    steer = table(
        ["To make good (magnetic)", "steer (compass)"],
        [[name_heading(r.heading), format_heading(r.steer)] for r in made],
    )
    return element(
        "div",
        element("section", element("h2", "From compass to magnetic"), reads),
        element("section", element("h2", "From magnetic to compass"), steer),
        class_="tables",
    )


def _evidence(result: Deviation | DeviationFit, details: Mapping[str, str]) -> Markup:
    """The coefficients, and how the swing was made."""
    fit = result if isinstance(result, DeviationFit) else None
    card = fit.calibration if fit else result
    assert isinstance(card, Deviation)
    classical = fit.classical if fit else None
    head = ["", "Least squares, °", "Eight headings, °"]
    shown = 3 if classical else 2
    made = [row[:shown] for row in make_coefficient_rows(card, classical)]
    swing = {**details, **_swing(card, fit)}
    refused = fit is not None and fit.verdict == "refused"
    return element(
        "div",
        "" if refused else element("section", table(head[:shown], made)),
        tables.definitions(swing),
        class_="fit",
    )


def _swing(card: Deviation, fit: DeviationFit | None) -> dict[str, str]:
    """Numbers of the swing and where the card came from."""
    said = {}
    if fit is not None:
        said["Readings"] = str(fit.n)
    if card.noise_deg is not None:
        said["Scatter"] = f"{figure(card.noise_deg)}°, one reading"
    if card.largest_gap_deg is not None:
        said["Widest gap"] = f"{card.largest_gap_deg:.0f}° between headings"
    if card.largest_heel_deg is None:
        said["Heel"] = "level"
    else:
        roll, pitch = card.largest_heel_deg
        said["Heel"] = f"roll to {roll:.0f}°, pitch to {pitch:.0f}°"
    for given in card.provenance.inputs:
        said["From"] = f"{given.name}, SHA-256 {given.sha256[:12]}…"
    said["Made"] = f"{card.provenance.created[:10]}, {card.provenance.software}"
    said["Equation"] = "magnetic = compass + deviation; east is positive"
    return said
