"""What is said and shown of a deviation fit, its card as a page and as text, its numbers; and of
the plan of a swing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from string import Template
from typing import Any, Literal, get_args

import numpy as np

from agonic.calibration.deviation import PARAMETERS, Deviation, name_heading
from agonic.errors import check_choice
from agonic.headings.deviation.card import (
    WITHOUT_STATE,
    card_text,
    describe_power,
    judge_size,
    make_coefficient_rows,
    make_rows,
    say_verdict,
)
from agonic.headings.deviation.figures import NARROW, draw_chart, draw_picture
from agonic.headings.deviation.fit import DeviationFit
from agonic.headings.deviation.plan import SwingPlan
from agonic.health import figure
from agonic.readable import make_record
from agonic.report import tables
from agonic.report.document import Document
from agonic.report.markup import Markup, element, markup, table
from agonic.report.page_file import assemble_page, read_static
from agonic.report.section import Section, Table

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
    fit = result if isinstance(result, DeviationFit) else None
    card = result.calibration if isinstance(result, DeviationFit) else result
    state = describe_power(card)
    kind = "state unknown" if state == WITHOUT_STATE else "state"
    parts = [element("p", "Valid only with", element("strong", state), class_=kind)]
    if fit is not None:
        word, said = say_verdict(fit)
        parts.append(element("p", tables.mark(fit.verdict, word), f": {said}"))
    coefficients = Markup("")
    if fit is None or fit.verdict != "refused":
        charts = (draw_chart(result), draw_chart(result, NARROW))
        parts += [element("p", judge_size(card)), *charts, _tables(card, step_deg)]
        classical = None if fit is None else fit.classical
        head = ["", "Least squares, °", "Eight headings, °"][: 3 if classical else 2]
        made = [row[: len(head)] for row in make_coefficient_rows(card, classical)]
        coefficients = element("section", table(head, made))
    swing = dict(details or {}) | ({} if fit is None else {"Readings": str(fit.n)}) | _swing(card)
    evidence = element("div", coefficients, tables.definitions(swing), class_="fit")
    body = markup(
        tables.header("Compass deviation card", title or card.sensor),
        element("main", *parts, evidence),
    )
    style = Template(read_static("card.css")).substitute(paper=paper, **_SHEETS[paper])
    style += read_static("card_chart.css")
    return assemble_page(f"Deviation card: {title or card.sensor}", body, style=style)


def _tables(card: Deviation, step_deg: float) -> Markup:
    """What a reading means, and what to steer."""
    made = [row.write() for row in make_rows(card, step_deg)]
    reads = table(
        ["Compass reads", "Deviation", "± 95 %", "Magnetic"],
        [[name, off, band and f"{band}°", magnetic] for name, off, band, magnetic, _ in made],
    )
    steer = table(
        ["To make good (magnetic)", "steer (compass)"],
        [[name, steered] for name, *_, steered in made],
    )
    titled = (("From compass to magnetic", reads), ("From magnetic to compass", steer))
    sections = (element("section", element("h2", title), shown) for title, shown in titled)
    return element("div", *sections, class_="tables")


def _swing(card: Deviation) -> dict[str, str]:
    """Numbers of the swing and where the card came from."""
    said = {}
    if card.noise_deg is not None:
        said["Scatter"] = f"{figure(card.noise_deg)}°, one reading"
    if card.largest_gap_deg is not None:
        said["Widest gap"] = f"{card.largest_gap_deg:.0f}° between headings"
    heel, source = card.largest_heel_deg, card.provenance
    said["Heel"] = f"roll to {heel[0]:.0f}°, pitch to {heel[1]:.0f}°" if heel else "level"
    for given in source.inputs:
        said["From"] = f"{given.name}, SHA-256 {given.sha256[:12]}…"
    said["Made"] = f"{source.created[:10]}, {source.software}"
    said["Equation"] = "magnetic = compass + deviation; east is positive"
    return said


_SURE = 3.0
"""Standard errors from which a coefficient is worth a screwdriver."""
_WORTH_DEG = 0.1


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """A step, in words, and the largest deviation before and after it, level, degrees."""

    what: str
    before_deg: float
    after_deg: float

    def __str__(self) -> str:
        return f"{self.what}: {self.before_deg:.1f}° → {self.after_deg:.1f}°"


def find_remedies(card: Deviation) -> tuple[Remedy, ...]:
    """The steps that would help, where their coefficients stand out of their errors: turning the
    compass by A, nulling B by magnets fore and aft and C by magnets athwartships, and both.

    Source: Handbook of Magnetic Compass Adjustment (National Geospatial-Intelligence
    Agency, 2004), chapters V and VI.
    """

    def find_largest(nulled: list[int]) -> float:
        left = np.array(card.coefficients)
        left[nulled] = 0.0
        return float(np.abs(replace(card, coefficients=left).at(np.arange(360.0))).max())

    a = float(card.coefficients[0])
    sd = np.zeros(5) if card.covariance is None else np.sqrt(np.diag(card.covariance))[:5]
    large = np.abs(card.coefficients) > np.maximum(_SURE * sd, _WORTH_DEG)
    turned = f"turn the compass {abs(a):.1f}° {'clockwise' if a > 0 else 'counterclockwise'}"
    able = [(turned, [0])] if large[0] else []
    able += [("null B by magnets fore and aft, C athwart", [1, 2])] if large[1:3].any() else []
    if len(able) == 2:
        able.append(("both", [0, 1, 2]))
    before = find_largest([])
    made = (
        Remedy(what=what, before_deg=before, after_deg=find_largest(nulled))
        for what, nulled in able
    )
    return tuple(one for one in made if one.after_deg < before - _WORTH_DEG)


@dataclass(frozen=True, kw_only=True, eq=False)
class CardDocument(Document):
    """A document whose page and text are the card, which has a layout of its own.

    `step_deg` between the rows; `details` are lines to add; `paper` that it is printed on.
    """

    fit: DeviationFit
    step_deg: float
    details: Mapping[str, str]
    paper: Paper

    def to_html(self) -> str:
        """The card as a page."""
        return card_page(self.fit, step_deg=self.step_deg, details=self.details, paper=self.paper)

    def to_text(self, width: int = 0, *, brief: bool = False) -> str:
        """The card as plain text, which is as wide as a card."""
        return card_text(self.fit, step_deg=self.step_deg, details=self.details)

    def to_picture(self) -> str:
        """The chart alone, as SVG."""
        return draw_picture(self.fit)


def describe_deviation(
    fit: DeviationFit,
    *,
    step_deg: float = 15.0,
    details: Mapping[str, str] | None = None,
    paper: Paper = "A4",
    blank: int = 0,
) -> CardDocument:
    """The card, and the coefficients with their evidence; `blank` rows of the swing were empty."""
    remedies = () if fit.verdict == "refused" else find_remedies(fit.calibration)
    told = dict(zip(("to do", "or", "or better"), map(str, remedies), strict=False))
    return CardDocument.judge(
        fit,
        schema="agonic/fit-deviation@1",
        kind="Compass deviation card",
        name=fit.calibration.sensor,
        values={**_values(fit), "blank": blank, "remedies": [asdict(each) for each in remedies]},
        fit=fit,
        step_deg=step_deg,
        details={**(details or {}), **told},
        paper=paper,
    )


def _values(fit: DeviationFit) -> dict[str, Any]:
    """The coefficients that were fitted, and what they rest on."""
    card = fit.calibration
    values = [*card.coefficients, *([0.0] * 4 if card.heel is None else card.heel)]
    fitted = {
        name: (float(value), float(sd))
        for name, value, sd in zip(PARAMETERS, values, fit.sd, strict=True)
        if name in card.terms or sd > 0.0
    }
    return {
        "sensor": card.sensor,
        "method": "deviation",
        **make_record(fit),
        "coefficients": {name: value for name, (value, _) in fitted.items()},
        "sd": {name: sd for name, (_, sd) in fitted.items()},
        "residual_rms_deg": float((fit.residuals_deg**2).mean() ** 0.5),
        "heading_sd_deg": float(card.sd_at(range(360)).max()),
        "power_state": card.power_state,
        "current_A": card.current_A,
        "largest_gap_deg": card.largest_gap_deg,
        "equation": card.equation,
    }


def describe_plan(plan: SwingPlan) -> Document:
    """The headings to steer, and to which side, and what they will tell."""
    sd = {name: s for name, s in zip(PARAMETERS, plan.sd.tolist(), strict=True) if s > 0.0}
    steered, heeled = plan.closed, bool(plan.roll_deg.any())
    steps = [
        [str(k), name_heading(float(compass)), *([f"{roll:+g}°"] if heeled else []), ""]
        for k, (compass, roll) in enumerate(zip(*steered, strict=True), start=1)
    ]
    head = ["", "Compass", *(["Roll"] if heeled else []), "Magnetic, by the better source"]
    expected = {
        name.replace("_", " "): f"{error:.3f}{'° per °' if '_' in name else '°'}"
        for name, error in sd.items()
    }
    expected["heading"] = f"{plan.heading_sd_deg:.3f}° corrected with the card, level"
    return Document(
        schema="agonic/plan-swing@1",
        kind="Plan of a swing",
        name="Deviation of a compass",
        status="Steer in this order, hold each until the compass is at rest "
        f"({plan.noise_deg:g}° a reading); the first comes again at the end, where a reference "
        "that drifts shows. Fill in the form, then: agonic fit deviation FORM.",
        sections=[
            Section("", [Table(head, steps, "form")], printed=True),
            Section("Standard errors to expect", [expected], printed=True),
        ],
        values={
            **make_record(plan),
            "roll_deg": plan.roll_deg if heeled else None,
            "sd": sd,
        },
    )
