"""Reading PX4 logs: synthetic ones of known truth, recordings, and damaged ones."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.errors import LogError
from agonic.logs.formats import FORMATS
from agonic.logs.log import Log
from agonic.logs.px4.topics import compute_euler_deg
from agonic.logs.px4.ulog import read
from agonic.maths.equation.affine import correct
from agonic.provenance import Input
from tests.logs.damage import damaged, read_or_refused
from tests.logs.levelled import heading_error_deg
from tests.logs.ulog_writer import Topic, ulog

GAUSS = 1e5  # nT
N = 300
STAMP = (5_000_000 + np.arange(N) * 20_000).astype("u8")
SECONDS = STAMP / 1e6

OFF = np.array([0.031, -0.222, 0.145])
S = np.array([[1.04, 0.05, -0.03], [0.05, 0.96, 0.02], [-0.03, 0.02, 1.01]])
DEVICE = 592905
SLOT: dict[str, float] = {
    "CAL_MAG0_ID": 1,
    "CAL_MAG1_ID": DEVICE,
    "CAL_MAG_PRIME": DEVICE,
    "CAL_MAG1_ROT": 0,
    **{f"CAL_MAG1_{a}OFF": float(v) for a, v in zip("XYZ", OFF, strict=True)},
    **{f"CAL_MAG1_{a}SCALE": float(v) for a, v in zip("XYZ", np.diag(S), strict=True)},
}
ODIAG = {"CAL_MAG1_XODIAG": S[0, 1], "CAL_MAG1_YODIAG": S[0, 2], "CAL_MAG1_ZODIAG": S[1, 2]}
LEVEL = {"SENS_BOARD_X_OFF": 4.0, "SENS_BOARD_Y_OFF": -3.0, "SENS_BOARD_Z_OFF": 2.0}
R_LEVEL = Rotation.from_euler("ZYX", [2.0, -3.0, 4.0], degrees=True)

Reader = Callable[..., Log]


def load(path: Path) -> Log:
    return read(path, Input(name=path.name, sha256="0" * 64, count=path.stat().st_size))


@pytest.fixture
def written(tmp_path: Path) -> Reader:
    """Write a log and read it."""

    def write_and_read(*arguments: object) -> Log:
        path = tmp_path / "flight.ulg"
        path.write_bytes(ulog(*arguments))  # type: ignore[arg-type]
        return load(path)

    return write_and_read


def raw_gauss() -> np.ndarray:
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(N, 3))
    return 0.5 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + OFF


def sensor_mag(gauss: np.ndarray, **more: np.ndarray) -> Topic:
    x, y, z = gauss.astype("f4").T
    device = np.full(N, DEVICE, "u4")
    return {"timestamp": STAMP, "device_id": device, "x": x, "y": y, "z": z, **more}


def corrected(raw: np.ndarray) -> np.ndarray:
    return (raw - OFF) @ S.T


# --- attitude: order and direction of the quaternion -------------------------------------------


@pytest.mark.parametrize(
    ("axis", "turned", "lands_on"),
    [
        (2, (1, 0, 0), (0, 1, 0)),  # nose from north to east: heading 90
        (1, (1, 0, 0), (0, 0, -1)),  # nose up: pitch 90
        (0, (0, 1, 0), (0, 0, 1)),  # right wing down: roll 90
    ],
)
def test_one_turn_of_90_degrees(
    axis: int, turned: tuple[int, ...], lands_on: tuple[int, ...]
) -> None:
    quat_wxyz = np.zeros((1, 4))
    quat_wxyz[0, 0] = quat_wxyz[0, 1 + axis] = np.sqrt(0.5)
    rot_nb = Rotation.from_quat(quat_wxyz[:, [1, 2, 3, 0]])
    np.testing.assert_allclose(rot_nb.apply(turned), [lands_on], atol=1e-12)
    assert compute_euler_deg(quat_wxyz)[axis][0] == pytest.approx(90.0, abs=1e-5)


def test_angles_rebuild_the_rotation() -> None:
    rot_nb = Rotation.random(200, rng=np.random.default_rng(3))
    roll, pitch, heading = compute_euler_deg(rot_nb.as_quat()[:, [3, 0, 1, 2]])
    again = Rotation.from_euler("ZYX", np.stack([heading, pitch, roll], axis=1), degrees=True)
    assert (again * rot_nb.inv()).magnitude().max() < 1e-6
    assert ((heading >= 0) & (heading < 360)).all()


def test_attitude_of_a_log_turning_east(written: Reader) -> None:
    turn = np.radians(30.0 * (SECONDS - 5.0) + 350.0)
    q = np.zeros((N, 4), "f4")
    q[:, 0], q[:, 3] = np.cos(turn / 2), np.sin(turn / 2)
    q[7] = 0.0  # not set
    topics = {
        "sensor_mag[0]": sensor_mag(raw_gauss()),
        "vehicle_attitude[0]": {"timestamp": STAMP, "q": q},
    }
    (s,) = written(topics).sensors
    error = (s.heading_deg - 30.0 * (s.time - 5.0) - 350.0 + 180.0) % 360.0 - 180.0
    assert np.abs(error).max() < 1e-3
    np.testing.assert_allclose(s.roll_deg, 0.0, atol=1e-3)


# --- truth: what the sensor measured, and the correction ---------------------------------------


def test_sensor_mag_is_raw_and_its_correction_is_found_by_device_id(written: Reader) -> None:
    raw = raw_gauss()
    (s,) = written({"sensor_mag[0]": sensor_mag(raw)}, SLOT | ODIAG).sensors
    np.testing.assert_allclose(s.field, raw * GAUSS, atol=0.01)
    assert (s.name, s.frame, s.unit) == ("sensor_mag[0]", "m", "nT")
    assert s.logged is not None
    np.testing.assert_allclose(s.logged.bias, OFF * GAUSS, atol=0.01)
    np.testing.assert_allclose(s.logged.matrix, S, rtol=1e-6)
    assert s.logged.source == "CAL_MAG1_* parameters in the log"
    assert s.device_id == DEVICE


def test_up_to_1_11_the_driver_had_corrected_and_that_is_taken_out(written: Reader) -> None:
    raw = raw_gauss()
    diagonal = np.diag(np.diag(S))
    (s,) = written({"sensor_mag[0]": sensor_mag((raw - OFF) @ diagonal)}, SLOT).sensors
    np.testing.assert_allclose(s.field, raw * GAUSS, atol=0.02)


def test_without_a_slot_there_is_no_correction(written: Reader) -> None:
    raw = raw_gauss()
    other = sensor_mag(raw) | {"device_id": np.full(N, 7, "u4")}
    (s,) = written({"sensor_mag[0]": other}, SLOT | ODIAG).sensors
    np.testing.assert_allclose(s.field, raw * GAUSS, atol=0.01)
    assert s.logged is None


def test_corrected_topics_are_taken_back_to_sensor_axes(written: Reader) -> None:
    raw = raw_gauss()
    body = R_LEVEL.apply(corrected(raw)).astype("f4")
    topic = {"timestamp": STAMP, "magnetometer_ga": body}
    log = written({"vehicle_magnetometer[0]": topic}, SLOT | ODIAG | LEVEL)
    (s,) = log.sensors
    np.testing.assert_allclose(s.field, raw * GAUSS, atol=0.03)
    assert (s.name, s.frame) == ("vehicle_magnetometer[0]", "m")


def test_corrected_topics_stay_when_the_mounting_is_not_known(written: Reader) -> None:
    body = corrected(raw_gauss()).astype("f4")
    topic = {"timestamp": STAMP, "magnetometer_ga": body}
    log = written({"vehicle_magnetometer[0]": topic}, SLOT | ODIAG | {"CAL_MAG1_ROT": 6})
    (s,) = log.sensors
    np.testing.assert_allclose(s.field, body * GAUSS, atol=0.01)
    assert (s.frame, s.logged) == ("b", None)
    assert any("already corrected" in note for note in s.notes)


def test_repeated_readings_of_the_combined_topic_count_once(written: Reader) -> None:
    raw = raw_gauss()[:100]
    field = np.repeat(corrected(raw), 3, axis=0).astype("f4")
    behind = (np.tile([0, -20_000, -40_000], 100) + np.tile([0, 1, -1], 100)).astype("i4")
    behind[5] = 0x7FFFFFFF
    topic = {
        "timestamp": STAMP,
        "magnetometer_timestamp_relative": behind,
        "magnetometer_ga": field,
    }
    (s,) = written({"sensor_combined[0]": topic}, SLOT | ODIAG).sensors
    np.testing.assert_allclose(s.field, raw * GAUSS, atol=0.03)
    np.testing.assert_allclose(s.time, SECONDS[::3], atol=1e-5)
    assert dict(s.rejected) == {}


def test_readings_of_another_device_are_left_out(written: Reader) -> None:
    devices = np.where(np.arange(N) < 40, 7, DEVICE).astype("u4")
    (s,) = written({"sensor_mag[0]": sensor_mag(raw_gauss()) | {"device_id": devices}}).sensors
    assert len(s) == N - 40


def test_a_dead_sensor_does_not_hide_the_others(written: Reader) -> None:
    dead = sensor_mag(np.full((N, 3), np.nan))
    log = written({"sensor_mag[0]": dead, "sensor_mag[1]": sensor_mag(raw_gauss())})
    assert [s.name for s in log.sensors] == ["sensor_mag[1]"]
    assert any("sensor_mag[0] was left out" in note for note in log.notes)


# --- what was recorded beside ------------------------------------------------------------------


MOTION: Topic = {
    "timestamp": STAMP,
    "gyro_rad": np.tile(np.float32([0.1, 0, 0]), (N, 1)),
    "accelerometer_m_s2": np.tile(np.float32([0, 0, -9.81]), (N, 1)),
}


def test_motion_is_in_the_axes_of_the_magnetometer(written: Reader) -> None:
    topics = {"sensor_mag[0]": sensor_mag(raw_gauss()), "sensor_combined[0]": MOTION}
    (s,) = written(topics, SLOT | ODIAG | LEVEL).sensors
    np.testing.assert_allclose(s.acceleration[0], R_LEVEL.inv().apply([0, 0, -9.81]), atol=1e-5)
    np.testing.assert_allclose(s.rotation_rate[0], R_LEVEL.inv().apply([0.1, 0, 0]), atol=1e-6)


@pytest.mark.parametrize("turned", [{"CAL_MAG1_ROT": 2}, {"CAL_MAG1_ROT": -1, "SENS_BOARD_ROT": 4}])
def test_motion_is_left_out_where_the_mounting_is_not_known(
    written: Reader, turned: dict[str, float]
) -> None:
    topics = {"sensor_mag[0]": sensor_mag(raw_gauss()), "sensor_combined[0]": MOTION}
    (s,) = written(topics, SLOT | ODIAG | turned).sensors
    assert s.acceleration is None
    assert s.rotation_rate is None


START = datetime(2023, 7, 1, 12, 0, 0, tzinfo=UTC)
FIX = {
    "timestamp": STAMP[::10],
    "time_utc_usec": (STAMP[::10] + int(START.timestamp() * 1e6)).astype("u8"),
    "fix_type": np.where(np.arange(N // 10) < 3, 0, 3).astype("u1"),
}
PLACE = np.where(np.arange(N // 10) < 3, 0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        (
            "vehicle_gps_position[0]",
            {
                "lat": (PLACE * 473977419).astype("i4"),
                "lon": (PLACE * -1225000000).astype("i4"),
                "alt_ellipsoid": (PLACE * 488200).astype("i4"),
            },
        ),
        (
            "sensor_gps[0]",
            {
                "latitude_deg": PLACE * 47.3977419,
                "longitude_deg": PLACE * -122.5,
                "altitude_ellipsoid_m": PLACE * 488.2,
            },
        ),
    ],
)
def test_place_and_clock_of_every_version(written: Reader, name: str, columns: Topic) -> None:
    (s,) = written({"sensor_mag[0]": sensor_mag(raw_gauss()), name: FIX | columns}).sensors
    np.testing.assert_allclose(s.latitude_deg, 47.3977419, atol=1e-7)
    np.testing.assert_allclose(s.longitude_deg, -122.5, atol=1e-7)
    np.testing.assert_allclose(s.altitude_m, 488.2, atol=1e-3)
    assert s.epoch is not None
    assert abs((s.epoch - START).total_seconds()) < 1e-3
    np.testing.assert_allclose(s.time, SECONDS)


def test_temperature_power_and_sample_times(written: Reader) -> None:
    raw, sampled = raw_gauss(), STAMP - np.uint64(4000)
    ramp = np.linspace(20.0, 30.0, N).astype("f4")
    ramp_with_gap = np.where(np.arange(N) == 5, np.nan, ramp).astype("f4")
    unknown = np.where(np.arange(N) < 10, -1.0, ramp).astype("f4")
    topics = {
        "sensor_mag[0]": sensor_mag(raw, temperature=ramp_with_gap, timestamp_sample=sampled),
        "sensor_mag[1]": sensor_mag(raw, temperature=0 * ramp, timestamp_sample=sampled),
        "battery_status[0]": {"timestamp": STAMP, "current_a": np.full(N, -1, "f4")},
        "battery_status[1]": {"timestamp": STAMP, "current_a": unknown},
        "vehicle_thrust_setpoint[0]": {
            "timestamp": STAMP,
            "xyz": np.tile(np.float32([0, 0, -0.6]), (N, 1)),
        },
    }
    topics["actuator_motors[0]"] = {
        "timestamp": STAMP,
        "control": np.stack([ramp / 100, 0 * ramp, np.full(N, np.nan)], axis=1).astype("f4"),
    }
    topics["battery_status[2]"] = {"timestamp": STAMP, "current_a": (2 * ramp).astype("f4")}
    first, second = written(topics).sensors
    assert len(first) == N
    assert set(first.disturbers) == {"motor1_duty", "battery2_A"}
    np.testing.assert_allclose(
        first.disturbers["motor1_duty"], np.clip(ramp / 100, 0, 1), atol=0.01
    )
    np.testing.assert_allclose(first.temperature, ramp, atol=1e-5)
    np.testing.assert_allclose(first.time, SECONDS - 0.004)
    assert second.temperature is None
    np.testing.assert_allclose(second.current_A, np.maximum(ramp, ramp[10]), atol=0.01)
    np.testing.assert_allclose(second.throttle, 0.6, rtol=1e-6)


def test_streams_and_firmware_are_listed(written: Reader) -> None:
    topics = {"sensor_mag[0]": sensor_mag(raw_gauss()), "vehicle_gps_position[0]": FIX}
    log = written(topics, {}, {"ver_sw_release": 0x010D0100})
    (stream,) = log.streams
    assert (stream.name, stream.rows) == ("vehicle_gps_position[0]", N // 10)
    assert stream.rate_Hz == pytest.approx(5.0)
    assert (log.format, log.stack) == ("PX4 ULog", "px4")
    assert log.notes == ("firmware PX4 v1.13.1",)


# --- damage ------------------------------------------------------------------------------------


def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    q = np.tile(np.float32([1, 0, 0, 0]), (N, 1))
    topics = {
        "sensor_mag[0]": sensor_mag(raw_gauss()),
        "vehicle_attitude[0]": {"timestamp": STAMP, "q": q},
    }
    data = np.frombuffer(ulog(topics, SLOT | ODIAG), dtype=np.uint8)
    path = tmp_path / "fuzz.ulg"
    rng = np.random.default_rng(5)
    read_well = 0
    for _ in range(150):
        path.write_bytes(damaged(data, rng).tobytes())
        log = read_or_refused(load, path)
        if log is not None:
            read_well += 1
            assert all(np.isfinite(s.field).all() for s in log.sensors)
    assert read_well > 75
    assert capsys.readouterr().out == ""


# The last message claims 12 005 bytes of which 4 are there. From the end pyulog 1.3.0 would step
# back by the claim, to the start of one of the parameters (24 bytes each), and so on for ever.
CUT_AMONG_DEFINITIONS = ulog({}, {f"P{k:09}": 1.0 for k in range(1000)}) + b"\xe5\x2ezzzzz"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"ULog\x01\x12\x35",
        b"ULog\x01\x12\x35\x01" + bytes(90),
        CUT_AMONG_DEFINITIONS,
    ],
)
def test_a_file_without_topics_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "empty.ulg"
    path.write_bytes(data)
    with pytest.raises(LogError, match=r"cannot be read|holds no readings"):
        load(path)


def test_only_ulog_is_accepted() -> None:
    kind = next(kind for kind in FORMATS if kind.module == "px4.ulog")
    assert kind.accepts(ulog({"sensor_mag[0]": sensor_mag(raw_gauss())})[:4096])
    assert not kind.accepts(b"")
    assert not kind.accepts(b"\xa3\x95\x80\x80\x59FMT")


# --- recordings --------------------------------------------------------------------------------


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "steps_nT"),
    [
        ("sample_log_small.ulg", (150.0, 150.0, 150.0)),
        ("sample.ulg", (175.7805, 176.3674, 169.9214)),
    ],
)
def test_recovered_readings_are_whole_counts(
    recordings: Path, name: str, steps_nT: tuple[float, ...]
) -> None:
    """Offset, scale and levelling are undone exactly: the converter's steps come to light.

    In one log 0.15 µT, in the other about 1/5.7 µT and its own on each axis.
    """
    raw = [s for s in load(recordings / "vehicle/px4" / name).sensors if "sensor_" in s.name]
    assert raw
    for sensor in raw:
        for values, step in zip(sensor.field.T, steps_nT, strict=True):
            steps = np.diff(np.unique(values.round(1)))
            steps = steps[steps > 1.0]  # the rest is float32
            np.testing.assert_allclose(steps, step * np.rint(steps / step), atol=0.25)


@pytest.mark.recordings
def test_logged_correction_gives_the_corrected_topic(recordings: Path) -> None:
    from pyulog import ULog

    path = recordings / "vehicle/px4/sample_log_small.ulg"
    log = load(path)
    assert [(s.name, len(s)) for s in log.sensors] == [
        ("vehicle_magnetometer[0]", 319), ("sensor_mag[0]", 6), ("sensor_mag[1]", 6)
    ]  # fmt: skip
    s = log.sensors[2]
    assert s.logged is not None
    topic = ULog(str(path), ["vehicle_magnetometer"]).get_dataset("vehicle_magnetometer").data
    theirs = np.stack([topic[f"magnetometer_ga[{i}]"] for i in range(3)], axis=1) * GAUSS
    ours = correct(s.field, s.logged.bias, s.logged.matrix)
    nearest = np.abs(topic["timestamp"] / 1e6 - s.time[:, None]).argmin(axis=1)
    np.testing.assert_allclose(ours, theirs[nearest], atol=0.02)
    assert s.epoch is not None
    assert s.epoch.date().isoformat() == "2021-04-21"
    assert abs(s.latitude_deg[0] - 63.417) < 0.001


@pytest.mark.recordings
def test_a_flight_agrees_with_its_own_attitude(recordings: Path) -> None:
    (s,) = load(recordings / "vehicle/px4/sample.ulg").sensors
    error = heading_error_deg(s)
    assert abs(np.median(error)) < 3.0
    assert np.std(error) < 4.0
    assert np.ptp(s.heading_deg) > 25.0  # it did turn


def test_a_topic_with_far_more_rows_goes_before_the_raw_one(tmp_path: Path) -> None:
    """A logger that kept six raw readings of 300 did not mean them to be the record."""
    field = np.tile([0.2, 0.05, 0.4], (N, 1)).astype("f4")
    whole: Topic = {"timestamp": STAMP, "magnetometer_ga": field}
    few: Topic = {"timestamp": STAMP[:6], **{a: field[:6, k] for k, a in enumerate("xyz")}}
    path = tmp_path / "a.ulg"
    path.write_bytes(ulog({"sensor_mag[0]": few, "vehicle_magnetometer[0]": whole}))
    log = read(path, Input(name="a.ulg", sha256="", count=0))
    assert [(s.name, len(s)) for s in log.sensors] == [
        ("vehicle_magnetometer[0]", N), ("sensor_mag[0]", 6)
    ]  # fmt: skip
