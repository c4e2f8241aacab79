"""A quaternion beside the readings, as roll, pitch and, where its axes are known, heading.

The order of the components is stated by their names. Whether the quaternion turns sensor axes into
those of the world or the reverse, and whether the world's z points up or down, is seen from the
accelerometer, which must show gravity along that z. Roll, pitch and heading are those that turn
components in the sensor's own axes x, y, z, as if they were forward, right, down, into north, east,
down: a sensor lying face up has a roll of 180°.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array

ENU = "enu"
"""The unit of a quaternion that is documented to turn sensor axes into east, north, up."""

_LEAST_SHARE = 0.9
"""Median share of gravity along the vertical of the right axes."""
_CLEARLY = 0.7
_LEVEL = 0.05
"""Below this tilt the quaternion and its inverse say the same of up, to a few degrees."""

_NED_FROM_ENU = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def compute_attitude_deg(
    quat_wxyz: Array, acceleration: Array | None, axes: str | None
) -> tuple[dict[str, Array], str]:
    """Roll and pitch (n,), and heading where `axes` is `ENU` and gravity agrees; and a note.

    Parameters: quat_wxyz (n, 4), acceleration (n, 3) in any unit or `None`. No angles are returned
    where the axes are not known.

    >>> lying = np.array([[1.0, 0.0, 0.0, 0.0]])
    >>> angles, _ = compute_attitude_deg(lying, np.array([[0.0, 0.0, 9.8]]), ENU)
    >>> {name: np.abs(values.round(9)).tolist() for name, values in angles.items()}
    {'roll_deg': [180.0], 'pitch_deg': [0.0], 'heading_deg': [90.0]}
    """
    known = np.isfinite(quat_wxyz).all(axis=1) & (np.linalg.norm(quat_wxyz, axis=1) > 0.5)
    if not known.any():
        return {}, "orientation left out: it is never known"
    rotation = Rotation.from_quat(quat_wxyz[known], scalar_first=True)
    if acceleration is None:
        if axes != ENU:
            return {}, "orientation left out: without an accelerometer its axes are not known"
        inverse, down = False, False
    else:
        seen = _find_axes(rotation, acceleration[known])
        if seen is None:
            return {}, "orientation left out: the accelerometer does not show gravity along its z"
        inverse, down = seen
    world_from_sensor = rotation.inv() if inverse else rotation
    north = _NED_FROM_ENU * world_from_sensor if not down else world_from_sensor
    angles = np.full((len(quat_wxyz), 3), np.nan)
    angles[known] = north.as_euler("ZYX", degrees=True)
    found = {"roll_deg": angles[:, 2], "pitch_deg": angles[:, 1]}
    if axes == ENU and not down and not inverse:
        return found | {"heading_deg": angles[:, 0] % 360.0}, (
            "roll, pitch and heading are those of the quaternion, which turns sensor axes x, y, z "
            "into east, north, up"
        )
    return found, (
        "roll and pitch are those of the quaternion, by gravity from "
        f"{'world to sensor' if inverse else 'sensor to world'} axes with z "
        f"{'down' if down else 'up'}; its heading counts from an unknown direction and is left out"
    )


def _find_axes(rotation: Rotation, acceleration: Array) -> tuple[bool, bool] | None:
    """Whether the rotation is from world to sensor, and whether z of the world points down."""
    size = np.linalg.norm(acceleration, axis=1)
    usable = np.isfinite(size) & (size > 0)
    if not usable.any():
        return None
    up = acceleration[usable] / size[usable, None]
    turned = [turn.apply(up) for turn in (rotation[usable], rotation[usable].inv())]
    tilts = [float(np.median(np.hypot(*seen[:, :2].T))) for seen in turned]
    upward = [float(np.median(seen[:, 2])) for seen in turned]
    inverse = tilts[1] < _CLEARLY * tilts[0]
    if not inverse and not tilts[0] < _CLEARLY * tilts[1] and tilts[0] > _LEVEL:
        return None
    if abs(upward[inverse]) < _LEAST_SHARE:
        return None
    return inverse, upward[inverse] < 0
