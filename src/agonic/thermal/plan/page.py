"""The plan of a campaign as one HTML page for the laboratory: it needs nothing else, and prints."""

from __future__ import annotations

from agonic.report.blocks import header
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup, table
from agonic.report.verdict import sentence
from agonic.thermal.campaign.description import Station
from agonic.thermal.plan import text as words
from agonic.thermal.plan.drawings import draw_pose, draw_profile
from agonic.thermal.plan.plan import ThermalPlan


def plan_page(plan: ThermalPlan, *, title: str = "") -> str:
    """Stations with drawings, chamber profile, expected standard errors, and lines to fill in.

    >>> from agonic.thermal.plan.plan import plan_thermal
    >>> page = plan_page(plan_thermal("MPU-9255"))
    >>> page.count('class="pose"'), "http://" in page.replace("http://www.w3.org", "")
    (12, False)
    """
    name = title or plan.description.name or "Calibration over temperature"
    body = markup(
        header("Climatic chamber: plan", name, element("p", words.describe_plan(plan))),
        element("main", _before(), _profile(plan), _stations(plan), _expected(plan)),
        element("footer", _after(plan)),
    )
    return document(name, body, style=static("plan.css"))


def _before() -> Markup:
    rules = element("ul", *(element("li", rule) for rule in words.RULES))
    return element("section", element("h2", "What to heed"), rules)


def _profile(plan: ThermalPlan) -> Markup:
    steps = element("ol", *(element("li", step) for step in words.list_steps(plan)))
    return element(
        "section",
        element("h2", "At every station"),
        draw_profile(plan.profile),
        element("div", steps, _costs(plan), class_="pair"),
    )


def _costs(plan: ThermalPlan) -> Markup:
    entries = {
        "Sensors": ", ".join(name for name, _ in words.group_sensors(plan)),
        **words.list_costs(plan),
    }
    entries["Steepest"] = f"cool at {plan.profile.cooling_limit_C_per_min:g} °C/min at most"
    pairs = (
        p for name, text in entries.items() for p in (element("dt", name), element("dd", text))
    )
    return element("dl", *pairs)


def _stations(plan: ThermalPlan) -> Markup:
    cards = (
        _card(plan, station, turn) for station, turn in zip(plan.stations, plan.turns, strict=True)
    )
    note = (
        "As seen from the door of the chamber, from above and the left. Name the sides of the box "
        "once: front, rear, right, left, top, bottom, and write them on it."
    )
    return element(
        "section",
        element("h2", "Stations"),
        element("p", note, class_="aside"),
        element("div", *cards, class_="stations"),
    )


def _card(plan: ThermalPlan, station: Station, turn: str) -> Markup:
    """One station: what to do, how it looks then, and lines to fill in."""
    drawn = Markup("")
    if station.rot_nb is not None:
        drawn = draw_pose(station.rot_nb, station.pose)
    file = plan.description.files.format(station=station.number)
    blanks = ("begun", "ended", "remarks")
    lines = (p for n in blanks for p in (element("dt", n), element("dd", "", class_="blank")))
    return element(
        "article",
        element("h3", element("span", f"{station.number}", class_="number"), f" {station.pose}"),
        element("p", sentence(turn)),
        drawn,
        element("dl", element("dt", "file"), element("dd", file), *lines),
    )


def _expected(plan: ThermalPlan) -> Markup:
    head = [
        "Sensor",
        "Noise, nT",
        "Bias, magnitude alone",
        "Matrix × field, magnitude alone",
        "Bias, turns known",
        "Matrix × field, turns known",
    ]
    return element(
        "section",
        element("h2", "Standard errors to expect"),
        table(head, words.list_errors(plan)),
        element("p", sentence(words.explain_errors(plan)), class_="aside"),
        *(element("p", text) for text in words.list_warnings(plan)),
    )


def _after(plan: ThermalPlan) -> Markup:
    command = element("code", "agonic fit thermal FOLDER -o RESULTS")
    return element(
        "p",
        f"Put the {len(plan.stations)} recordings and campaign.toml into one folder, then ",
        command,
        ". It says whether the programme was followed, and calibrates all sensors.",
        class_="aside",
    )
