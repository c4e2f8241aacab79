"""ArduPilot: a `.param` file with the COMPASS_* parameters of one compass.

    field = M (SCALE (raw + OFS)) + MOT x,   milligauss, body axes,   M of DIA and ODI

Source: ArduPilot/ardupilot, libraries/AP_Compass/AP_Compass_Backend.cpp (`correct_field`) and
AP_Compass.cpp (`have_scale_factor`). OFS is added, so it is minus the bias; MOT is added last, so
it is minus the matrix times what a unit of x adds to the readings. x is the battery's current in A
(COMPASS_MOTCT 2) or the throttle 0…1 (1), one kind for all compasses. Each motor of the first
compass: see `ardupilot_motors`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.exports.ardupilot_motors import (
    ASK_VOLTAGE,
    about_motors,
    compute_motor_parameters,
    find_motor_terms,
)
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import (
    Export,
    find_source_term,
    find_turn_inside,
    hold_sources,
    take_symmetric,
)
from agonic.exports.fixed_temperature import hold_temperature
from agonic.logs.ardupilot.parameters import LARGEST_SCALE
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.units import NANOTESLA_PER

LARGEST_OFFSET = 1800.0  # COMPASS_OFFS_MAX as delivered, mG, of the vector's length
DIAGONAL = (0.2, 5.0)  # CompassCalibrator.cpp: what the on-board calibration accepts
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
        _tell_orientation(parameters),
    )
    lines = [f"# {note}" for note in notes]
    lines += [f"{name},{format_float32(value)}" for name, value in parameters.items()]
    written = write_atomically(path, "\n".join(lines) + "\n")
    return Export(path=written, target="ardupilot", warnings=warnings)


def compute_ardupilot_parameters(
    calibration: Calibration,
    *,
    compass: int = 1,
    rotation_bm: Rotation | None = None,
    voltage_V: float | None = None,
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The parameters by name, and warnings; SCALE = trace(matrix)/3, DIA and ODI the rest.

    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3) * 1.1, frame_in="b", frame_out="b")
    >>> parameters, _ = compute_ardupilot_parameters(mag)
    >>> parameters["COMPASS_OFS_X"], round(parameters["COMPASS_SCALE"], 9)
    (-30.0, 1.1)
    """
    turn_bm, angles = find_turn_inside(calibration, rotation_bm)
    oriented: dict[str, float] = {}
    if angles is not None and compass in CUSTOM:
        rotation_bm, oriented = turn_bm, _orient(angles, compass)
    motors = find_motor_terms(calibration, rotation_bm=rotation_bm) if compass == 1 else None
    if motors is not None and voltage_V is not None:
        if not 1.0 <= voltage_V <= 100.0:
            raise AgonicError(f"a battery of {voltage_V:g} V is none; give its voltage in flight")
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
        parameters |= dict(zip(motor_names(compass), motor.tolist(), strict=True))
        parameters["COMPASS_MOTCT"] = float(MOTOR_KIND[source])
        warnings += (
            f"COMPASS_MOTCT {MOTOR_KIND[source]} holds for all compasses of the vehicle: their "
            f"COMPASS_MOT must all be for {source}, and zero where a compass has none",
        )
    return parameters, (*warnings, *_remarks(offset, six / scale))


def _tell_orientation(parameters: dict[str, float]) -> str:
    if "CUST_ROT_ENABLE" not in parameters:
        return "The numbers hold for the present compass orientation only."
    return (
        "COMPASS_ORIENT and CUST_ROT turn readings that are logged in the sensor's own axes "
        "(ArduPilot 4.2 or later); restart twice, for CUST_ROT_ENABLE shows the others."
    )


def ardupilot_names(compass: int) -> list[str]:
    """OFS x y z, DIA x y z, ODI x y z (= xy, xz, yz), SCALE; the first compass has no number."""
    if compass not in (1, 2, 3):
        raise AgonicError(f"compass is 1, 2 or 3 in ArduPilot, not {compass}")
    number = "" if compass == 1 else str(compass)
    vectors = [f"COMPASS_{kind}{number}_{axis}" for kind in ("OFS", "DIA", "ODI") for axis in "XYZ"]
    return [*vectors, f"COMPASS_SCALE{number}"]


def _orient(angles: Array, compass: int) -> dict[str, float]:
    """The parameters of a compass that sits at any angle: roll, pitch and yaw (3,), degrees."""
    rotation, slot = CUSTOM[compass]
    number = "" if compass == 1 else str(compass)
    named = zip(("ROLL", "PITCH", "YAW"), angles.tolist(), strict=True)
    return {
        f"COMPASS_ORIENT{number}": float(rotation),
        "CUST_ROT_ENABLE": 1.0,
        **{f"CUST_ROT{slot}_{name}": angle for name, angle in named},
    }


def motor_names(compass: int) -> list[str]:
    return [f"COMPASS_MOT{'' if compass == 1 else compass}_{axis}" for axis in "XYZ"]


def _remarks(offset: Array, six: Array) -> list[str]:
    """What the vehicle may object to."""
    remarks = []
    length = float(np.linalg.norm(offset))
    if length > LARGEST_OFFSET:
        remarks.append(
            f"offsets of {length:.0f} mG exceed COMPASS_OFFS_MAX ({LARGEST_OFFSET:.0f}): the "
            "vehicle will not arm; move the sensor away from metal or raise that limit"
        )
    smallest, largest = DIAGONAL
    if six[:3].min() < smallest or six[:3].max() > largest or np.abs(six[3:]).max() >= OFF_DIAGONAL:
        remarks.append(
            f"DIA outside {smallest} to {largest} or ODI beyond {OFF_DIAGONAL:.0f}: ArduPilot's "
            "own calibration would refuse such a sensor; check it"
        )
    return remarks
