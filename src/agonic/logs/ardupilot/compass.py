"""What an ArduPilot compass measured, from the corrected readings that its log holds, and what the
log holds beside it.

    field = M · s · (raw + OFS) + MO        raw = (M s)⁻¹ · (field − MO) − OFS

in milligauss and body axes. OFS and the motor part MO stand beside each reading; the symmetric M
(DIA, ODI) and the scale s come from the COMPASS_* parameters in force at that reading. Source:
ArduPilot, libraries/AP_Compass/AP_Compass_Backend.cpp (correct_field) and LogStructure.h.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import LogError
from agonic.logs.headers.columns import read_dialects
from agonic.logs.log import Readings
from agonic.logs.rows import tracks
from agonic.logs.rows.auxiliary import resample
from agonic.logs.rows.tracks import Table
from agonic.maths.equation.affine import correct
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.samples import Logged
from agonic.units import NANOTESLA_PER

LARGEST_SCALE = 1.5
"""COMPASS_MAX_SCALE_FACTOR: outside 1/1.5…1.5 the firmware takes 1."""
AXES = "XYZ"


def remove_correction(mag: Table, parameters: Table, slot: str) -> Readings:
    """Take the correction out of the readings of one compass. `mag` has its messages, `parameters`
    the PARM messages, and `slot` is the number in the parameter names: "" for the first compass,
    then "2" and "3"."""
    field, coarse = (mag.stack(*(stem + axis for axis in AXES)) for stem in ("Mag", "Ofs"))
    if field is None:
        raise LogError("the MAG messages name no MagX, MagY and MagZ; fetch the log again")
    motor = mag.stack("MOX", "MOY", "MOZ")
    motor = mag.stack("MOfsX", "MOfsY", "MOfsZ") if motor is None else motor
    if motor is None:
        motor = np.zeros_like(field)
    names = [f"COMPASS_OFS{slot}_{axis}" for axis in AXES]
    offset = np.stack([look_up(parameters, n, mag.position) for n in names], axis=1)
    if coarse is not None:  # of which it holds whole milligauss
        offset = np.where(np.abs(offset - coarse) < 1.0, offset, coarse)
    starts, matrices = find_soft_iron(parameters, slot, mag.position)
    inverse = np.repeat(np.linalg.inv(matrices), np.diff(starts, append=len(mag)), axis=0)
    uncorrected = correct(field[:, None], motor[:, None], inverse)
    per_mG = NANOTESLA_PER["mG"]
    logged = Logged(
        bias=(0.0 - offset[-1]) * per_mG,
        matrix=matrices[-1],
        source="COMPASS_* parameters in the log",
    )
    changed = len(matrices) > 1 or bool((offset != offset[0]).any())
    notes = _notes(mag, parameters, slot, motor, changed)
    device = int(look_up(parameters, f"COMPASS_DEV_ID{slot}", mag.position[-1:])[0])
    return Readings(
        field=(uncorrected[:, 0] - offset) * per_mG,
        logged=logged,
        device_id=device or None,
        notes=notes,
    )


def find_soft_iron(parameters: Table, slot: str, at: Index) -> tuple[Index, Array]:
    """The matrices M s (k, 3, 3) in force one after the other, and the row where each begins. An
    entry of 100 is damage: the on-board fit takes diagonals of 0.2…5 only."""
    vectors = (f"COMPASS_{part}{slot}_{axis}" for part in ("DIA", "ODI") for axis in AXES)
    names = (*vectors, f"COMPASS_SCALE{slot}")
    values = np.stack([look_up(parameters, name, at) for name in names], axis=1)
    values = np.where(np.abs(values) < 100.0, values, 0.0)
    starts = np.flatnonzero((np.diff(values, axis=0, prepend=np.nan) != 0).any(axis=1))
    matrices = []
    for *six, scale in values[starts]:
        matrix = unpack_symmetric(six) if any(six[:3]) else np.eye(3)  # without, there is no M
        if abs(np.linalg.det(matrix)) < 1e-3:
            matrix = np.eye(3)
        matrices.append(matrix * (scale if 1 / LARGEST_SCALE <= scale <= LARGEST_SCALE else 1.0))
    return starts, np.stack(matrices)


def look_up(parameters: Table, name: str, at: Index) -> Array:
    """The value of a parameter at each place in the file; 0 if it is not logged. Its first value
    holds from the start, for the list is written while the log already runs."""
    rows = parameters.columns["Name"] == name.encode()
    if not rows.any():
        return np.zeros(len(at))
    latest = np.searchsorted(parameters.position[rows], at, side="right") - 1
    values: Array = parameters.columns["Value"][rows][np.maximum(latest, 0)]
    return values


def _notes(
    mag: Table, parameters: Table, slot: str, motor: Array, changed: bool
) -> tuple[str, ...]:
    notes = []
    if not (parameters.columns["Name"] == f"COMPASS_DIA{slot}_X".encode()).any():
        notes.append("no COMPASS_DIA in the log: its readings were taken to carry offsets only")
    if changed:
        notes.append("the compass parameters changed: each row was taken back with its own")
    if motor.any():
        notes.append("the autopilot's compensation for the motors was taken out as well")
    health = mag.get("Health")
    if health is not None and (unhealthy := int((health == 0).sum())):
        notes.append(f"{unhealthy} of {len(mag)} readings are marked unhealthy")
    return tuple(notes)


OUTPUTS, SPEED_CONTROLLERS = "RCOU", "ESC"
_BESIDE = read_dialects()["beside"]["ArduPilot"]
DISTURBERS: tuple[str, ...] = tuple(_BESIDE["disturbers"].split())
"""Messages of what may disturb a compass, beside the batteries'."""
YAW_ESTIMATORS = ("XKY0", "NKY0")
_REVERSIBLE = re.compile(rb"(Ardu)?(Sub|Rover|Boat|Blimp) V\d")
"""Vehicles whose motors stand still at the middle of their pulses."""


