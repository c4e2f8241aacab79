"""What is said and shown of a plan: a page for the laboratory, plain text, and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from agonic.maths.rotations.attitude import angles_deg
from agonic.readable import make_record
from agonic.report.digits import significant
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table, aside
from agonic.report.verdict import sentence
from agonic.thermal.campaign.description import Sensor, Station
from agonic.thermal.campaign.profile import format_signed
from agonic.thermal.plan.figures import draw_pose, draw_profile
from agonic.thermal.plan.plan import ThermalPlan

RULES = (
    "Fix the box in its holder and keep magnets, steel and cables that carry changing currents "
    "away from the chamber; leave everything in the room where it is until the last station.",
    "Switch the sensors on and leave them on: their own heat is part of their temperature.",
    "Open the chamber only while it is warm: room air condenses in a cold box.",
    "Never cool faster than planned: the sensor would no longer have the temperature that its "
    "thermometer reports.",
    "Let the chamber hold at the ends for the whole time: the inside of the box is delayed.",
)
"""Precautions, each with its reason."""

SEEN = (
    "As seen from the door of the chamber, from above and the left. Name the sides of the box "
    "once: front, rear, right, left, top, bottom, and write them on it."
)
METHODS = {"magnitude": "magnitude alone", "known": "turns known"}


def describe_plan(plan: ThermalPlan, *, title: str = "") -> Document:
    """Stations with drawings, chamber profile, expected standard errors, and lines to fill in."""
    profile, sensors = plan.profile, len(plan.sensors)
    stations = zip(plan.stations, plan.turns, strict=True)
    poses = {f"Station {s.number}": f"{turn} ({s.pose})" for s, turn in stations}
    return Document(
        schema="agonic/plan-thermal@1",
        kind="Climatic chamber: plan",
        name=title or plan.description.name or "Calibration over temperature",
        status=f"{len(plan.stations)} stations, {sensors} sensor{'s' * (sensors > 1)}, "
        f"{profile.lowest_C:+g} to {profile.highest_C:+g} °C: {_format_hours(plan.duration_s)} "
        "in all",
        entries=_list_costs(plan),
        details=poses,
        entries_title="",
        sections=[
            Section("Precautions", [element("ul", *(element("li", rule) for rule in RULES))]),
            Section("Time and space", [_list_costs(plan)]),
            Section(
                "At every station",
                [lambda: draw_profile(profile), _list_steps(plan)],
                printed=True,
            ),
            Section("Stations", [aside(SEEN), lambda: _draw_cards(plan)]),
            Section(
                "Standard errors to expect",
                [
                    Table(["Sensor, nT", "noise", "bias", "matrix × field"], _list_errors(plan)),
                    sentence(_explain_errors(plan)),
                ],
                printed=True,
            ),
            Section("Afterwards", [_describe_next(plan)]),
        ],
        remarks=_list_warnings(plan),
        values=_list_values(plan),
        styles=("plan.css",),
    )


def _list_steps(plan: ThermalPlan) -> dict[str, str]:
    """What to set on the chamber at every station, start and end of the recording included."""
    heating, hold = plan.profile.before
    words = [f"{heating.words} (from the second station on it is warm already)", hold.words]
    words.append("start the recording")
    words += [segment.words for segment in plan.profile.recording]
    words.append("stop the recording, open the chamber while it is warm, turn the box")
    return {f"{k}": said for k, said in enumerate(words, start=1)}


def _list_costs(plan: ThermalPlan) -> dict[str, str]:
    """Sensors, time and disk space."""
    recorded, station, total = map(
        _format_hours, (plan.profile.recorded_s, plan.station_s, plan.duration_s)
    )
    return {
        "Sensors": ", ".join(name for name, _ in _group_sensors(plan)),
        "Station": f"{recorded} recorded, {station} with the first heating",
        "In all": f"{total} ({plan.duration_s / 86400:.1f} days without a break)",
        "Readings": f"{plan.rows:,} at {plan.rate_Hz:g} Hz".replace(",", " "),
        "Disk": f"{_format_size(plan.bytes_csv)} as CSV, "
        f"{_format_size(plan.bytes_parquet)} as Parquet",
        "Steepest": f"cool at {plan.profile.cooling_limit_C_per_min:g} °C/min at most",
        "Dew point": f"{format_signed(round(plan.dew_point_C, 1))} °C, of a room at "
        f"{plan.profile.room_C:g} °C and {plan.humidity_percent:g} % relative humidity",
    }


def _group_sensors(plan: ThermalPlan) -> list[tuple[str, Sensor]]:
    """The sensors that differ in what is expected, under one name each."""
    alike: dict[tuple[str, float | None], list[Sensor]] = {}
    for sensor in plan.sensors:
        alike.setdefault((sensor.model or sensor.name, sensor.reading_sd), []).append(sensor)
    return [
        (f"{len(own)} × {model}" if len(own) > 1 else own[0].name, own[0])
        for (model, _), own in alike.items()
    ]


def _list_errors(plan: ThermalPlan) -> list[list[str]]:
    """Noise and standard errors of each sensor, with the magnitude alone and with known turns."""
    return [
        [
            f"{name}, {words}",
            significant(sensor.reading_sd or 0.0, 3),
            significant(plan.expected[sensor.name][method].bias, 2),
            significant(plan.expected[sensor.name][method].matrix, 2),
        ]
        for name, sensor in _group_sensors(plan)
        for method, words in METHODS.items()
    ]


def _explain_errors(plan: ThermalPlan) -> str:
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


def _list_warnings(plan: ThermalPlan) -> Sequence[str]:
    """What speaks against the plan."""
    worst = max(plan.expected[s.name]["magnitude"].bias for s in plan.sensors)
    warnings = [] if plan.profile.lowest_C > plan.dew_point_C else [_warn_of_water(plan)]
    if worst >= 1000.0:
        warnings.append(
            "these stations do not determine all nine numbers by the magnitude alone: the "
            "directions of the field in the box are too alike; use the standard twelve, or known "
            "turns"
        )
    return warnings


def _warn_of_water(plan: ThermalPlan) -> str:
    """What to do against water that condenses on the boards."""
    room, low = plan.profile.room_C, plan.profile.lowest_C
    return (
        f"water will condense: the programme goes to {format_signed(low)} °C, and the dew point "
        f"of the room's air is {format_signed(round(plan.dew_point_C, 1))} °C; dry the air "
        f"in the chamber to below {significant(plan.dry_percent, 2)} % relative humidity at "
        f"{room:g} °C before it is closed (dry nitrogen, or the box in a bag with desiccant), and "
        f"open it only while the box is warmer than {format_signed(round(plan.dew_point_C, 1))} °C"
    )


def _draw_cards(plan: ThermalPlan) -> Markup:
    pairs = zip(plan.stations, plan.turns, strict=True)
    cards = (_draw_card(plan.description.files, station, turn) for station, turn in pairs)
    return element("div", *cards, class_="stations")


def _draw_card(pattern: str, station: Station, turn: str) -> Markup:
    """One station: what to do, how it looks then, and lines to fill in."""
    drawn = "" if station.rot_nb is None else draw_pose(station.rot_nb, station.pose)
    blanks = ("begun", "ended", "remarks")
    lines = (p for n in blanks for p in (element("dt", n), element("dd", "", class_="blank")))
    return element(
        "article",
        element("h3", element("span", f"{station.number}", class_="number"), f" {station.pose}"),
        element("p", sentence(turn)),
        drawn,
        element(
            "dl",
            element("dt", "file"),
            element("dd", pattern.format(station=station.number)),
            *lines,
        ),
    )


def _describe_next(plan: ThermalPlan) -> Markup:
    return element(
        "p",
        f"Put the {len(plan.stations)} recordings and campaign.toml into one folder, then ",
        element("code", "agonic fit thermal FOLDER -o RESULTS"),
        ". It says whether the programme was followed, and calibrates all sensors.",
    )


def _list_values(plan: ThermalPlan) -> dict[str, Any]:
    """The plan for programs."""
    stations = []
    for station, turn in zip(plan.stations, plan.turns, strict=True):
        assert station.rot_nb is not None
        matrix = station.rot_nb.as_matrix()
        angles = (float(angle) + 0.0 for angle in angles_deg(matrix))
        stations.append(
            {
                "number": station.number,
                "pose": station.pose,
                "turn": turn,
                **dict(zip(("roll_deg", "pitch_deg", "heading_deg"), angles, strict=True)),
                "matrix_nb": matrix,
            }
        )
    return {
        "sensors": [
            {"name": s.name, "model": s.model, "noise_nT": s.reading_sd} for s in plan.sensors
        ],
        "stations": stations,
        "profile": [asdict(part) for part in (*plan.profile.before, *plan.profile.recording)],
        **make_record(plan),
        "station_s": plan.profile.recorded_s,
        "expected_nT": {
            name: {
                method: {"bias_rms": found.bias, "matrix_rms": found.matrix}
                for method, found in by.items()
            }
            for name, by in plan.expected.items()
        },
    }


def _format_hours(seconds: float) -> str:
    """A duration as hours and minutes."""
    whole, minutes = divmod(round(seconds / 60), 60)
    parts = [f"{whole} h"] * (whole > 0) + [f"{minutes} min"] * (minutes > 0 or whole == 0)
    return " ".join(parts)


def _format_size(size: int) -> str:
    """A size with a unit."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{max(1, round(size / 1e6))} MB"
