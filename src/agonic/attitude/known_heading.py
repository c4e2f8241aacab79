"""What is known of a heading: whether the column of a log is what it should be, whether the azimuth
agrees with it, and how well the heading of the vehicle is known beside that of the sensor.

Without a known heading, a turn of the sensor about the vertical shows only while the vehicle banks
and pitches. It turns every heading by the same angle. A turn about the horizontal axes shows, but
an error of the zero of roll and pitch looks the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.coverage import OPEN_DEG, Coverage
from agonic.fit import Channel
from agonic.health import Finding, figure
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.coverage import heading_sd_deg
from agonic.maths.rotations.angles import wrap_deg

HEADING_DOUBTFUL_DEG = 5.0
HEADING_REFUSED_DEG = 20.0


def check_azimuth(
    channels: Mapping[str, Channel], radius: float, inclination_deg: float, *, felt: bool = False
) -> Finding | None:
    """The finding that the azimuth of the calibrated field scatters by too much."""
    if "azimuth" not in channels:
        return None
    level = max(radius * np.cos(np.radians(inclination_deg)), 1e-9)
    off = float(np.degrees(channels["azimuth"].noise / level))
    if off <= HEADING_DOUBTFUL_DEG:
        return None
    if felt:
        beside = "the azimuth by the gyro: its unit, axes, sign or clock are wrong"
        move = "check unit, axes and times of the gyro"
    else:
        beside = "that of the known heading: it is wrong, late, or in radians"
        move = "check the heading, its unit and its zero, or fit without it (levelled)"
    spread = f"by {figure(off)}°" if off < OPEN_DEG else "over the whole circle"
    return Finding(
        "heading",
        "refuse" if off > HEADING_REFUSED_DEG else "check",
        f"the field's azimuth scatters {spread} about {beside}",
        move,
    )


OFFSET_DOUBTFUL_DEG = 5.0
"""No sensor is misaligned about the vertical by more, unless somebody meant it to."""
MAGNETIC_WITHIN_DEG = 2.0
"""A heading that is off by the declination to this is magnetic, where the declination is larger."""
FOLLOWS = 0.9
"""Length of the mean direction of the differences: those of 26° (one standard deviation)."""
CLEARER = 0.05
"""By so much more must another reading of the column follow the field."""


def check_heading_column(
    by_field_deg: Array, logged_deg: Array, declination_deg: float
) -> Finding | None:
    """The finding that the logged heading (n,) is not the true one, with what it looks like: the
    heading by the field is sign · unit · column + offset."""
    tried = []  # how far differences are all alike, radians or not, sign and offset
    for radians in (False, True) if np.abs(logged_deg).max() <= 2 * np.pi + 0.01 else (False,):
        column = np.degrees(logged_deg) if radians else logged_deg
        for sign in (1, -1):
            mean = np.exp(1j * np.radians(by_field_deg - sign * column)).mean()
            tried.append((float(np.abs(mean)), radians, sign, float(np.degrees(np.angle(mean)))))
    best = max(tried, key=lambda one: one[0])
    follows, radians, sign, offset = best if best[0] > tried[0][0] + CLEARER else tried[0]
    if follows < FOLLOWS:
        return None  # its scatter is told, and nothing that it looks like
    said = ["in radians"] if radians else []
    if sign < 0:
        said.append("negated, counted anticlockwise")
    quarter = round(offset / 90.0) % 4
    beside, off = abs(wrap_deg(np.array([90.0 * quarter, declination_deg]) - offset)).tolist()
    if beside < 15.0 and quarter:
        origin = ("", "east", "south", "west")[quarter]
        said.append(f"counted from {origin}" + (" (off by 180°)" if quarter == 2 else ""))
    elif abs(declination_deg) > MAGNETIC_WITHIN_DEG + 1 and off < MAGNETIC_WITHIN_DEG:
        said.append(f"magnetic: it is off by the declination of {declination_deg:.0f}°")
    elif abs(offset) > OFFSET_DOUBTFUL_DEG:
        said.append(
            f"off by {figure(offset)}° throughout (magnetic, another zero, or the sensor sits "
            "turned about the vertical)"
        )
    if not said:
        return None
    return Finding(
        "mounting" if sign > 0 and not radians else "heading",  # as of a sensor that sits turned
        "check" if said[0].startswith("off by") else "refuse",
        f"the logged heading is not the true heading by the field: it looks {', '.join(said)}",
        "give the true heading in degrees, clockwise from north, or leave the column out",
    )


_PAIRS = ((6, 9), (7, 10), (8, 11))
"""xy yx, xz zx, yz zy among bias x y z, then matrix xx yy zz xy xz yz yx zx zy."""
UNSEEN_DEG = 0.5
"""A turn about the vertical that is known no better is told."""
TURN_DOUBTFUL_DEG = 2.0
"""Of the vehicle's heading: a turn that leaves more than this in doubt has to be looked at."""


