"""The heading of the sensor's own axes, and that of the vehicle that it is mounted in.

Without a known heading, a turn of the sensor about the vertical shows only while the vehicle banks
and pitches. It turns every heading by the same angle. A turn about the horizontal axes shows, but
an error of the zero of roll and pitch looks the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.health import Finding, figure
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.coverage import heading_sd_deg

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
    """The heading's standard error without the sensor's turn in the vehicle, and with it.

    Without the turn the matrix is symmetric: with A = ∂turn/∂parameters (3, m) and
    B = ∂parameters/∂turn the covariance is (1 − B A) C (1 − B A)ᵀ. While a vehicle hardly banks, a
    turn and soft iron look alike; then its heading but for one constant angle is known better.
    """
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
    """The finding that the vehicle's heading is known less well than that of the sensor's axes.

    Parameters: `turned` where a turn was found that is more than chance.
    """
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
