"""PX4's TC_Mn_*: what the bias of a magnetometer does over temperature.

    TC(T) = X0 + X1 d + X2 d² + X3 d³,   gauss, sensor axes,   d = T − TREF, T within TMIN…TMAX

Source: PX4/PX4-Autopilot, src/modules/temperature_compensation, TemperatureCompensation.cpp
(`calc_thermal_offsets_3D`: an offset to be subtracted, no scale, renewed after a change of 1 °C)
and temperature_calibration/mag.cpp (`finish_sensor_instance`: X0 is zero, so that CAL_MAGn_*OFF is
the bias at TREF). With X0 zero the vehicle is right at TREF whether or not TC counts.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import chebpts1

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.exports.fixed_temperature import LEVELS, compute_remainder, describe_lag, require_within
from agonic.exports.polynomials import evaluate_affine, find_range_C
from agonic.units import NANOTESLA_PER

THERMAL = "TC_M_ENABLE"
STEP_C = 1.0
"""PX4 renews the offset where the temperature has changed by more than this."""
ORDERS = np.array([[1.0], [2.0], [3.0]])


def choose_reference_C(calibration: Calibration, temperature_C: float | None) -> float:
    """TREF: the temperature given, or the middle of the range."""
    low, high = find_range_C(calibration)
    if temperature_C is None:
        return float(np.clip(round((low + high) / 2, 1), low, high))
    require_within(calibration, temperature_C)
    return float(temperature_C)


def compute_thermal_parameters(
    calibration: Calibration, at: float, into: Array, *, slot: int
) -> tuple[dict[str, float | int], tuple[str, ...]]:
    """TC_M_ENABLE and TC_Mn_* but for the ID, and what they leave in the field.

    Parameters: `at` is TREF; `into` (3, 3) turns the axes of the readings into sensor axes.
    """
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
    found = np.linalg.lstsq((d / reach)[:, None] ** ORDERS.T, moved, rcond=None)[0]
    return np.asarray(found / reach**ORDERS)


def _describe_lost(calibration: Calibration, at: float, cubic: Array) -> tuple[str, ...]:
    """What PX4 cannot hold of a calibration over temperature, in numbers."""
    start, _, _ = evaluate_affine(calibration, at)
    left = compute_remainder(
        calibration, at, bias_at=lambda t: start + (t[:, None] - at) ** ORDERS.T @ cubic
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
