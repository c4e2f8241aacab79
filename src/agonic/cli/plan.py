"""`agonic plan KIND`: what to do before a calibration, and what it will tell."""

from __future__ import annotations

import typer

from agonic.alignment.commands import plan_alignment
from agonic.console.kinds import add_kinds
from agonic.headings.commands import plan_swing
from agonic.recording.commands import plan as plan_recording
from agonic.thermal.commands import plan as plan_thermal


def add_to(app: typer.Typer) -> None:
    """Register the command and its kinds."""
    kinds = {
        "Calibrate": (plan_recording,),
        "Heading": (plan_swing,),
        "Laboratory": (plan_thermal, plan_alignment),
    }
    add_kinds(app, "plan", kinds, "Plan the data to take, with the standard errors to expect.")
