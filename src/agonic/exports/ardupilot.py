"""ArduPilot: a `.param` file with the COMPASS_* parameters of one compass.

    field = M (SCALE (raw + OFS)) + MOT x,   milligauss, body axes,   M of DIA and ODI

Source: ArduPilot/ardupilot, libraries/AP_Compass/AP_Compass_Backend.cpp (`correct_field`) and
AP_Compass.cpp (`have_scale_factor`). OFS is added, so it is minus the bias; MOT is added last, so
it is minus the matrix times what a unit of x adds to the readings. x is the battery's current in A
(COMPASS_MOTCT 2) or the throttle 0…1 (1), one kind for all compasses.

Each motor of the first compass, COMPASS_PMOT*:

    field += Σ c_n (V · duty_n)^EXP,   milligauss, after the matrix,   n of 1 to 4

Source: ArduPilot/ardupilot, libraries/AP_Compass/Compass_PerMotor.cpp (`scaled_output`,
`compensate`), and AP_Compass_Backend.cpp (`correct_field`): V is the battery's voltage, the duty
0…1 follows from the output's pulse, and with COMPASS_PMOT_EN only the first compass is compensated
so. c_n is therefore minus the matrix times what motor n adds at full duty, over V^EXP. This holds
since per-motor compensation came (pull request 6448, 2017). A rework that is proposed (22490) takes
c_n · thrust_n · current instead and has no COMPASS_PMOT_EXP: other numbers, another fit.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.autopilots import ARDUPILOT
from agonic.calibration.base import Calibration
from agonic.calibration.interference import Interference
from agonic.calibration.sources import parse_source
from agonic.calibration.steps import steps_of
from agonic.errors import AgonicError
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import (
    Export,
    find_source_term,
    find_turn_inside,
    find_turns,
    hold_sources,
    join_steps,
    take_symmetric,
    write_rows,
)
from agonic.exports.temperature import hold_temperature
from agonic.logs.ardupilot.compass import LARGEST_SCALE
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.units import NANOTESLA_PER

MOTORS = 4
_MOTOR = re.compile(rf"motor([1-{MOTORS}])_duty")
ASK_VOLTAGE = (
    "ArduPilot can compensate each motor of its first compass (COMPASS_PMOT): give the battery's "
    "voltage during the log with --voltage"
)
ABOUT_MOTORS = (
    "COMPASS_PMOT_EN 1 compensates the first compass only, and replaces COMPASS_MOT there; it "
    "needs outputs for motors 1 to 4 and the battery's voltage, with which it grows. The numbers "
    "are for firmware that has COMPASS_PMOT_EXP; without that parameter the formula is another"
)
USUAL_POWER = 2.0
"""Beyond this COMPASS_PMOT_EXP leaves the range of its documentation; the formula still holds."""


class MotorTerms(NamedTuple):
    """What each motor adds, nT at full duty (3,) in the target's axes, by its number; the power of
    the duty with which it goes; and the calibration without, its other sources held."""

    added: dict[int, Array]
    power: float
    rest: Calibration
    held: tuple[str, ...]


def find_motor_terms(
    calibration: Calibration, *, rotation_bm: Rotation | None = None
) -> MotorTerms | None:
    """The terms of motors 1 to 4, where all their duties count to one power, else `None`. Other
    sources are held at their average in the log; where that is not known there is no term."""
    steps = steps_of(calibration)
    found = [step for step in steps if isinstance(step, Interference)]
    if len(found) != 1 or "second" in found[0].sources:
        return None
    (step,) = found
    sources = [parse_source(name) for name in step.sources]
    motors = [all(_MOTOR.fullmatch(name) for name in one.columns) for one in sources]
    mine = [one for one, own in zip(sources, motors, strict=True) if own]
    held = tuple(name for name, own in zip(step.sources, motors, strict=True) if not own)
    powers = {one.value if one.form == "^" else 1.0 for one in mine}
    timed = any(one.late_s or one.time_constant_s for one in mine)
    whole = all(one.form in ("", "^") for one in mine) and not timed
    if len(powers) != 1 or not whole or (held and step.typical is None):
        return None
    into, _, _ = find_turns(calibration, "b", rotation_bm)
    added: dict[int, Array] = {}
    for one, column, own in zip(sources, step.coefficients.T, motors, strict=True):
        for name in one.columns if own else ():
            number = int(name[len("motor") : -len("_duty")])
            added[number] = added.get(number, np.zeros(3)) + into @ column
    typical = np.zeros(len(sources)) if step.typical is None else step.typical
    still = step.at(np.where(motors, 0.0, typical))
    rest = join_steps(still if one is step else one for one in steps)
    return MotorTerms(added, powers.pop(), rest, held)


def about_motors(terms: MotorTerms) -> tuple[str, ...]:
    """What to know of these parameters, and what was held."""
    held = (
        f"beside the motors the target has no terms for {', '.join(terms.held)}: held at their "
        "average in the log"
    )
    steep = (
        f"COMPASS_PMOT_EXP is {terms.power:g}, and ground stations warn beyond {USUAL_POWER:g}: "
        "set it nevertheless"
    )
    said = [ABOUT_MOTORS, *([held] if terms.held else [])]
    return (*said, steep) if terms.power > USUAL_POWER else tuple(said)


def compute_motor_parameters(terms: MotorTerms, matrix: Array, voltage: float) -> dict[str, float]:
    """COMPASS_PMOT* by name, from the matrix (3, 3) and the battery's voltage in the log."""
    parameters = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": terms.power}
    for number in range(1, MOTORS + 1):
        added = matrix @ terms.added.get(number, np.zeros(3))
        values = 0.0 - added / NANOTESLA_PER["mG"] / voltage**terms.power
        names = [f"COMPASS_PMOT{number}_{axis}" for axis in "XYZ"]
        parameters |= dict(zip(names, values.tolist(), strict=True))
    return parameters


