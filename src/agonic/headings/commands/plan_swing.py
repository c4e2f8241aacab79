"""`agonic plan swing`: the headings to steer, and what they will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Json


def swing(
    headings: Annotated[int, typer.Option(help="Headings, evenly spread from north.")] = 8,
    heel: Annotated[
        float | None, typer.Option(metavar="DEG", help="Also tilt to either side by this much.")
    ] = None,
    noise_deg: Annotated[
        float, typer.Option("--noise-deg", metavar="DEG", help="Standard deviation of a reading.")
    ] = 1.0,
    terms: Annotated[str, typer.Option(help="Terms that will be fitted.")] = "ABCDE",
    rounds: Annotated[int, typer.Option(help="Rounds, in alternate directions.")] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="FILE", help="Form to fill in, .csv; a page to print, .html."
        ),
    ] = None,
    as_json: Json = False,
) -> int:
    """The headings of a compass swing, in order, and the standard errors to expect."""
    from agonic.console.finish import finish
    from agonic.headings.deviation import plan_swing
    from agonic.headings.deviation.plan_document import describe_plan
    from agonic.headings.files.swing import make_form

    plan = plan_swing(headings, heel_deg=heel, noise_deg=noise_deg, terms=terms, rounds=rounds)
    compass, tilts = plan.closed
    made = describe_plan(plan, heeled=heel is not None)
    forms = {".csv": lambda: make_form(compass, roll_deg=None if heel is None else tilts)}
    return finish(made, report=out, option="-o", forms=forms, as_json=as_json)
