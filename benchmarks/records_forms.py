"""Records of the forms that people have, for benchmarks.records: turned sensors, shots, tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.inertial.pair import fit_pair
from agonic.logs.read import open_log
from benchmarks.records import Array, Kind, Record, Turned, put_beside, turn, write

GRAVITY = 9.80665
FORWARD = 24_000.0
"""Counts of gravity and of the field in a cave surveyor's instrument."""


def make_mounted(g: np.random.Generator, seed: int) -> Record:
    """Turned about z, or any axis, by 10 to 60° against accelerometer and gyro."""
    made, seat = turn(g, seed, 1e-3), seat_sensor(g, seed)
    record = put_beside(made, made.field @ seat.T)
    return record._replace(bias=seat @ made.bias, seat=seat.T)


def make_mounted_by_angles(g: np.random.Generator, seed: int) -> Record:
    """The same beside roll and pitch, with the place."""
    made, seat = turn(g, seed, 1e-3), seat_sensor(g, seed)
    x, y, z = -made.acceleration.T
    roll, pitch = np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))
    head = "time_s,mag_x_uT,mag_y_uT,mag_z_uT,roll_deg,pitch_deg"
    text = write(head, made.time, made.field @ seat.T, np.degrees([roll, pitch]).T, places=4)
    return Record(text, seat @ made.bias, seat=seat.T)


def seat_sensor(g: np.random.Generator, seed: int) -> Array:
    """The turn (3, 3) from the vehicle's axes to the sensor's."""
    axis = np.array([0.0, 0.0, 1.0]) if seed % 2 else g.normal(size=3)
    angle = np.radians(g.uniform(10.0, 60.0)) * g.choice([-1, 1])
    return np.asarray(Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix())


def make_tidy(g: np.random.Generator, seed: int) -> Record:
    """A row for each time and channel."""
    made = turn(g, seed, 1e-3)
    unit, value = str(g.choice(["unit", "units"])), str(g.choice(["value", "reading"]))
    rows = [
        f"{time:.3f},mag_{axis},{one:.3f},uT"
        for time, field in zip(made.time, made.field, strict=True)
        for axis, one in zip("xyz", field, strict=True)
    ]
    return Record("\n".join([f"time,channel,{value},{unit}", *rows]) + "\n", made.bias)


def make_two_clocks(g: np.random.Generator, seed: int) -> Record:
    """The clock since the start and that of the day."""
    made = turn(g, seed, 1 / 150)
    field = np.round(made.field)
    names, scales = (
        ("ts_mono,ts_real", (1.0, 1.0)),
        ("ms_ts,time", (1000.0, 1.0)),
        ("timestamp,timestamp_sample", (1e6, 1e6)),
    )[seed % 3]
    own, day = made.time * scales[0], (1.7e9 + made.time) * scales[1]
    clocks = (made.time * 1e6 + 120, made.time * 1e6) if seed % 3 == 2 else (own, day)
    return Record(write(f"{names},mx,my,mz", *clocks, field, places=3), made.bias)


def describe_raw_imu(made: Turned) -> tuple[Array, Array]:
    """RAW_IMU's numbers (n, 9), mg, mrad/s and mG, and its times (n,), µs."""
    felt, turning = made.acceleration / GRAVITY * 1000, made.rotation_rate * 1000
    return np.round(np.hstack([felt, turning, made.field])), 1e8 + np.round(made.time * 1e6)


NAMES = [f"{axis}{kind}" for kind in ("acc", "gyro", "mag") for axis in "xyz"]


def make_telemetry_text(g: np.random.Generator, seed: int) -> Record:
    """RAW_IMU as mavlogdump prints it."""
    made = turn(g, seed, 0.01)
    numbers, times = describe_raw_imu(made)
    rows = [
        f"2025-06-01 10:{s // 60:02.0f}:{s % 60:05.2f}: RAW_IMU {{time_usec : {at:.0f}, "
        + ", ".join(f"{name} : {value:.0f}" for name, value in zip(NAMES, row, strict=True))
        + ", id : 0, temperature : 0}"
        for s, at, row in zip(made.time, times, numbers, strict=True)
    ]
    return Record("\n".join(rows) + "\n", made.bias)


