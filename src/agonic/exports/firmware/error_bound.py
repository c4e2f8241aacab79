"""How far the heading of the C may be from exact arithmetic: an affine error analysis.

Every operation of the C in the order of the C, each rounded by u = 2⁻²⁴ of its result at most.
Errors are followed as lengths of vectors: what turns a vector does not lengthen its error, and a
row of a matrix meets it by Cauchy and Schwarz. The constants' own roundings are taken as they are.
What holds where the status is 0, so for fields within the limits of the setup:

    Δψ ≤ E/h + what atan2, the deviation and the sums of degrees round,   h the least level field

Source: N. J. Higham (2002), Accuracy and Stability of Numerical Algorithms, SIAM, chapters 2 and 3.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.exports.firmware.grid import DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import GRAVITY_SHARE, find_weakest
from agonic.units import STANDARD_GRAVITY_M_S2

ROUNDOFF = 2.0**-24
"""Half a unit in the last place of 1, float32."""
DEGREES = 57.2957795
"""As the C has it."""
ULPS = 2.0
"""Units in the last place by which sinf, cosf and atan2f of a library may be off: those of glibc
and newlib by less than one (Zimmermann et al., Accuracy of Mathematical Functions, 2024)."""
_WHOLE = 2.0**-16  # half a unit in the last place of 256 to 512 degrees
_PI_UNIT = 2.0**-22  # a unit in the last place of 2 to 4


def compute_error_bound_deg(plan: Plan) -> float | None:
    """The most by which `true_deg` of the C differs from exact arithmetic where the status is 0.

    For every input of roll within 180° and pitch within 90°. `None` where a calibration follows the
    temperature or takes signals out, whose sizes a setup does not limit, or where no strength is
    known that the status is about.
    """
    if plan.warm or plan.sources or any(size is None for size in plan.expected):
        return None
    compass = max(_bound_compass_rad(plan, which) for which in range(len(plan.calibrations)))
    compass_deg = np.degrees(compass) + _WHOLE  # brought to 0 to 360
    magnetic = max(_add_deviation(plan, which, compass_deg) for which in range(len(plan.cards)))
    return magnetic + _bound_declination_deg(plan)


def _bound_sum_deg(added_deg: float) -> float:
    """Of a heading of 0 to 360° to which so much is added, brought back to 0 to 360°. Taking 360
    off is exact; adding it rounds, after a sum that is no larger than what was added."""
    beyond = 2.0 if 360.0 + added_deg >= 512.0 else 1.0
    return float(max(beyond * _WHOLE, _WHOLE + ROUNDOFF * added_deg))


def _bound_compass_rad(plan: Plan, which: int) -> float:
    """Of the angle of the level field, rad, before it is brought into a circle."""
    strength, level = _find_domain(plan, which)
    own = _bound_product(plan.calibrations[which], strength)
    turned, short = _bound_levelling(plan)
    units = own / strength + turned
    return float(
        units * (strength / level) / short + ULPS * _PI_UNIT + np.pi * (_of_degrees() + ROUNDOFF)
    )


def _find_domain(plan: Plan, which: int) -> tuple[float, float]:
    """The strength that the status allows, and the least level part of such a field."""
    expected = plan.expected[which]
    assert expected is not None
    strength = expected * (1.0 + plan.setup.magnitude_limit)
    weakest = find_weakest(plan)
    if plan.tilt == "level":
        least = max(expected * (1.0 - plan.setup.magnitude_limit), weakest)
        # a level compass knows the level part; the rest is up to three times that, or twice the
        # setup's
        vertical = plan.setup.vertical
        most = 3.0 * strength if vertical is None else 2.0 * abs(vertical)
        return float(np.hypot(strength, most)), least
    if plan.dip is None:
        return strength, weakest
    steepest = min(abs(plan.dip) + np.radians(plan.setup.dip_limit_deg), np.pi / 2)
    share = float(np.cos(steepest))
    return strength, max(strength * share, weakest)


def _bound_product(calibration: Affine, size: float) -> float:
    """Of matrix (raw − bias), by length, for results of such a length, in their unit. The
    difference rounds once, the products once, the sums twice."""
    exact, bias = calibration.matrix, calibration.bias
    inverse = float(np.linalg.norm(np.linalg.inv(exact), 2))
    reach = float(np.linalg.norm(np.abs(exact), 2))
    difference = np.linalg.norm(_lose(bias)) + ROUNDOFF * inverse * size
    lost = float(np.linalg.norm(np.abs(_lose(exact)), 2)) * inverse * size
    return float(reach * (difference + 3 * ROUNDOFF * inverse * size) + lost)


def _lose(values: Array) -> Array:
    """What constants lose in float32."""
    return np.asarray(values - values.astype(np.float32))


def _of_degrees() -> float:
    """Relative error of the constant of the C."""
    return abs(float(np.float32(DEGREES)) * np.pi / 180.0 - 1.0)


def _bound_levelling(plan: Plan) -> tuple[float, float]:
    """Of the level field over the strength; and by how much the C's is shorter than the field."""
    if plan.tilt == "level":
        return 0.0, 1.0
    if plan.tilt == "angles":
        tilted = np.radians(plan.setup.tilt_limit_deg)
        angle = (
            2 * tilted * (_of_degrees() + ROUNDOFF)
        )  # roll and pitch turn the field by their errors
        # of a sum of two products with sine and cosine: both functions, products and the sum
        pair = (2**0.5 * ULPS + 2) * ROUNDOFF
        return float(angle + np.hypot(2 * pair, pair)), 1.0
    gravity = STANDARD_GRAVITY_M_S2
    force = 0.0
    if plan.accelerometer is not None:
        most = gravity * (1 + GRAVITY_SHARE)
        force = _bound_product(plan.accelerometer, most) / (gravity * (1 - GRAVITY_SHARE))
    down = force + 5 * ROUNDOFF  # squares, two sums, root, quotient
    vertical = down + 3 * ROUNDOFF
    north = vertical + down + 2 * ROUNDOFF
    east = 2**0.5 * down + 2 * ROUNDOFF
    return float(np.hypot(north, east)), plan.steepest


