"""`agonic plan swing`: the headings of a compass swing, and what they will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Json


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("swing")(swing)


def swing(
    headings: Annotated[int, typer.Option(help="Headings, evenly spread from north.")] = 8,
    heel: Annotated[
        float | None, typer.Option(metavar="DEG", help="Also tilt to either side by this much.")
    ] = None,
    noise_deg: Annotated[
        float, typer.Option("--noise-deg", metavar="DEG", help="Standard deviation of a reading.")
    ] = 1.0,
    terms: Annotated[str, typer.Option(help="Terms that will be fitted.")] = "ABCDE",
    rounds: Annotated[int, typer.Option(help="Times round, each the other way.")] = 1,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="Form to fill in, CSV.")
    ] = None,
    as_json: Json = False,
) -> int:
    """The headings of a compass swing, in order, and how well they will tell the deviation."""
    from agonic.calibration.deviation import PARAMETERS, name_heading
    from agonic.console.output import print_json, say
    from agonic.headings.deviation import plan_swing
    from agonic.headings.files.swing import write_form

    plan = plan_swing(headings, heel_deg=heel, noise_deg=noise_deg, terms=terms, rounds=rounds)
    tilts = None if heel is None else plan.roll_deg
    files = [str(write_form(plan.compass_deg, out, roll_deg=tilts))] if out else []
    sd = {n: s for n, s in zip(PARAMETERS, plan.sd.tolist(), strict=True) if s > 0.0}
    if as_json:
        print_json(
            "agonic/plan-swing@1",
            {
                "compass_deg": plan.compass_deg,
                "roll_deg": tilts,
                "terms": plan.terms,
                "noise_deg": plan.noise_deg,
                "sd": sd,
                "heading_sd_deg": plan.heading_sd_deg,
                "files": files,
            },
        )
        return 0
    say(f"Steer in this order, hold each until the compass is at rest ({noise_deg:g}° a reading):")
    for k, (compass, roll) in enumerate(zip(plan.compass_deg, plan.roll_deg, strict=True), start=1):
        side = "" if tilts is None else f"   roll {roll:+g}°"
        say(f"  {k:3d}  {name_heading(float(compass))}{side}")
    say("Standard errors to expect:")
    for name, error in sd.items():
        unit = "° per °" if "_" in name else "°"
        say(f"  {name.replace('_', ' '):<10} {error:.3f}{unit}")
    say(f"  {'heading':<10} {plan.heading_sd_deg:.3f}° corrected with the card, level")
    if files:
        say(f"Form to fill in: {files[0]}; then agonic fit deviation {files[0]}")
    return 0