def list_tracks(mag: Table, tables: tracks.Tables) -> Iterator[tracks.Track]:
    """Attitude, motion, power, place and disturbers, as recorded beside a magnetometer. Motors by
    their duty (0 stopped, 1 the longest pulse), speed controllers and further batteries by their
    current. Source: ArduPilot, AP_Motors."""
    plain = (*tracks.list_quantities("ArduPilot", tables), *_list_throttle(tables.get("CTUN")))
    for name, table, values in (*plain, *_list_duties(tables), *_list_currents(tables)):
        yield _track(mag, name, table, values)


def _track(mag: Table, name: str, table: Table, values: Array) -> tracks.Track:
    """A quantity of another message; without times it meets the rows by place in the file."""
    here, there = mag.time_s, table.time_s
    if here is None or there is None:
        here, there = mag.position.astype(float), table.position.astype(float)
    return tracks.Track(name, there, values, here)


def list_headings(tables: tracks.Tables) -> Iterator[tracks.Candidate]:
    """What tells a heading without a magnetometer: a GPS with two antennas, the yaw by velocities.
    GPS.Yaw is 0 where there is none; GPA.YAcc is its accuracy. XKY0 (NKY0 of an older filter) has
    the composite yaw YC of the EKF-GSF and its standard deviation YCS, degrees."""
    gps, accuracy = tracks.find_first(tables, "GPS"), tracks.find_first(tables, "GPA")
    if gps is not None and gps.time_s is not None and (yaw := gps.get("Yaw")) is not None:
        sd = np.full(len(yaw), tracks.GPS_YAW_SD_DEG)
        if accuracy is not None and accuracy.time_s is not None and "YAcc" in accuracy.columns:
            stated = resample(accuracy.time_s, accuracy.columns["YAcc"], gps.time_s)
            sd = sd if stated is None else np.where(stated > 0, stated, sd)
        if (yaw != 0).any():
            yield tracks.Candidate("GPS yaw", gps.time_s, np.where(yaw != 0, yaw, np.nan), sd)
    for name in YAW_ESTIMATORS:
        table = tables.get(name)
        if table is None or table.time_s is None or not {"YC", "YCS"} <= set(table.columns):
            continue
        core = table.get("C")
        one = table if core is None else table.select(core == core.min())
        assert one.time_s is not None
        yield tracks.Candidate("EKF-GSF yaw", one.time_s, one.columns["YC"], one.columns["YCS"])
        return


def _list_throttle(control: Table | None) -> Iterator[tracks.Quantity]:
    """The throttle on its full scale. Plane and Rover log percent, Copter and Sub 0…1, or 0…1000 as
    a whole number."""
    name = "ThO" if control is not None and "ThO" in control.columns else "ThrOut"
    if control is not None and name in control.columns:
        percent = "NavRoll" in control.columns or "Steer" in control.columns
        full = 100.0 if percent else 1000.0 if name in control.integer else 1.0
        yield "throttle", control, control.columns[name] / full


def _list_duties(tables: tracks.Tables) -> Iterator[tracks.Quantity]:
    """The outputs that drive motors; where the parameters do not tell which do, all of them."""
    table, parameters = tables.get(OUTPUTS), tables.get("PARM")
    if table is None:
        return
    low, high, least = 1000.0, 2000.0, 0.0  # µs
    functions: dict[int, int] = {}
    if _REVERSIBLE.search(b" ".join(list_texts(tables))):
        low, least = 1500.0, -1.0
    if parameters is not None and {"Name", "Value"} <= set(parameters.columns):
        at = table.position[-1:]
        shortest, longest = (look_up(parameters, f"MOT_PWM_{end}", at)[0] for end in ("MIN", "MAX"))
        if least == 0.0 and 0 < shortest < longest < 3000.0:
            low, high = shortest, longest
        found = {k: int(look_up(parameters, f"SERVO{k}_FUNCTION", at)[0]) for k in range(1, 15)}
        functions = {k: function for k, function in found.items() if function > 0}
    for k in range(1, 15):
        pulses, function = table.get(f"C{k}", f"Ch{k}", f"Chan{k}"), functions.get(k, 0)
        name = _BESIDE["functions"].get(f"{function}") if functions else f"output{k}_duty"
        if pulses is not None and name is not None:
            yield name, table, np.clip((pulses - low) / (high - low), least, 1.0)


def list_texts(tables: tracks.Tables) -> list[bytes]:
    """What the vehicle says of its firmware."""
    return [
        text
        for name, column in (("VER", "FWS"), ("MSG", "Message"))
        if name in tables and column in tables[name].columns
        for text in tables[name].columns[column].tolist()
    ]


def _list_currents(tables: tracks.Tables) -> Iterator[tracks.Quantity]:
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
