"""What a PX4 log holds beside the magnetometer: attitude, motion, power, place and clock.

`vehicle_attitude.q` is w, x, y, z (Hamilton) and turns components in body axes (forward, right,
down) into north, east, down. Names and units of the topics: PX4-Autopilot, msg/, of any version.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.logs.clocks.clock import UNIX, UNIX_SECONDS
from agonic.logs.headers.columns import read_dialects
from agonic.logs.rows import tracks
from agonic.logs.rows.auxiliary import ATTITUDE

GPS = ("vehicle_gps_position[0]", "sensor_gps[0]")
BESIDE: tuple[str, ...] = tuple(read_dialects()["beside"]["PX4"]["topics"].split())
"""The topics that are read."""


def list_tracks(
    topics: tracks.Tables, time: Array, rotation_bm: Rotation | None
) -> Iterator[tracks.Track]:
    """Attitude, motion, power and place, as recorded beside a magnetometer with these times.
    Acceleration and rotation rate are logged in body axes; they are turned into those of the
    magnetometer, and left out where the turn is not known."""
    quantities = (*_list_attitude(topics), *tracks.list_quantities("PX4", topics))
    for name, topic, values in (*quantities, *_list_batteries(topics)):
        if values.ndim > 1:
            if rotation_bm is None:
                continue
            values = rotation_bm.apply(values, inverse=True)
        assert topic.time_s is not None
        yield tracks.Track(name, topic.time_s, values, time)


def _list_attitude(topics: tracks.Tables) -> Iterator[tracks.Quantity]:
    """Roll, pitch and heading; the throttle as the length of the thrust, where none is logged."""
    attitude, thrust = topics.get("vehicle_attitude[0]"), topics.get("vehicle_thrust_setpoint[0]")
    quat = None if attitude is None else attitude.stack(*(f"q[{i}]" for i in range(4)))
    if attitude is not None and quat is not None:
        quat = quat.astype(np.float64)
        quat[np.abs(np.linalg.norm(quat, axis=1) - 1) > 0.1] = np.nan
        for name, angle in zip(ATTITUDE, compute_euler_deg(quat), strict=True):
            yield name, attitude, angle
    force = None if thrust is None else thrust.stack("xyz[0]", "xyz[1]", "xyz[2]")
    controls = topics.get("actuator_controls_0[0]")
    logged = controls is not None and controls.get("control[3]") is not None
    if thrust is not None and force is not None and not logged:
        yield "throttle", thrust, np.linalg.norm(force.astype(np.float64), axis=1)


def _list_batteries(topics: tracks.Tables) -> Iterator[tracks.Quantity]:
    """The currents of the batteries that measure one; a negative one is unknown."""
    batteries = [topics[name] for name in sorted(topics) if name.startswith("battery_status")]
    currents = ((b, current) for b in batteries if (current := b.get("current_a")) is not None)
    measured = ((b, current.astype(np.float64)) for b, current in currents if (current > 0).any())
    for k, (battery, current) in enumerate(measured, start=1):
        name = "current_A" if k == 1 else f"battery{k}_A"
        yield name, battery, np.where(current >= 0, current, np.nan)


def list_headings(topics: tracks.Tables) -> Iterator[tracks.Candidate]:
    """What tells a heading without a magnetometer: a GPS with two antennas, the yaw by velocities.
    `heading` of the GPS is NaN where there is none; `heading_accuracy` its sd, rad. The composite
    yaw of `yaw_estimator_status` counts where `yaw_composite_valid` says so."""
    for gps in (topics[name] for name in GPS if name in topics):
        heading = gps.get("heading")
        if heading is None or not np.isfinite(heading).any():
            continue
        sd = np.degrees(gps.columns.get("heading_accuracy", np.full(len(gps), np.nan)))
        sd = np.where(sd > 0, sd, tracks.GPS_YAW_SD_DEG)
        assert gps.time_s is not None
        yield tracks.Candidate("GPS yaw", gps.time_s, np.degrees(heading.astype(np.float64)), sd)
        break
    estimator = topics.get("yaw_estimator_status[0]")
    if estimator is not None and {"yaw_composite", "yaw_variance"} <= estimator.columns.keys():
        yaw = np.degrees(estimator.columns["yaw_composite"].astype(np.float64))
        valid = estimator.columns.get("yaw_composite_valid", np.ones(len(yaw))).astype(bool)
        variance = estimator.columns["yaw_variance"].astype(np.float64)
        sd = np.degrees(np.sqrt(np.abs(variance)))
        assert estimator.time_s is not None
        yield tracks.Candidate("EKF-GSF yaw", estimator.time_s, np.where(valid, yaw, np.nan), sd)


def find_utc_of_boot(topics: tracks.Tables) -> datetime | None:
    """The median over the GPS messages that know the time, less the seconds since boot."""
    low, high = (1e6 * second for second in UNIX_SECONDS)
    for gps in (topics[name] for name in GPS if name in topics):
        if (told := gps.get("time_utc_usec")) is not None:
            utc = told.astype(np.float64)
            boot = gps.columns["timestamp"] + gps.columns.get("timestamp_time_relative", 0.0)
            known = (utc > low) & (utc < high) & (boot < tracks.LONGEST_RUN_S * 1e6)
            if known.any():
                return UNIX + timedelta(microseconds=float(np.median((utc - boot)[known])))
    return None


def compute_euler_deg(quat_wxyz: ArrayLike) -> tuple[Array, Array, Array]:
    """Roll, pitch, heading in degrees, (n,) each, of q (n, 4) from body to north-east-down. heading
    0…360, of the yaw-pitch-roll sequence; q may have any length but zero."""
    q = np.asarray(quat_wxyz, dtype=np.float64)
    w, x, y, z = (q / np.linalg.norm(q, axis=-1, keepdims=True)).T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(roll), np.degrees(pitch), np.degrees(heading) % 360.0
