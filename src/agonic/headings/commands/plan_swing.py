"""`agonic plan swing`: the headings to steer, and what they will tell."""

from __future__ import annotations

from pathlib import Path

from agonic.console.options import Json


def swing(
    headings: int = 8,
    heel: float | None = None,
    noise_deg: float = 1.0,
    terms: str = "ABCDE",
    rounds: int = 1,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """The headings of a compass swing, in order, and the standard errors to expect.

    Options
    -------
    headings : Headings, evenly spread from north.
    heel DEG : Also tilt to either side by this much.
    noise_deg DEG : Standard deviation of a reading.
    terms : Terms that will be fitted.
    rounds : Rounds, in alternate directions.
    out -o FILE : Form to fill in, .csv; a page to print, .html.
    """
    from agonic.console.finish import finish
    from agonic.headings.deviation import plan_swing
    from agonic.headings.deviation.document import describe_plan
    from agonic.headings.files.swing import make_form

    plan = plan_swing(headings, heel_deg=heel, noise_deg=noise_deg, terms=terms, rounds=rounds)
    compass, tilts = plan.closed
    made = describe_plan(plan)
    forms = {".csv": lambda: make_form(compass, roll_deg=None if heel is None else tilts)}
    return finish(made, report=out, option="-o", forms=forms, as_json=as_json)
