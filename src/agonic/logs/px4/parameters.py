"""What a PX4 magnetometer measured, and how the vehicle corrects it, from the log's parameters.

    field_body = R · S · (raw − OFF),   R = level · mounting

in gauss; OFF and S (SCALE, ODIAG) are of the slot CAL_MAGn whose ID is that of the sensor, the
mounting is CAL_MAGn_ROT or, for a sensor on the board itself, SENS_BOARD_ROT. Source: PX4,
src/lib/sensor_calibration/Magnetometer.hpp (Correct) and Magnetometer.cpp (ParametersUpdate).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.logs.log import Readings
from agonic.maths.equation.affine import correct
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.samples import Logged
from agonic.units import NANOTESLA_PER

Parameters = Mapping[str, Any]

SLOTS = tuple(f"CAL_MAG{n}" for n in range(4))
PRIMARY = "CAL_MAG_PRIME"
AXES = "XYZ"


def remove_correction(
    field: Array,
    parameters: Parameters,
    *,
    in_body: bool,
    device_id: int | None,
    external: bool,
) -> Readings:
    """Take out of the readings (n, 3) of one sensor, nT, what the vehicle had done to them.

    `in_body` tells a corrected topic, in body axes, from `sensor_mag`; `device_id` names the
    sensor, `None` the primary one; `external` is true for a sensor that is not on the board.
    """
    slot = find_slot(parameters, device_id)
    logged = read_correction(parameters, slot) if slot else None
    rotation_bm = read_mounting(parameters, slot, external)
    notes: tuple[str, ...] = ()
    if in_body and (logged is None or rotation_bm is None):
        unknown = "already corrected by the autopilot, in a way that the log does not tell"
        return Readings(
            field=field, rotation_bm=Rotation.identity(), notes=(unknown,), corrected=True
        )
    if in_body and rotation_bm is not None:
        field = rotation_bm.apply(field, inverse=True)
        if read_number(parameters, "CAL_MAG_COMP_TYP"):
            notes = (*notes, "the vehicle's compensation for power is still in the readings")
    if logged is not None and (in_body or is_corrected_by_driver(parameters)):
        inverse: Array = np.linalg.inv(logged.matrix).astype(np.float64)
        field = correct(field, np.zeros(3), inverse) + logged.bias
    return Readings(field=field, frame="m", rotation_bm=rotation_bm, logged=logged, notes=notes)


def find_slot(parameters: Parameters, device_id: int | None) -> str | None:
    """The slot CAL_MAGn that a sensor uses; without a device id, that of the primary sensor."""
    wanted = int(read_number(parameters, PRIMARY)) if device_id is None else device_id
    for slot in SLOTS:
        # parameters are signed, device ids in topics are not
        if wanted and (int(read_number(parameters, f"{slot}_ID")) - wanted) % 2**32 == 0:
            return slot
    return None


def read_correction(parameters: Parameters, slot: str) -> Logged | None:
    """OFF and S of a slot, or `None` where its numbers cannot be a calibration."""
    bias = np.array([read_number(parameters, f"{slot}_{axis}OFF") for axis in AXES])
    diagonal = [read_number(parameters, f"{slot}_{axis}SCALE", 1.0) for axis in AXES]
    matrix = unpack_symmetric(
        [*diagonal, *(read_number(parameters, f"{slot}_{axis}ODIAG") for axis in AXES)]
    )
    if max(np.abs(matrix).max(), np.abs(bias).max()) > 100 or abs(np.linalg.det(matrix)) < 1e-3:
        return None
    return Logged(
        bias=bias * NANOTESLA_PER["G"], matrix=matrix, source=f"{slot}_* parameters in the log"
    )


def is_corrected_by_driver(parameters: Parameters) -> bool:
    """Whether `sensor_mag` carries the correction already.

    Up to v1.11 the drivers applied it (src/lib/drivers/magnetometer/PX4Magnetometer.cpp there).
    Such logs name a primary magnetometer and know no off-diagonals; later ones the reverse.
    """
    off_diagonal = any(f"{slot}_XODIAG" in parameters for slot in SLOTS)
    return PRIMARY in parameters and not off_diagonal


def read_mounting(parameters: Parameters, slot: str | None, external: bool) -> Rotation | None:
    """The rotation from sensor to body axes where it is no more than the levelling of the board.

    Larger turns are in the log as a mere number; they give `None`.
    """
    own = read_number(parameters, f"{slot}_ROT", -1.0) if slot else 0.0 if external else -1.0
    if (read_number(parameters, "SENS_BOARD_ROT") if own < 0 else own) != 0:
        return None
    roll, pitch, yaw = (read_number(parameters, f"SENS_BOARD_{axis}_OFF") for axis in AXES)
    return Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True)


def read_number(parameters: Parameters, name: str, missing: float = 0.0) -> float:
    """A parameter as a number; `missing` where it is absent or damaged."""
    value = parameters.get(name)
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else missing
