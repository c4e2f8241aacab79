"""What an ArduPilot compass measured, from the corrected readings that its log holds.

    field = M · s · (raw + OFS) + MO        raw = (M s)⁻¹ · (field − MO) − OFS

in milligauss and body axes. OFS and the motor part MO stand beside each reading; the symmetric M
(DIA, ODI) and the scale s come from the COMPASS_* parameters in force at that reading. Source:
ArduPilot, libraries/AP_Compass/AP_Compass_Backend.cpp (correct_field) and LogStructure.h.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.ardupilot.dataflash_binary import Index, Table
from agonic.logs.log import Readings
from agonic.maths.equation.affine import correct
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.samples import Logged
from agonic.units import NANOTESLA_PER

LARGEST_SCALE = 1.5
"""COMPASS_MAX_SCALE_FACTOR: outside 1/1.5…1.5 the firmware takes 1."""
LARGEST_ENTRY, SMALLEST_DETERMINANT = 100.0, 1e-3
"""Beyond these, parameters are damage: the on-board fit takes diagonals of 0.2…5 only."""

AXES = "XYZ"


def remove_correction(mag: Table, parameters: Table, slot: str) -> Readings:
    """Take the correction out of the readings of one compass. `mag` has its messages, `parameters`
    the PARM messages, and `slot` is the number in the parameter names: "" for the first compass,
    then "2" and "3"."""
    field = _stack_vector(mag, ("Mag",))
    if field is None:
        raise LogError("the MAG messages name no MagX, MagY and MagZ; fetch the log again")
    motor = _stack_vector(mag, ("MO", "MOfs"))
    if motor is None:
        motor = np.zeros_like(field)
    names = [f"COMPASS_OFS{slot}_{axis}" for axis in AXES]
    offset = np.stack([look_up(parameters, n, mag.position) for n in names], axis=1)
    if (coarse := _stack_vector(mag, ("Ofs",))) is not None:  # of which it holds whole milligauss
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
    """The matrices M s (k, 3, 3) in force one after the other, and the row where each begins."""
    vectors = (f"COMPASS_{part}{slot}_{axis}" for part in ("DIA", "ODI") for axis in AXES)
    names = (*vectors, f"COMPASS_SCALE{slot}")
    values = np.stack([look_up(parameters, name, at) for name in names], axis=1)
    values = np.where(np.abs(values) < LARGEST_ENTRY, values, 0.0)
    starts = np.flatnonzero((np.diff(values, axis=0, prepend=np.nan) != 0).any(axis=1))
    matrices = []
    for *six, scale in values[starts]:
        matrix = unpack_symmetric(six) if any(six[:3]) else np.eye(3)  # without, there is no M
        if abs(np.linalg.det(matrix)) < SMALLEST_DETERMINANT:
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


def _stack_vector(mag: Table, stems: tuple[str, ...]) -> Array | None:
    columns = [c for axis in AXES if (c := mag.get(*(stem + axis for stem in stems))) is not None]
    return np.stack(columns, axis=1) if len(columns) == len(AXES) else None


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
