"""What an ArduPilot log holds beside a compass, at its rows: motion, power, place, disturbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from agonic.arrays import Array
from agonic.logs.ardupilot.dataflash_binary import Table
from agonic.logs.ardupilot.parameters import look_up
from agonic.logs.rows.resample import resample
from agonic.logs.rows.tracks import Candidate, Track

Tables = Mapping[str, Table]

OUTPUTS, SPEED_CONTROLLERS = "RCOU", "ESC"
DISTURBERS = (OUTPUTS, SPEED_CONTROLLERS, *(f"{SPEED_CONTROLLERS}{k}" for k in range(1, 9)))
"""Messages of what may disturb a compass, beside the batteries'."""

YAW_ESTIMATORS = ("XKY0", "NKY0")
GPS_YAW_SD_DEG = 2.0
"""Of two antennas half a metre apart, where the receiver does not say."""

MOTORS = {33 + k: k + 1 for k in range(8)} | {82 + k: k + 9 for k in range(4)}
"""SERVOn_FUNCTION of the motors of a multicopter: 33…40 and 82…85."""
THROTTLES = {70: "throttle_duty", 73: "throttle_left_duty", 74: "throttle_right_duty"}
_PULSES_US = (1000.0, 2000.0)
_LONGEST_PULSE_US = 3000.0
_REVERSIBLE = re.compile(rb"(Ardu)?(Sub|Rover|Boat|Blimp) V\d")
"""Vehicles whose motors stand still at the middle of their pulses."""


def list_tracks(mag: Table, tables: Tables) -> Iterator[Track]:
    """Attitude, motion, power, place and disturbers, as recorded beside a magnetometer. Motors by
    their duty (0 stopped, 1 the longest pulse), speed controllers and further batteries by their
    current. Source: ArduPilot, libraries/AP_Logger/LogStructure.h, AP_Motors."""
    battery, control = _first_instance(tables, "BAT", "CURR"), tables.get("CTUN")
    hundredths = battery is not None and "Curr" in battery.integer
    throttle, full = _throttle(control)
    for table, quantities in (
        (tables.get("ATT"), {"roll_deg": "Roll", "pitch_deg": "Pitch", "heading_deg": "Yaw"}),
        (
            _first_instance(tables, "IMU"),
            {"acceleration": "AccX AccY AccZ", "rotation_rate": "GyrX GyrY GyrZ"},
        ),
        (battery, {"current_A": "Curr"}),
        (control, {"throttle": throttle}),
        (_fixes(tables), {"latitude_deg": "Lat", "longitude_deg": "Lng", "altitude_m": "Alt"}),
    ):
        for name, columns in quantities.items() if table is not None else ():
            assert table is not None
            stacked = [table.columns[c] for c in columns.split() if c in table.columns]
            if stacked and len(stacked) == len(columns.split()):
                values = stacked[0] if len(stacked) == 1 else np.stack(stacked, axis=1)
                per_unit = {"throttle": full, "current_A": 100.0 if hundredths else 1.0}
                yield _track(mag, name, table, values / per_unit.get(name, 1.0))
    for name, table, values in (*_list_duties(tables), *_list_currents(tables)):
        yield _track(mag, name, table, values)


def _track(mag: Table, name: str, table: Table, values: Array) -> Track:
    """A quantity of another message; without times it meets the rows by place in the file."""
    here, there = mag.time_s, table.time_s
    if here is None or there is None:
        here, there = mag.position.astype(float), table.position.astype(float)
    return Track(name, there, values, here)


def list_headings(tables: Tables) -> Iterator[Candidate]:
    """What tells a heading without a magnetometer: a GPS with two antennas, the yaw by velocities.
    GPS.Yaw is 0 where there is none; GPA.YAcc is its accuracy. XKY0 (NKY0 of an older filter) has
    the composite yaw YC of the EKF-GSF and its standard deviation YCS, degrees."""
    gps, accuracy = _first_instance(tables, "GPS"), _first_instance(tables, "GPA")
    if gps is not None and gps.time_s is not None and (yaw := gps.get("Yaw")) is not None:
        sd = np.full(len(yaw), GPS_YAW_SD_DEG)
        if accuracy is not None and accuracy.time_s is not None and "YAcc" in accuracy.columns:
            stated = resample(accuracy.time_s, accuracy.columns["YAcc"], gps.time_s)
            sd = sd if stated is None else np.where(stated > 0, stated, sd)
        if (yaw != 0).any():
            yield Candidate("GPS yaw", gps.time_s, np.where(yaw != 0, yaw, np.nan), sd)
    for name in YAW_ESTIMATORS:
        table = tables.get(name)
        if table is None or table.time_s is None or not {"YC", "YCS"} <= set(table.columns):
            continue
        core = table.get("C")
        one = table if core is None else table.select(core == core.min())
        assert one.time_s is not None
        yield Candidate("EKF-GSF yaw", one.time_s, one.columns["YC"], one.columns["YCS"])
        return


