"""`Faults`: what goes wrong in a simulated campaign."""

from __future__ import annotations

from dataclasses import dataclass

from agonic.errors import AgonicError
from agonic.thermal.plan.plan import ThermalPlan


@dataclass(frozen=True, kw_only=True)
class Faults:
    """What went wrong in a campaign.

    Parameters
    ----------
    missing : stations that were never recorded. stuck : the sensor whose thermometer stands still.
    swapped : two stations exchanged in the description. drift : nT by which the chamber's field
        moves steadily from the first station to the last. truncated : stations whose recording
        ends in the middle. kelvin : temperatures are in kelvin and nothing says so.
    """

    missing: tuple[int, ...] = ()
    stuck: str = ""
    swapped: tuple[int, int] | None = None
    drift: float = 0.0
    truncated: tuple[int, ...] = ()
    kelvin: bool = False


def check_faults(faults: Faults, plan: ThermalPlan) -> None:
    """Raise `AgonicError` for faults at stations or sensors that there are not."""
    numbers = plan.description.numbers
    named = {*faults.missing, *faults.truncated, *(faults.swapped or ())}
    if named - set(numbers):
        raise AgonicError(f"there is no station {min(named - set(numbers))} to spoil")
    names = [sensor.name for sensor in plan.sensors]
    if faults.stuck and faults.stuck not in names:
        raise AgonicError(f"there is no sensor {faults.stuck!r}; there are {', '.join(names)}")
    if len(set(numbers) - set(faults.missing)) < 1:
        raise AgonicError("all stations are missing; nothing is left to simulate")