class MountedHeading(NamedTuple):
    """What is known of a level heading, degrees: `own_sd_deg` whatever the sensor's turn in the
    vehicle, `vehicle_sd_deg` with that turn, of which `turn_deg` was found; `vertical_sd_deg` is
    that of the turn about the vertical, `turn_sd_deg` that of a turn which is not undone."""

    own_sd_deg: float
    vehicle_sd_deg: float
    turn_deg: float = 0.0
    vertical_sd_deg: float = 0.0
    turn_sd_deg: float = 0.0


def compute_mounted_heading(plain: Affine, coverage: Coverage) -> MountedHeading:
    """The heading's standard error without the sensor's turn in the vehicle, and with it. Without
    the turn the matrix is symmetric: with A = ∂turn/∂parameters (3, m) and B = ∂parameters/∂turn
    the covariance is (1 − B A) C (1 − B A)ᵀ. While a vehicle hardly banks, a turn and soft iron
    look alike; then its heading but for one constant angle is known better."""
    covariance, vehicle = plain.covariance, coverage.heading_sd_deg
    assert covariance is not None
    if plain.gauge != FREE or plain.magnitude is None:
        return MountedHeading(vehicle, vehicle)
    gain = float(np.trace(plain.matrix) / 3)
    turn_by, by_turn = np.zeros((3, len(covariance))), np.zeros((len(covariance), 3))
    for axis, (above, below) in enumerate(_PAIRS):
        turn_by[axis, above], turn_by[axis, below] = 0.5 / gain, -0.5 / gain
        by_turn[above, axis], by_turn[below, axis] = gain, -gain
    turn = turn_by @ covariance @ turn_by.T
    without = np.eye(len(covariance)) - by_turn @ turn_by
    at = (coverage.inclination_deg, plain.magnitude, plain.matrix)
    own = min(
        heading_sd_deg(*at, without @ covariance @ without.T, plain.gauge, down=coverage.down),
        heading_sd_deg(*at, covariance, plain.gauge, but_constant=True, down=coverage.down),
    )
    found = (plain.matrix - plain.matrix.T)[[0, 0, 1], [1, 2, 2]] / (2 * gain)
    sizes = np.degrees([np.linalg.norm(found), np.sqrt(turn[0, 0])])
    return MountedHeading(float(own), vehicle, *map(float, sizes))


def check_turned_sensor(mounted: MountedHeading, turned: bool) -> Finding | None:
    """The finding that the vehicle's heading is known less well than that of the sensor's axes."""
    own, vehicle = figure(mounted.own_sd_deg), figure(mounted.vehicle_sd_deg)
    if turned:
        if mounted.vehicle_sd_deg < max(TURN_DOUBTFUL_DEG, 1.5 * mounted.own_sd_deg):
            return None
        known = f" ± {figure(mounted.turn_sd_deg)}°" if mounted.turn_sd_deg else "°"
        return Finding(
            "turned sensor",
            "check",
            f"the sensor is misaligned by {figure(mounted.turn_deg)}{known} in the vehicle, or "
            f"its attitude is wrong by the same amount: standard error of the heading {own}° in "
            f"the sensor's own axes, {vehicle}° in the vehicle's",
            "look how the sensor sits, and set the zero of roll and pitch with the vehicle level",
        )
    if mounted.vertical_sd_deg < UNSEEN_DEG or mounted.vehicle_sd_deg < 1.5 * mounted.own_sd_deg:
        return None
    return Finding(
        "mounting about the vertical",
        "note",
        f"the verdict is for the heading of the sensor's own axes (standard error {own}°); how "
        f"the sensor is turned about the vertical is known to {figure(mounted.vertical_sd_deg)}°, "
        f"and the vehicle's heading to {vehicle}°",
        "bank and pitch more while turning, or compare with one known heading",
    )
