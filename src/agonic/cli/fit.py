"""`agonic fit KIND LOG`: one fit with every setting."""

from __future__ import annotations

import typer

from agonic.alignment.commands import fit as fit_alignment
from agonic.attitude import command as fit_latency
from agonic.console.kinds import add_kinds
from agonic.headings.commands import fit_deviation
from agonic.inertial.commands import fit_pair
from agonic.inflight.commands import fit_inflight
from agonic.network.commands import fit_network
from agonic.recording.commands import fit_affine
from agonic.thermal.commands import fit as fit_thermal


def add_to(app: typer.Typer) -> None:
    """Register the command and its kinds."""
    kinds = {
        "Calibrate": (fit_affine, fit_pair, fit_latency, fit_network),
        "Heading": (fit_deviation,),
        "Missions": (fit_inflight,),
        "Laboratory": (fit_thermal, fit_alignment),
    }
    add_kinds(app, "fit", kinds, "Fit one kind of calibration to a log.")