LARGEST_OFFSET = 1800.0  # COMPASS_OFFS_MAX as delivered, mG, of the vector's length
OFF_DIAGONAL = 1.0
MOTOR_KIND = {"throttle": 1, "current_A": 2}  # COMPASS_MOTCT

CUSTOM = {1: (101, 1), 2: (102, 2)}
"""Of a compass the orientation at any angle, and the number of its CUST_ROTn_* (Rotation::CUSTOM_1
in AP_Math/rotations.h, AP_CustomRotations_params.cpp); there are two."""


def write_ardupilot(
    calibration: Calibration,
    path: Path | str,
    *,
    compass: int = 1,
    rotation_bm: Rotation | None = None,
    temperature_C: float | None = None,
    voltage_V: float | None = None,
) -> Export:
    """Write the COMPASS_* parameters that make ArduPilot apply a calibration.

    Parameters
    ----------
    calibration, path : what is written, and where.
    compass : 1, 2 or 3, the number in the parameter names (order of COMPASS_PRIO, not of the bus).
    rotation_bm : turns sensor axes into body axes, as the compass orientation of the vehicle does;
        only needed for a calibration in sensor axes.
    temperature_C : at which a calibration is held that changes with temperature: ArduPilot has
        parameters for the temperature of its inertial sensors and barometer, none for a compass.
    voltage_V : of the battery during the log, with which ArduPilot's compensation of each motor
        grows: with it a calibration by the duty of motors 1 to 4 becomes COMPASS_PMOT*.

    Raises `UnitError` for a calibration in raw units, and `AgonicError` for one that mixes two
    magnetometers or takes both current and throttle. Motor compensation is written where the
    calibration has a term for one of them, else left as it is in the vehicle.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3), frame_in="b", frame_out="b")
    >>> with TemporaryDirectory() as folder:
    ...     export = write_ardupilot(mag, folder + "/mag.param")
    ...     [row for row in export.path.read_text().split() if row.startswith("COMPASS_OFS_X")]
    ['COMPASS_OFS_X,-30.0']
    """
    one, lost = hold_temperature(calibration, temperature_C)
    parameters, warnings = compute_ardupilot_parameters(
        one, compass=compass, rotation_bm=rotation_bm, voltage_V=voltage_V
    )
    warnings = (*lost, *warnings)
    motor = " + MOT x" if "COMPASS_MOTCT" in parameters else ""
    motor += " + PMOTn (V duty_n)^EXP" if "COMPASS_PMOT_EN" in parameters else ""
    formula = f"field = M (SCALE (raw + OFS)){motor}, milligauss, body axes, M of DIA and ODI"
    notes = (
        *write_banner(calibration, formula, warnings),
        "Set COMPASS_LEARN 0, else the vehicle replaces these offsets by its own.",
        "COMPASS_ORIENT and CUST_ROT turn readings that are logged in the sensor's own axes "
        "(ArduPilot 4.2 or later); restart twice, for CUST_ROT_ENABLE shows the others."
        if "CUST_ROT_ENABLE" in parameters
        else "The numbers hold for the present compass orientation only.",
    )
    rows = (f"{name},{format_float32(value)}" for name, value in parameters.items())
    return write_rows("ardupilot", path, notes, rows, warnings)


