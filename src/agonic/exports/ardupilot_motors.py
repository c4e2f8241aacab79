"""ArduPilot's compensation of each motor: COMPASS_PMOT*, for the first compass.

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
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.interference import Interference
from agonic.calibration.sources import parse_source
from agonic.calibration.steps import steps_of
from agonic.exports.convert import find_turns
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
    """The terms of motors 1 to 4, where all their duties count to one power, else `None`.

    Other sources are held at their average in the log; where that is not known there is no term.
    """
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
    rest = tuple(still if one is step else one for one in steps)
    whole_rest = rest[0] if len(rest) == 1 else Chain(steps=rest)
    return MotorTerms(added, powers.pop(), whole_rest, held)


def about_motors(terms: MotorTerms) -> tuple[str, ...]:
    """What to know of these parameters, and what was held."""
    held = (
        f"beside the motors the target has no terms for {', '.join(terms.held)}: held at their "
        "average in the log"
    )
    steep = (
        f"COMPASS_PMOT_EXP is {terms.power:g}, and ground stations warn beyond {USUAL_POWER:g}: "
        "set it all the same"
    )
    said = [ABOUT_MOTORS, *([held] if terms.held else [])]
    return (*said, steep) if terms.power > USUAL_POWER else tuple(said)


def compute_motor_parameters(terms: MotorTerms, matrix: Array, voltage: float) -> dict[str, float]:
    """COMPASS_PMOT* by name, from the matrix (3, 3) and the battery's voltage in the log.

    >>> from agonic.calibration.affine import Affine
    >>> still = Affine(bias=np.zeros(3), matrix=np.eye(3))
    >>> terms = MotorTerms({1: np.array([1600.0, 0.0, 0.0])}, 2.0, still, ())
    >>> compute_motor_parameters(terms, np.eye(3), 4.0)["COMPASS_PMOT1_X"]
    -1.0
    """
    parameters = {"COMPASS_PMOT_EN": 1.0, "COMPASS_PMOT_EXP": terms.power}
    for number in range(1, MOTORS + 1):
        added = matrix @ terms.added.get(number, np.zeros(3))
        values = 0.0 - added / NANOTESLA_PER["mG"] / voltage**terms.power
        names = [f"COMPASS_PMOT{number}_{axis}" for axis in "XYZ"]
        parameters |= dict(zip(names, values.tolist(), strict=True))
    return parameters
