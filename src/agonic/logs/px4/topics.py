"""What a PX4 log holds beside the magnetometer: attitude, motion, power, place and clock.

`vehicle_attitude.q` is w, x, y, z (Hamilton) and turns components in body axes (forward, right,
down) into north, east, down. Names and units of the topics: PX4-Autopilot, msg/, of any version.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.logs.rows.tracks import Candidate, Track

Topic = Mapping[str, NDArray[Any]]
Topics = Mapping[str, Topic]

ATTITUDE, MOTION = "vehicle_attitude[0]", "sensor_combined[0]"
GPS = ("vehicle_gps_position[0]", "sensor_gps[0]")
ESTIMATED_PLACE = "vehicle_global_position[0]"
BATTERY = "battery_status"
CONTROLS, THRUST = "actuator_controls_0[0]", "vehicle_thrust_setpoint[0]"
MOTORS, OUTPUTS = "actuator_motors[0]", "actuator_outputs[0]"
SPEED_CONTROLLERS = "esc_status[0]"
YAW_ESTIMATOR = "yaw_estimator_status[0]"
ANGLES = ("roll_deg", "pitch_deg", "heading_deg")
PLACE = ("latitude_deg", "longitude_deg", "altitude_m")
GPS_YAW_SD_DEG = 2.0
"""Of two antennas half a metre apart, where the receiver does not say."""
BESIDE = tuple(
    name.removesuffix("[0]")
    for name in (
        *(ATTITUDE, MOTION, *GPS, ESTIMATED_PLACE, BATTERY, CONTROLS, THRUST),
        *(MOTORS, OUTPUTS, SPEED_CONTROLLERS, YAW_ESTIMATOR),
    )
)
"""The topics that are read."""

_UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_YEAR_2001_US, _YEAR_2096_US = 1e15, 4e15
_SHORTEST_PULSE_US = 800.0
_LONGEST_RUN_US = 1e14  # three years; what lies above is damage


def list_tracks(topics: Topics, time: Array, rotation_bm: Rotation | None) -> Iterator[Track]:
    """Attitude, motion, power and place, as recorded beside a magnetometer with these times.
    Acceleration and rotation rate are logged in body axes; they are turned into those of the
    magnetometer, and left out where the turn is not known."""

    def track(name: str, topic: Topic, values: Array) -> Track:
        return Track(name, read_time_s(topic), values, time)

    attitude, motion = topics.get(ATTITUDE, {}), topics.get(MOTION, {})
    if (q := stack_vector(attitude, *(f"q[{i}]" for i in range(4)))) is not None:
        q[np.abs(np.linalg.norm(q, axis=1) - 1) > 0.1] = np.nan
        for name, angle in zip(ANGLES, compute_euler_deg(q), strict=True):
            yield track(name, attitude, angle)
    for name, logged in (("acceleration", "accelerometer_m_s2"), ("rotation_rate", "gyro_rad")):
        body = stack_vector(motion, *(f"{logged}[{i}]" for i in range(3)))
        if body is not None and rotation_bm is not None:
            yield track(name, motion, rotation_bm.apply(body, inverse=True))
    controls, thrust = topics.get(CONTROLS, {}), topics.get(THRUST, {})
    if "control[3]" in controls:
        yield track("throttle", controls, controls["control[3]"])
    elif (xyz := stack_vector(thrust, "xyz[0]", "xyz[1]", "xyz[2]")) is not None:
        yield track("throttle", thrust, np.linalg.norm(xyz, axis=1))
    place, fixed = _find_place(topics)
    for name, values in place.items():
        yield Track(name, fixed, values, time)
    for name, topic, values in _list_disturbers(topics):
        yield track(name, topic, values)
    batteries = [topics[name] for name in sorted(topics) if name.startswith(BATTERY)]
    measured = [b for b in batteries if "current_a" in b and (b["current_a"] > 0).any()]
    for k, battery in enumerate(measured, start=1):
        current = battery["current_a"].astype(np.float64)  # a negative one is unknown
        name = "current_A" if k == 1 else f"battery{k}_A"
        yield track(name, battery, np.where(current >= 0, current, np.nan))


def list_headings(topics: Topics) -> Iterator[Candidate]:
    """What tells a heading without a magnetometer: a GPS with two antennas, the yaw by velocities.
    `heading` of the GPS is NaN where there is none; `heading_accuracy` its sd, rad. The composite
    yaw of `yaw_estimator_status` counts where `yaw_composite_valid` says so."""
    for name in GPS:
        topic = topics.get(name, {})
        if "heading" not in topic or not np.isfinite(topic["heading"]).any():
            continue
        heading = np.degrees(topic["heading"].astype(np.float64))
        sd = np.degrees(topic.get("heading_accuracy", np.full(len(heading), np.nan)))
        sd = np.where(sd > 0, sd, GPS_YAW_SD_DEG)
        yield Candidate("GPS yaw", read_time_s(topic), heading, sd)
        break
    topic = topics.get(YAW_ESTIMATOR, {})
    if {"yaw_composite", "yaw_variance"} <= set(topic):
        yaw = np.degrees(topic["yaw_composite"].astype(np.float64))
        valid = topic.get("yaw_composite_valid", np.ones(len(yaw))).astype(bool)
        sd = np.degrees(np.sqrt(np.abs(topic["yaw_variance"].astype(np.float64))))
        yield Candidate("EKF-GSF yaw", read_time_s(topic), np.where(valid, yaw, np.nan), sd)


def _list_disturbers(topics: Topics) -> Iterator[tuple[str, Topic, Array]]:
    """What may disturb a compass beside the batteries, by name. Motors by their command 0…1 (older
    logs: by their pulse of 1…2 ms), speed controllers by their current."""
    motors, outputs = topics.get(MOTORS, {}), topics.get(OUTPUTS, {})
    controllers = topics.get(SPEED_CONTROLLERS, {})
    commanded = [(f"motor{k + 1}_duty", motors, f"control[{k}]", (1.0, 0.0)) for k in range(12)]
    if not motors:
        commanded = [
            (f"output{k + 1}_duty", outputs, f"output[{k}]", (1e-3, -1.0))
            for k in range(16)
            if np.nanmax(outputs.get(f"output[{k}]", np.zeros(1)), initial=0.0) > _SHORTEST_PULSE_US
        ]
    drawn = [(f"esc{k + 1}_A", controllers, f"esc[{k}].esc_current", (1.0, 0.0)) for k in range(8)]
    for name, topic, column, (factor, offset) in (*commanded, *drawn):
        if column in topic:
            values = factor * topic[column].astype(np.float64) + offset
            least = -1.0 if motors else 0.0
            yield name, topic, np.clip(values, least, 1.0) if name.endswith("_duty") else values


def _find_place(topics: Topics) -> tuple[dict[str, Array], Array]:
    """Position from GPS where it has a three-dimensional fix, else the vehicle's estimate;
    and its times."""
    for name in (*GPS, ESTIMATED_PLACE):
        topic = topics.get(name, {})
        latitude = _read_scaled(topic, 1e7, "lat", "latitude_deg")
        longitude = _read_scaled(topic, 1e7, "lon", "longitude_deg")
        altitude = _read_scaled(
            topic, 1e3, "alt_ellipsoid", "altitude_ellipsoid_m", "alt", "altitude_msl_m"
        )
        if latitude is None or longitude is None:
            continue
        fixed = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180) & (latitude != 0)
        if "fix_type" in topic:
            fixed &= topic["fix_type"] >= 3
        if fixed.any():
            place = dict(zip(PLACE, (latitude, longitude, altitude), strict=True))
            known = {name: values[fixed] for name, values in place.items() if values is not None}
            return known, read_time_s(topic)[fixed]
    return {}, np.empty(0)


def _read_scaled(topic: Topic, per_unit: float, *names: str) -> Array | None:
    """The first of these columns that holds anything; older messages count whole numbers."""
    for name in names:
        if name in topic and topic[name].any():
            whole = topic[name].dtype.kind in "iu"
            return topic[name].astype(np.float64) / (per_unit if whole else 1.0)
    return None


def stack_vector(topic: Topic, *names: str) -> Array | None:
    """These columns side by side, (n, …), if all are there."""
    if not set(names) <= set(topic):
        return None
    return np.stack([topic[name] for name in names], axis=1).astype(np.float64)


def read_time_s(topic: Topic) -> Array:
    """Seconds since boot: when it was sampled where that is logged, else when it was published."""
    sampled = topic.get("timestamp_sample")
    chosen = topic["timestamp"] if sampled is None or not sampled.all() else sampled
    return chosen.astype(np.float64) / 1e6


def find_utc_of_boot(topics: Topics) -> datetime | None:
    """The median over the GPS messages that know the time, less the seconds since boot."""
    for name in GPS:
        topic = topics.get(name, {})
        if "time_utc_usec" in topic:
            utc = topic["time_utc_usec"].astype(np.float64)
            boot = topic["timestamp"] + topic.get("timestamp_time_relative", 0.0)
            known = (utc > _YEAR_2001_US) & (utc < _YEAR_2096_US) & (boot < _LONGEST_RUN_US)
            if known.any():
                return _UNIX_EPOCH + timedelta(microseconds=float(np.median((utc - boot)[known])))
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