def make_telemetry_table(g: np.random.Generator, seed: int) -> Record:
    """The same as Mission Planner makes a table of a tlog: names and values in turn."""
    made = turn(g, seed, 0.01)
    numbers, times = describe_raw_imu(made)
    rows = [
        f"2025-06-01T10:{s // 60:02.0f}:{s % 60:06.3f},FE,1A,{k % 256},1,1,1B,mavlink_raw_imu_t,"
        f"time_usec,{at:.0f},"
        + ",".join(f"{name},{value:.0f}" for name, value in zip(NAMES, row, strict=True))
        + ",sysid,1,compid,1"
        for k, (s, at, row) in enumerate(zip(made.time, times, numbers, strict=True))
    ]
    return Record("\n".join(rows) + "\n", made.bias)


def make_paparazzi(g: np.random.Generator, seed: int) -> Record:
    """Paparazzi's log of messages, in counts."""
    made = turn(g, seed, 1 / 50)
    rows = []
    for time, field, felt in zip(made.time, made.field, made.acceleration * 100, strict=True):
        rows.append(f"{time:.3f} 1 IMU_MAG_RAW 0 " + " ".join(f"{v:.0f}" for v in field))
        rows.append(f"{time + 1e-3:.3f} 1 IMU_ACCEL_RAW 0 " + " ".join(f"{v:.0f}" for v in felt))
    return Record("\n".join(rows) + "\n", made.bias)


def make_shots(g: np.random.Generator, seed: int) -> Record:
    """TopoDroid's calibration: 14 directions, each at four rolls, accelerometer in counts."""
    dip = np.radians(g.uniform(40.0, 70.0))
    bias = g.normal(size=3) * 1500.0
    heads = [(h, p) for p in (-45, 0, 45) for h in (0, 90, 180, 270)] + [(0, 85), (0, -85)]
    rows = []
    for group, (heading, pitch) in enumerate(heads, start=1):
        for roll in (0, 90, 180, 270):
            angles = [heading + group, pitch, roll + g.normal()]
            turned = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
            felt = FORWARD * turned[2] + [300, -200, 150] + g.normal(size=3) * 20
            field = FORWARD * np.array([np.cos(dip), 0, np.sin(dip)]) @ turned
            seen = field * [1.03, 0.97, 1.0] + bias + g.normal(size=3) * 20
            numbers = ", ".join(f"{v:.0f}" for v in (*felt, *seen))
            which = -group if roll % 180 == 0 else group
            rows.append(f"{len(rows) + 1}, {numbers}, {which}, 0.0, 0.0, 0.0, 0.1000, 0")
    head = "# 2025.06.01 created by TopoDroid v 6.2.0\n\n# cal one\n# 2025.06.01\n"
    return Record(head + "\n".join(rows) + "\n", bias)


def judge_shots(path: Path, record: Record) -> tuple[str, str]:
    """What `agonic fit pair` makes of them."""
    fit = fit_pair(open_log(path).sensors[0])
    assert record.bias is not None
    off = np.linalg.norm(fit.calibration.bias - record.bias) / FORWARD
    right = fit.verdict != "refused" and off < 0.005
    return ("right" if right else "otherwise"), f"{off:.4f} of the field: {fit.status}"


KINDS = (
    Kind("mounted at 10 to 60°", make_mounted, r"sensor is turned|misaligned"),
    Kind("the same by roll and pitch", make_mounted_by_angles, r"sensor is turned|misaligned"),
    Kind("tidy table", make_tidy, ""),
    Kind("two clocks", make_two_clocks, ""),
    Kind("telemetry as text", make_telemetry_text, r"autopilot .*had corrected"),
    Kind("telemetry as a table", make_telemetry_table, r"autopilot .*had corrected"),
    Kind("Paparazzi's messages", make_paparazzi, ""),
    Kind("shots of a DistoX", make_shots, "", judge_shots),
)
