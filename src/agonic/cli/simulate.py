"""`agonic simulate KIND -o FILE`: readings with known truth."""

from __future__ import annotations

import typer

from agonic.alignment.commands import simulate as simulate_alignment
from agonic.cli import simulate_motion, simulate_orbit, simulate_rover, simulate_vehicle
from agonic.console.kinds import add_kinds
from agonic.fleet.commands import simulate_fleet
from agonic.inertial.commands import simulate_shots
from agonic.network.commands import simulate_network
from agonic.thermal.commands import simulate as simulate_campaign


def add_to(app: typer.Typer) -> None:
    """Register the command and its kinds."""
    kinds = {
        "One sensor in motion": (simulate_motion, simulate_shots),
        "Vehicles and missions": (
            simulate_vehicle,
            simulate_rover,
            simulate_orbit,
            simulate_network,
        ),
        "Laboratory": (simulate_campaign, simulate_alignment),
        "Fleet": (simulate_fleet,),
    }
    add_kinds(
        app,
        "simulate",
        kinds,
        "Write readings of a simulated sensor or vehicle, and the truth beside them.",
    )