def _first_instance(tables: Tables, *names: str) -> Table | None:
    """The messages of the first instance, of the first of these names that is there."""
    table = next((tables[name] for name in names if name in tables), None)
    instance = None if table is None else table.get("I", "Inst", "Instance")
    if table is None or instance is None:
        return table
    return table.select(instance == instance.min())


def _throttle(control: Table | None) -> tuple[str, float]:
    """The column of the throttle and its full scale. Plane and Rover log percent, Copter and Sub
    0…1, or 0…1000 as a whole number."""
    if control is None:
        return "", 1.0
    name = "ThO" if "ThO" in control.columns else "ThrOut"
    if "NavRoll" in control.columns or "Steer" in control.columns:
        return name, 100.0
    return name, 1000.0 if name in control.integer else 1.0


def _fixes(tables: Tables) -> Table | None:
    """Where the vehicle was: GPS messages with a three-dimensional fix, else estimates (POS)."""
    for name in ("GPS", "POS"):
        table = _first_instance(tables, name)
        if table is None or not {"Lat", "Lng", "Alt"} <= set(table.columns):
            continue
        latitude, longitude = table.columns["Lat"], table.columns["Lng"]
        real = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180) & (latitude != 0)
        status = table.get("Status")
        if status is not None:
            real &= status >= 3
        if real.any():
            return table.select(real)
    return None


def _list_duties(tables: Tables) -> Iterator[tuple[str, Table, Array]]:
    """The outputs that drive motors; where the parameters do not tell which do, all of them."""
    table, parameters = tables.get(OUTPUTS), tables.get("PARM")
    if table is None:
        return
    low, high, least = *_PULSES_US, 0.0
    functions: dict[int, int] = {}
    if _REVERSIBLE.search(b" ".join(list_texts(tables))):
        low, least = float(np.mean(_PULSES_US)), -1.0
    if parameters is not None and {"Name", "Value"} <= set(parameters.columns):
        at = table.position[-1:]
        shortest, longest = (look_up(parameters, f"MOT_PWM_{end}", at)[0] for end in ("MIN", "MAX"))
        if least == 0.0 and 0 < shortest < longest < _LONGEST_PULSE_US:
            low, high = shortest, longest
        found = {k: int(look_up(parameters, f"SERVO{k}_FUNCTION", at)[0]) for k in range(1, 15)}
        functions = {k: function for k, function in found.items() if function > 0}
    for k in range(1, 15):
        pulses, function = table.get(f"C{k}", f"Ch{k}", f"Chan{k}"), functions.get(k, 0)
        name = f"motor{MOTORS[function]}_duty" if function in MOTORS else THROTTLES.get(function)
        name = name if functions else f"output{k}_duty"
        if pulses is not None and name is not None:
            yield name, table, np.clip((pulses - low) / (high - low), least, 1.0)


def list_texts(tables: Tables) -> list[bytes]:
    """What the vehicle says of its firmware."""
    return [
        text
        for name, column in (("VER", "FWS"), ("MSG", "Message"))
        if name in tables and column in tables[name].columns
        for text in tables[name].columns[column].tolist()
    ]


def _list_currents(tables: Tables) -> Iterator[tuple[str, Table, Array]]:
    """The currents of speed controllers, and of all batteries but the first."""
    for k in range(1, 9):
        if (own := tables.get(f"{SPEED_CONTROLLERS}{k}")) is not None and "Curr" in own.columns:
            yield f"esc{k}_A", own, own.columns["Curr"]
    for message, name, first in ((SPEED_CONTROLLERS, "esc", 0), ("BAT", "battery", 1)):
        table = tables.get(message)
        instance = None if table is None else table.get("I", "Inst", "Instance")
        if table is None or instance is None or "Curr" not in table.columns:
            continue
        for k, which in enumerate(sorted(set(instance.tolist()))[first:], start=first + 1):
            one = table.select(instance == which)
            yield f"{name}{k}_A", one, one.columns["Curr"]
