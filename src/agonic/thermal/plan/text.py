"""The plan of a campaign in a climatic chamber as plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from agonic.report.digits import significant
from agonic.thermal.campaign.sensors import Sensor
from agonic.thermal.plan.plan import ThermalPlan

RULES = (
    "Fix the box in its holder and keep magnets, steel and cables that carry changing currents "
    "away from the chamber; leave everything in the room where it is until the last station.",
    "Switch the sensors on and leave them on: their own heat is part of their temperature.",
    "Open the chamber only while it is warm: a cold box draws water from the air of the room.",
    "Never cool faster than planned: the sensor would no longer have the temperature that its "
    "thermometer reports.",
    "Let the chamber hold at the ends for the whole time: the inside of the box follows late.",
)
"""What to heed, each with its reason."""


def plan_text(plan: ThermalPlan) -> str:
    """Stations, profile, costs and expected standard errors, for a terminal.

    >>> from agonic.thermal.plan.plan import plan_thermal
    >>> print(plan_text(plan_thermal("MPU-9255")).splitlines()[0])
    12 stations, 1 sensor, -10 to +50 °C: 53 h 20 min in all
    """
    lines = [describe_plan(plan), "", "At every station"]
    lines += [f"  {step}" for step in list_steps(plan)]
    lines += ["", "Stations, as seen from the door of the chamber"]
    for station, turn in zip(plan.stations, plan.turns, strict=True):
        lines += [f"  {station.number:2d}  {turn}", f"      {station.pose}"]
    lines += ["", "Costs", *(f"  {name:<10} {text}" for name, text in list_costs(plan).items())]
    lines += ["", *_list_error_lines(plan), "", *list_warnings(plan)]
    return "\n".join(lines).rstrip()


def describe_plan(plan: ThermalPlan) -> str:
    """The campaign in a line."""
    profile, sensors, total = plan.profile, len(plan.sensors), format_hours(plan.duration_s)
    return (
        f"{len(plan.stations)} stations, {sensors} sensor{'s' * (sensors > 1)}, "
        f"{profile.lowest_C:+g} to {profile.highest_C:+g} °C: {total} in all"
    )


def list_steps(plan: ThermalPlan) -> list[str]:
    """What to set on the chamber at every station, the start and end of the recording included."""
    heating, hold = plan.profile.before
    words = [f"{heating.words} (from the second station on it is warm already)", hold.words]
    words.append("start the recording")
    words += [segment.words for segment in plan.profile.recording]
    words.append("stop the recording, open the chamber while it is warm, turn the box")
    return words


def list_costs(plan: ThermalPlan) -> dict[str, str]:
    """Time and disk space."""
    recorded, station, total = map(
        format_hours, (plan.profile.recorded_s, plan.station_s, plan.duration_s)
    )
    return {
        "Station": f"{recorded} recorded, {station} with the first heating",
        "In all": f"{total} ({plan.duration_s / 86400:.1f} days without a break)",
        "Readings": f"{plan.rows:,} at {plan.rate_Hz:g} Hz".replace(",", " "),
        "Disk": f"{format_size(plan.bytes_csv)} as CSV, "
        f"{format_size(plan.bytes_parquet)} as Parquet",
    }


def group_sensors(plan: ThermalPlan) -> list[tuple[str, Sensor]]:
    """The sensors that differ in what is expected, under one name each."""
    alike: dict[tuple[str, float | None], list[Sensor]] = {}
    for sensor in plan.sensors:
        alike.setdefault((sensor.model or sensor.name, sensor.reading_sd), []).append(sensor)
    return [
        (f"{len(own)} × {model}" if len(own) > 1 else own[0].name, own[0])
        for (model, _), own in alike.items()
    ]


def list_errors(plan: ThermalPlan) -> list[list[str]]:
    """Sensors, noise, and the standard errors with the magnitude alone and with known turns, nT."""
    rows = []
    for name, sensor in group_sensors(plan):
        expected = plan.expected[sensor.name]
        cells = [
            f"{significant(value, 2)}"
            for kind in ("magnitude", "known")
            for value in (expected[kind].bias, expected[kind].matrix)
        ]
        rows.append([name, significant(sensor.reading_sd or 0.0, 3), *cells])
    return rows


def explain_errors(plan: ThermalPlan) -> str:
    """What the standard errors rest on."""
    more = (
        f" and a field that differs by {plan.chamber_sd:g} nT from station to station"
        if plan.chamber_sd
        else "; changes of the chamber's field come on top (--field-sd)"
    )
    return (
        f"rms over the range, nT; polynomials of degree {plan.degree}, a field of "
        f"{plan.magnitude:g} nT at {plan.inclination_deg:g}° dip, at its worst "
        f"azimuth, turns known to {plan.fixture_sd_deg:g}°{more}"
    )


def _list_error_lines(plan: ThermalPlan) -> list[str]:
    """The table of standard errors for a terminal."""
    rows = list_errors(plan)
    wide = max(len(row[0]) for row in rows)
    lines = [
        "Standard errors to expect",
        f"  {'':<{wide}}  {'':>6}    magnitude alone        turns known",
        f"  {'nT':<{wide}}  {'noise':>6}    bias  matrix×field    bias  matrix×field",
    ]
    lines += [
        f"  {name:<{wide}}  {noise:>6}  {a:>6}  {b:>12}  {c:>6}  {d:>12}"
        for name, noise, a, b, c, d in rows
    ]
    return [*lines, *_wrap(f"({explain_errors(plan)})")]


def _wrap(text: str) -> list[str]:
    """Lines of a terminal's width, indented."""
    return textwrap.wrap(text, 96, initial_indent="  ", subsequent_indent="  ")


def list_warnings(plan: ThermalPlan) -> Sequence[str]:
    """What speaks against the plan."""
    worst = max(plan.expected[s.name]["magnitude"].bias for s in plan.sensors)
    if worst < 1000.0:
        return ()
    return (
        "! these stations do not determine all nine numbers by the magnitude alone: the directions "
        "of the field in the box are too alike; use the standard twelve, or known turns",
    )


def format_hours(seconds: float) -> str:
    """A duration as hours and minutes.

    >>> format_hours(14_400), format_hours(900), format_hours(5_400)
    ('4 h', '15 min', '1 h 30 min')
    """
    whole, minutes = divmod(round(seconds / 60), 60)
    parts = [f"{whole} h"] * (whole > 0) + [f"{minutes} min"] * (minutes > 0 or whole == 0)
    return " ".join(parts)


def format_size(size: int) -> str:
    """A size with a unit.

    >>> format_size(311_040_000), format_size(2_500_000_000)
    ('311 MB', '2.5 GB')
    """
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(1, round(size / 1e6))} MB"