def compute_ardupilot_parameters(
    calibration: Calibration,
    *,
    compass: int = 1,
    rotation_bm: Rotation | None = None,
    voltage_V: float | None = None,
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The parameters by name, and warnings; SCALE = trace(matrix)/3, DIA and ODI the rest."""
    turn_bm, angles = find_turn_inside(calibration, rotation_bm)
    oriented: dict[str, float] = {}
    if angles is not None and compass in CUSTOM:
        rotation_bm, oriented = turn_bm, _orient(angles, compass)
    motors = find_motor_terms(calibration, rotation_bm=rotation_bm) if compass == 1 else None
    if motors is not None and voltage_V is not None:
        if not 1.0 <= voltage_V <= 100.0:
            raise AgonicError(f"{voltage_V:g} V is not a battery's voltage; give that in flight")
        calibration, held = motors.rest, about_motors(motors)
    else:
        calibration, held = hold_sources(calibration, MOTOR_KIND)
        held += () if motors is None else (ASK_VOLTAGE,)
    bias, six, warnings = take_symmetric(
        calibration, "b", unit="milligauss", rotation_bm=rotation_bm
    )
    warnings += held
    offset = 0.0 - bias / NANOTESLA_PER["mG"]
    scale = float(six[:3].mean())
    if not 1 / LARGEST_SCALE <= scale <= LARGEST_SCALE:
        warnings += (
            f"a scale of {scale:.3f} is outside the {1 / LARGEST_SCALE:.2f} to {LARGEST_SCALE} "
            "that COMPASS_SCALE can hold: it was put into DIA and ODI; check the sensor's unit",
        )
        scale = 1.0
    values = [*offset, *(six / scale), scale]
    parameters = dict(zip(ardupilot_names(compass), map(float, values), strict=True)) | oriented
    if motors is not None and voltage_V is not None:
        parameters |= compute_motor_parameters(motors, unpack_symmetric(six), voltage_V)
    term = find_source_term(calibration, "b", rotation_bm=rotation_bm)
    if term is not None:
        source, added = term
        motor = -unpack_symmetric(six) @ added / NANOTESLA_PER["mG"]
        parameters |= dict(zip(ARDUPILOT.names(compass, "MOT"), motor.tolist(), strict=True))
        parameters["COMPASS_MOTCT"] = float(MOTOR_KIND[source])
        warnings += (
            f"COMPASS_MOTCT {MOTOR_KIND[source]} holds for all compasses of the vehicle: their "
            f"COMPASS_MOT must all be for {source}, and zero where a compass has none",
        )
    return parameters, (*warnings, *_remarks(offset, six / scale))


def ardupilot_names(compass: int) -> list[str]:
    """OFS x y z, DIA x y z, ODI x y z (= xy, xz, yz), SCALE; the first compass has no number."""
    if compass not in (1, 2, 3):
        raise AgonicError(f"compass is 1, 2 or 3 in ArduPilot, not {compass}")
    slot = ARDUPILOT.slots[compass - 1]
    return [*ARDUPILOT.names(compass, *ARDUPILOT.parts[:3]), f"COMPASS_SCALE{slot}"]


def _orient(angles: Array, compass: int) -> dict[str, float]:
    """The parameters of a compass that sits at any angle: roll, pitch and yaw (3,), degrees."""
    rotation, slot = CUSTOM[compass]
    named = zip(("ROLL", "PITCH", "YAW"), angles.tolist(), strict=True)
    return {
        f"COMPASS_ORIENT{ARDUPILOT.slots[compass - 1]}": float(rotation),
        "CUST_ROT_ENABLE": 1.0,
        **{f"CUST_ROT{slot}_{name}": angle for name, angle in named},
    }


def _remarks(offset: Array, six: Array) -> list[str]:
    """What the vehicle may object to."""
    remarks = []
    length = float(np.linalg.norm(offset))
    if length > LARGEST_OFFSET:
        remarks.append(
            f"offsets of {length:.0f} mG exceed COMPASS_OFFS_MAX ({LARGEST_OFFSET:.0f}): the "
            "vehicle will not arm; move the sensor away from metal or raise that limit"
        )
    smallest, largest = (0.2, 5.0)  # CompassCalibrator.cpp: what the on-board calibration accepts
    if six[:3].min() < smallest or six[:3].max() > largest or np.abs(six[3:]).max() >= OFF_DIAGONAL:
        remarks.append(
            f"DIA outside {smallest} to {largest} or ODI beyond {OFF_DIAGONAL:.0f}: ArduPilot's "
            "own calibration would refuse such a sensor; check it"
        )
    return remarks