def _add_deviation(plan: Plan, which: int, compass_deg: float) -> float:
    """Of the magnetic heading, degrees."""
    table = plan.deviations
    if table is None:
        return compass_deg + _WHOLE  # the same once more
    terms = np.abs(table[which, :5])
    heel = np.abs(table[which, 5:]) * (plan.setup.tilt_limit_deg if plan.heeled else 0.0)
    once = np.hypot(terms[1], terms[2]) + np.hypot(heel[0], heel[1]) + np.hypot(heel[2], heel[3])
    slope = np.radians(once + 2 * np.hypot(terms[3], terms[4]))
    angle = 2 * np.pi * (_of_degrees() + ROUNDOFF)
    # sine and cosine, products up to three, sums up to six
    rounded = (2 * ULPS + 9) * ROUNDOFF * (terms.sum() + heel.sum())
    heeled = np.radians(heel.sum()) * (_bound_levelling(plan)[0]) if plan.heeled else 0.0
    own = slope * np.degrees(angle) + rounded + heeled
    added = _bound_sum_deg(terms.sum() + heel.sum())
    return float(compass_deg * (1 + slope) + own + added)


def _bound_declination_deg(plan: Plan) -> float:
    """Of the declination and of adding it, degrees: a constant, or interpolated in a table."""
    grid = plan.declination
    if not isinstance(grid, DeclinationGrid):
        return abs(grid - float(np.float32(grid))) + _bound_sum_deg(abs(grid))
    most = float(np.degrees(np.abs(np.arctan2(grid.east, grid.north))).max())
    parts = (grid.north, grid.east)
    up = max(float(np.abs(np.diff(part, axis=0)).max()) for part in parts)
    along = max(float(np.abs(np.diff(part, axis=1)).max()) for part in parts)
    rows, columns = grid.north.shape
    size = max(float(np.abs(part).max()) for part in parts)
    # a place in steps: the edge and the step as constants, difference and quotient; a longitude is
    # brought into a circle first, which rounds 720 degrees
    row = 4 * ROUNDOFF * (rows + abs(grid.south) / grid.latitude_step)
    column = 4 * ROUNDOFF * (columns + abs(grid.west) / grid.longitude_step)
    column += 4 * _WHOLE / grid.longitude_step
    each = up * row + along * column + 6 * ROUNDOFF * size
    least = float(np.hypot(*parts).min())
    angle = 2**0.5 * each / least + ULPS * _PI_UNIT + np.pi * (_of_degrees() + ROUNDOFF)
    return float(np.degrees(angle)) + _bound_sum_deg(most)
