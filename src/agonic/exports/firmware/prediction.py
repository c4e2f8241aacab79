"""What the generated C must give: the same chain in double precision, from the parts themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask
from agonic.exports.firmware.grid import DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.maths.rotations import tilt as kernel
from agonic.units import RAW, STANDARD_GRAVITY_M_S2, WEAKEST_HORIZONTAL

Flags = NDArray[np.int64]


class Status(IntFlag):
    """Why a heading is not to be trusted, bit by bit, as in the header."""

    DISTURBED, STEEP, VERTICAL, OUTSIDE, ACCELERATED, TEMPERATURE = (1 << k for k in range(6))


MEMBERS = {"temperature": "temperature_C", "temperature_rate": "temperature_rate_C_s"}
"""The member of the C input for a column of samples, where their names differ."""
OF_EACH = ("second", *MEMBERS)
"""Columns of which the input has one for each magnetometer."""
GRAVITY_SHARE = 0.05
"""A specific force this much off gravity is more than a poor accelerometer reads at rest."""
MAX_DISTANCE = 3e38
CHOICE_SHARE = 0.99
"""Of the disturbance of one compass for another to be chosen over it, so that rounding never is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """The outputs of the firmware, a row for each input: (n,) and field (n, 3)."""

    field: Array
    magnitude: Array
    inclination_deg: Array
    compass_deg: Array
    magnetic_deg: Array
    declination_deg: Array
    true_deg: Array
    disturbance: Array
    used: NDArray[np.int64]
    status: Flags


def predict(plan: Plan, inputs: Mapping[str, Array]) -> Prediction:
    """The outputs for inputs as `compass_heading` takes them, raw and second (n, k, 3)."""
    each = [predict_one(plan, which, inputs) for which in range(len(plan.calibrations))]
    distance = np.array([one.disturbance for one in each])
    used = choose_compasses(distance)
    rows = np.arange(len(used))
    return Prediction(
        **{
            f.name: np.array([getattr(one, f.name) for one in each])[used, rows]
            for f in fields(Prediction)
        }
    )


def choose_compasses(distance: Array) -> NDArray[np.int64]:
    """The first compass that is not disturbed, or the least disturbed of `distance` (k, n):
    (n,)."""
    used = np.zeros(distance.shape[1], dtype=np.int64)
    for which in range(1, len(distance)):
        best = distance[used, np.arange(len(used))]
        better = (distance[which] <= 1) | (distance[which] < CHOICE_SHARE * best)
        used[(best > 1) & better] = which
    return used


def predict_one(plan: Plan, which: int, inputs: Mapping[str, Array]) -> Prediction:
    """The outputs by one of the compasses."""
    card = plan.cards[which]
    field = correct_readings(plan, which, inputs["raw"][:, which], inputs)
    tilt, status = compute_tilt(plan, inputs, len(field))
    if plan.warm:
        status |= np.where(_follow(plan, which, inputs)[1], 0, Status.TEMPERATURE)
    level = kernel.heading_with_derivatives(field, tilt, plan.order)
    heading = level.heading_deg
    magnitude = np.linalg.norm(field, axis=1)
    inclination = np.degrees(np.arctan2(level.vertical, level.horizontal))
    strength = level.horizontal if plan.tilt == "level" else magnitude
    distance = compute_disturbance(plan, which, strength, inclination)
    status |= np.where(distance <= 1, 0, Status.DISTURBED)
    status |= np.where(level.horizontal >= find_weakest(plan), 0, Status.VERTICAL)
    magnetic = heading if card is None else card.magnetic(heading, *kernel.roll_pitch_deg(tilt))
    if isinstance(plan.declination, DeclinationGrid):
        declination, outside = plan.declination.at(inputs["latitude_deg"], inputs["longitude_deg"])
        status |= np.where(outside, Status.OUTSIDE, 0)
    else:
        declination = np.full(len(field), plan.declination)
    return Prediction(
        field=field,
        magnitude=magnitude,
        inclination_deg=inclination,
        compass_deg=heading,
        magnetic_deg=magnetic,
        declination_deg=declination,
        true_deg=(magnetic + declination) % 360.0,
        disturbance=distance,
        used=np.full(len(field), which),
        status=status,
    )


def correct_readings(plan: Plan, which: int, raw: Array, inputs: Mapping[str, Array]) -> Array:
    """The field (n, 3) of readings (n, 3) of one compass, with what is beside them."""
    calibration = plan.setup.compasses[which].calibration
    columns = {name: inputs[MEMBERS.get(name, name)] for name in calibration.needs}
    columns |= {name: columns[name][:, which] for name in OF_EACH if name in columns}
    if "temperature" in columns:
        columns["temperature"] = _follow(plan, which, inputs)[0]
    return calibration.correct(raw, **columns)


def _follow(plan: Plan, which: int, inputs: Mapping[str, Array]) -> tuple[Array, Mask]:
    """The temperature that counts, and where it is the one that was given."""
    low, high = plan.polynomials[which].clamp_C
    given = inputs["temperature_C"][:, which]
    inside = (given >= low) & (given <= high)
    return np.where(inside, given, np.where(given > high, high, low)), inside


def compute_tilt(plan: Plan, inputs: Mapping[str, Array], n: int) -> tuple[kernel.Tilt, Flags]:
    """The tilt of each row from what the controller is given, and where it is not to be trusted."""
    status = np.zeros(n, dtype=np.int64)
    if plan.tilt == "level":
        return kernel.tilt_from_angles(np.zeros(n), np.zeros(n)), status
    if plan.tilt == "acceleration":
        force = inputs["acceleration"]
        if plan.accelerometer is not None:
            force = plan.accelerometer.correct(force)
        share = np.linalg.norm(force, axis=1) / STANDARD_GRAVITY_M_S2 - 1
        tilt = kernel.tilt_from_down(kernel.down_from_force(force))
        status |= np.where(np.abs(share) <= GRAVITY_SHARE, 0, Status.ACCELERATED)
    else:
        tilt = kernel.tilt_from_angles(inputs["roll_deg"], inputs["pitch_deg"])
    upright = tilt.cos_roll * tilt.cos_pitch  # cosine between down and the body's own down
    return tilt, status | np.where(upright >= plan.steepest, 0, Status.STEEP)


def compute_disturbance(plan: Plan, which: int, strength: Array, inclination_deg: Array) -> Array:
    """How far the field is from the one to expect, 1 being the limit; 0 where none is known."""
    expected, setup = plan.expected[which], plan.setup
    distance = np.zeros(len(strength))
    if plan.dip is not None:
        distance = np.abs(inclination_deg - np.degrees(plan.dip)) / max(setup.dip_limit_deg, 1e-12)
    if expected is not None:
        off = np.abs(strength / expected - 1) / max(setup.magnitude_limit, 1e-12)
        distance = np.maximum(distance, off)
    return np.where(distance <= MAX_DISTANCE, distance, MAX_DISTANCE)


def find_weakest(plan: Plan) -> float:
    """The least horizontal field; none where a calibration has no scale."""
    raw = any(calibration.unit_out == RAW for calibration in plan.calibrations)
    return 0.0 if raw else WEAKEST_HORIZONTAL
