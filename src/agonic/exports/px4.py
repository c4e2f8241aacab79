"""PX4: a `.params` file with the CAL_MAGn_* parameters of one magnetometer.

    field_body = R S (raw + P COMP − OFF − TC(T)),   gauss, raw in sensor axes,   S of SCALE, ODIAG
    TC(T) = X1 d + X2 d² + X3 d³,   d = T − TREF, T held within TMIN and TMAX

Source: PX4/PX4-Autopilot, src/lib/sensor_calibration/Magnetometer.hpp (`Correct`) and
Magnetometer.cpp (`set_offset`, `set_scale`, `set_offdiagonal`). OFF is subtracted: it is the bias.
COMP is added before it, so it is minus what a unit of P adds to the readings. P is the throttle 0…1
(CAL_MAG_COMP_TYP 1) or the current of battery 1 or 2 in kiloamperes (2, 3), and counts while the
vehicle is armed (VehicleMagnetometer.cpp).

TC_Mn_*, what the bias does over temperature:

    TC(T) = X0 + X1 d + X2 d² + X3 d³,   gauss, sensor axes,   d = T − TREF, T within TMIN…TMAX

Source: PX4/PX4-Autopilot, src/modules/temperature_compensation, TemperatureCompensation.cpp
(`calc_thermal_offsets_3D`: an offset to be subtracted, no scale, renewed after a change of 1 °C)
and temperature_calibration/mag.cpp (`finish_sensor_instance`: X0 is zero, so that CAL_MAGn_*OFF is
the bias at TREF). With X0 zero the vehicle is right at TREF whether or not TC counts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.polynomial.chebyshev import chebpts1
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.autopilots import PX4
from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import (
    Export,
    find_source_term,
    find_turn_inside,
    find_turns,
    hold_sources,
    take_symmetric,
    write_rows,
)
from agonic.exports.temperature import (
    LEVELS,
    changes_with_temperature,
    compute_remainder,
    describe_lag,
    evaluate_affine,
    find_range_C,
    hold_temperature,
    require_within,
)
from agonic.units import NANOTESLA_PER

THERMAL = "TC_M_ENABLE"
STEP_C = 1.0
"""PX4 renews the offset where the temperature has changed by more than this."""
CUBIC_ORDERS = np.array([[1.0], [2.0], [3.0]])


def compute_thermal_parameters(
    calibration: Calibration, at: float, into: Array, *, slot: int
) -> tuple[dict[str, float | int], tuple[str, ...]]:
    """TC_M_ENABLE and TC_Mn_* but for the ID, and what they leave in the field."""
    require_within(calibration, at)
    cubic = _fit_cubic(calibration, at)
    terms = np.vstack([np.zeros(3), cubic @ into.T]) / NANOTESLA_PER["G"]
    values = (*terms.ravel().tolist(), at, *find_range_C(calibration))
    return {THERMAL: 1, **dict(zip(thermal_names(slot), values, strict=True))}, _describe_lost(
        calibration, at, cubic
    )


def thermal_names(slot: int) -> list[str]:
    """X0 x y z, X1 …, X3 …, then TREF, TMIN, TMAX."""
    terms = [f"X{k}_{axis}" for k in range(4) for axis in range(3)]
    return [f"TC_M{slot}_{name}" for name in (*terms, "TREF", "TMIN", "TMAX")]


def _fit_cubic(calibration: Calibration, at: float) -> Array:
    """The coefficients (3, 3) of d, d², d³ of the bias by least squares: exact to third order."""
    low, high = find_range_C(calibration)
    d = (low + high) / 2 + (high - low) / 2 * chebpts1(48) - at
    moved = evaluate_affine(calibration, at + d)[0] - evaluate_affine(calibration, at)[0]
    reach = max(high - at, at - low, STEP_C)  # scaled for the conditioning
    found = np.linalg.lstsq((d / reach)[:, None] ** CUBIC_ORDERS.T, moved, rcond=None)[0]
    return np.asarray(found / reach**CUBIC_ORDERS)


def _describe_lost(calibration: Calibration, at: float, cubic: Array) -> tuple[str, ...]:
    """What PX4 cannot hold of a calibration over temperature, in numbers."""
    start, _, _ = evaluate_affine(calibration, at)
    left = compute_remainder(
        calibration, at, bias_at=lambda t: start + (t[:, None] - at) ** CUBIC_ORDERS.T @ cubic
    )
    return (
        f"PX4 holds the matrix of one temperature, here {at:.4g} C, and a cubic for the bias: "
        f"{left}",
        f"PX4 renews the thermal offset only after a change of {STEP_C:g} C: up to "
        f"{_stale(calibration):.2g} {calibration.unit_out} more meanwhile",
        "TC_M needs PX4 1.15 or later, and in the copies of its source that were read for this "
        "Correct in Magnetometer.hpp does not subtract the thermal offset: compare "
        "vehicle_magnetometer with sensor_mag in a cold and a warm log of yours. Where it is not "
        f"subtracted, the file holds for {at:.4g} C: {compute_remainder(calibration, at)}",
        *describe_lag(calibration),
    )


def _stale(calibration: Calibration) -> float:
    """How far the field goes astray while PX4 waits for a change of temperature."""
    low, high = find_range_C(calibration)
    if not high > low:
        return 0.0
    levels = np.linspace(low, high, LEVELS)
    bias, matrix, _ = evaluate_affine(calibration, levels)
    slope = np.gradient(bias, levels, axis=0)
    moved = np.einsum("nij,nj->ni", matrix, slope)
    return STEP_C * float(np.linalg.norm(moved, axis=1).max())


DEAD_BAND = 0.01
"""A change (length of the vector) that PX4 does not take over: gauss for OFF, else a number."""

SCALE_LIMITS = (0.1, 3.0)  # limits of CAL_MAGn_*SCALE in src/modules/sensors/module.yaml
POWER = "CAL_MAG_COMP_TYP"
POWER_KIND = {"throttle": (1, 1.0), "current_A": (2, 1000.0), "battery2_A": (3, 1000.0)}
"""Of what PX4 takes as P the value of `POWER`, and how much of it is a unit of P."""


def write_px4(
    calibration: Calibration,
    path: Path | str,
    *,
    slot: int = 0,
    device_id: int | None = None,
    rotation: int | None = None,
    rotation_bm: Rotation | None = None,
    temperature_C: float | None = None,
) -> Export:
    """Write the CAL_MAGn_* parameters that make PX4 apply a calibration.

    Parameters
    ----------
    calibration, path : what is written, and where.
    slot : n, 0 to 3.
    device_id : CAL_MAGn_ID, `sensor_mag.device_id` of the log; PX4 ignores a slot without it.
    rotation : CAL_MAGn_ROT, written where it is given: −1 for an internal sensor.
    rotation_bm : turns sensor axes into body axes, as PX4 does after the correction; only needed
        for a calibration in body axes.
    temperature_C : TC_Mn_TREF, at which the matrix is taken, for a calibration that changes with
        temperature; default: the middle of its range.

    Such a calibration gives TC_Mn_* as well, the bias over temperature as a cubic. What the matrix
    does over temperature has no place in PX4: a warning says how much that leaves in the field.

    Raises `UnitError` for a calibration in raw units, and `AgonicError` for one that mixes two
    magnetometers or takes both current and throttle. Power compensation is written where the
    calibration has a term for one of them, else left as it is in the vehicle.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3) * 1.1)
    >>> with TemporaryDirectory() as folder:
    ...     export = write_px4(mag, folder + "/mag.params", device_id=396809)
    ...     rows = export.path.read_text().splitlines()
    >>> [row.split()[2:4] for row in rows if "XOFF" in row]
    [['CAL_MAG0_XOFF', '0.03']]
    """
    parameters, warnings = compute_px4_parameters(
        calibration,
        slot=slot,
        device_id=device_id,
        rotation=rotation,
        rotation_bm=rotation_bm,
        temperature_C=temperature_C,
    )
    power = " + P COMP" if POWER in parameters else ""
    warmth = " - TC(T)" if THERMAL in parameters else ""
    formula = (
        f"field = S (raw{power} - OFF{warmth}), gauss, sensor axes, S of SCALE and ODIAG; then "
        "CAL_MAG_ROT" + ("; TC = X1 d + X2 d^2 + X3 d^3, d = T - TREF" if warmth else "")
    )
    notes = (
        *write_banner(calibration, formula, warnings),
        "Vehicle-Id Component-Id Name Value Type",
    )
    return write_rows("px4", path, notes, (_row(*one) for one in parameters.items()), warnings)


def compute_px4_parameters(
    calibration: Calibration,
    *,
    slot: int = 0,
    device_id: int | None = None,
    rotation: int | None = None,
    rotation_bm: Rotation | None = None,
    temperature_C: float | None = None,
) -> tuple[dict[str, float | int], tuple[str, ...]]:
    """The parameters by name, and warnings."""
    if slot not in range(4):
        raise AgonicError(f"slot is 0 to 3 in PX4, not {slot}")
    turn_bm, angles = find_turn_inside(calibration, rotation_bm)
    oriented: dict[str, float | int] = {}
    if angles is not None and rotation is None:
        rotation_bm = turn_bm
        # by ROLL, PITCH and YAW: PX4 1.14 or later, lib/conversion/rotation.h
        oriented[f"CAL_MAG{slot}_ROT"] = 100
        named = zip(("ROLL", "PITCH", "YAW"), angles.tolist(), strict=True)
        oriented |= {f"CAL_MAG{slot}_{name}": angle for name, angle in named}
    thermal: dict[str, float | int] = {}
    lost: tuple[str, ...] = ()
    if changes_with_temperature(calibration):
        if temperature_C is None:  # the middle of the range
            low, high = find_range_C(calibration)
            temperature_C = float(np.clip(round((low + high) / 2, 1), low, high))
        into, _, _ = find_turns(calibration, "m", rotation_bm)
        thermal, lost = compute_thermal_parameters(calibration, temperature_C, into, slot=slot)
    calibration, _ = hold_temperature(calibration, temperature_C)
    calibration, held = hold_sources(calibration, POWER_KIND)
    bias, six, warnings = take_symmetric(calibration, "m", unit="gauss", rotation_bm=rotation_bm)
    warnings += held
    offset = bias / NANOTESLA_PER["G"]
    parameters: dict[str, float | int] = {}
    unnamed: tuple[str, ...] = ()
    if device_id is None:
        which = f"CAL_MAG{slot}_ID is" if not thermal else f"CAL_MAG{slot}_ID and TC_M{slot}_ID are"
        unnamed = (
            f"PX4 ignores slot {slot} unless {which} the sensor's device id: give device_id "
            "(sensor_mag.device_id in the log)",
        )
    else:
        parameters[f"CAL_MAG{slot}_ID"] = _as_int32(int(device_id))
        if thermal:
            thermal[f"TC_M{slot}_ID"] = parameters[f"CAL_MAG{slot}_ID"]
    if rotation is not None:
        parameters[f"CAL_MAG{slot}_ROT"] = int(rotation)
    parameters |= oriented
    parameters |= dict(
        zip(PX4.names(slot + 1, *PX4.parts[:3]), map(float, (*offset, *six)), strict=True)
    )
    power, said = _compute_power(calibration, rotation_bm, slot)
    parameters |= power | thermal
    return parameters, (*warnings, *said, *unnamed, *lost, *_remarks(offset, six))


def _compute_power(
    calibration: Calibration, rotation_bm: Rotation | None, slot: int
) -> tuple[dict[str, float | int], tuple[str, ...]]:
    """What takes out the field of a current or the throttle, and what to know of it."""
    term = find_source_term(calibration, "m", rotation_bm=rotation_bm)
    if term is None:
        return {}, ()
    source, added = term
    kind, unit = POWER_KIND[source]
    comp = -added * unit / NANOTESLA_PER["G"]
    warning = (
        f"{POWER} {kind} holds for all magnetometers of the vehicle"
        + (" and means battery 1; set 3 where battery 2 was recorded" if kind == 2 else "")
        + ". PX4 compensates while armed only"
    )
    named = zip(PX4.names(slot + 1, "COMP"), comp.tolist(), strict=True)
    return {**dict(named), POWER: kind}, (warning,)


def _row(name: str, value: float | int) -> str:
    if isinstance(value, int):
        return f"1\t1\t{name}\t{value}\t6"  # MAV_PARAM_TYPE
    return f"1\t1\t{name}\t{format_float32(value)}\t9"


def _as_int32(device_id: int) -> int:
    """The device id, an unsigned number in the log, in a parameter's signed 32 bits."""
    if not 0 < device_id < 2**32:
        raise AgonicError(f"a device id is a number from 1 to 2^32 - 1, not {device_id}")
    return device_id - 2**32 if device_id >= 2**31 else device_id


def _remarks(offset: Array, six: Array) -> list[str]:
    """What PX4 may not take over."""
    remarks = []
    changes = {"offset": offset, "scale": six[:3] - 1.0, "off-diagonal": six[3:]}
    for what, vector in changes.items():
        length = float(np.linalg.norm(vector))
        if 1e-6 < length <= DEAD_BAND:
            unit = " G" if what == "offset" else ""
            remarks.append(
                f"the {what} correction of {length:.4f}{unit} is below the {DEAD_BAND}{unit} that "
                "PX4 needs to take it over after a start: it may be ignored"
            )
    smallest, largest = SCALE_LIMITS
    if six[:3].min() < smallest or six[:3].max() > largest:
        remarks.append(
            f"a scale outside {smallest} to {largest} is beyond PX4's limits; check the sensor's "
            "unit"
        )
    return [
        *remarks,
        "set SENS_MAG_AUTOCAL 0, else PX4 changes these offsets after each flight by its own "
        "estimate",
    ]
