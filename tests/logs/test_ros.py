"""Bags of every kind, written by rosbags: several magnetometers, frames, clocks, compression."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from tests.logs.damage import read_or_refused

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

N = 30
START = 1_700_000_000
TIME = np.arange(N) / 20
HEADING = np.linspace(10, 190, N)
BODY = Rotation.from_euler("z", 90 - HEADING[:, None], degrees=True)  # forward left up to ENU
FIELD = BODY.inv().apply([1e-6, 20e-6, -44e-6])  # east, north, up; tesla
ACC = BODY.inv().apply([0.0, 0.0, 9.8])
SIDE = Rotation.from_euler("x", 90, degrees=True)  # from the axes of the second sensor to the IMU's
ROS1 = get_typestore(Stores.ROS1_NOETIC)
TREE = "tf2_msgs/msg/TFMessage"
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TREE))
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
OUTPUTS, CONTROLLERS = "mavros_msgs/msg/RCOut", "mavros_msgs/msg/ESCStatus"
OTHERS = {
    OUTPUTS: "std_msgs/Header header\nuint16[] channels",
    "mavros_msgs/msg/ESCStatusItem": "float32 current",
    CONTROLLERS: "std_msgs/Header header\nmavros_msgs/ESCStatusItem[] esc_status",
}
for _store in (ROS1, ROS2):
    for _name, _text in OTHERS.items():
        _store.register(get_types_from_msg(_text, _name))


def messages(store, *, scale=1.0, ahead=0.0):
    """(topic, type, ns, message) of two magnetometers, an IMU, a receiver and transforms."""
    t = store.types

    def header(seconds, frame):
        sec, rest = divmod(seconds, 1)
        stamp = t["builtin_interfaces/msg/Time"](START + int(sec), round(rest * 1e9))
        extra = {"seq": 0} if store is ROS1 else {}
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra)

    def vector(values):
        return t["geometry_msgs/msg/Vector3"](*map(float, values))

    none = np.zeros(9)
    magnetic, imu = "sensor_msgs/msg/MagneticField", "sensor_msgs/msg/Imu"
    for k, seconds in enumerate(TIME):
        ns = int((START + seconds) * 1e9)
        first = t[magnetic](header(seconds, "imu_link"), vector(FIELD[k] * scale), none)
        yield "/imu/mag", magnetic, ns, first
        if k % 2 == 0:
            side = SIDE.inv().apply(FIELD[k] * scale)
            second = t[magnetic](header(seconds, "side_link"), vector(side), none)
            yield "/side/mag", magnetic, ns, second
        q = t["geometry_msgs/msg/Quaternion"](*BODY[k].as_quat())
        message = t[imu](
            header(seconds + 0.003, "imu_link"), q, none, vector([0.1, 0.2, 0.3]), none,
            vector(ACC[k]), none,
        )  # fmt: skip
        yield "/imu/data", imu, ns + 3_000_000, message
        pulses = np.array([1000 + 20 * k, 1500, 0], dtype=np.uint16)
        yield "/rc/out", OUTPUTS, ns, t[OUTPUTS](header(seconds, ""), pulses)
        drawn = [t["mavros_msgs/msg/ESCStatusItem"](float(x)) for x in (k, 2 * k)]
        yield "/esc", CONTROLLERS, ns, t[CONTROLLERS](header(seconds, ""), drawn)
    fix = "sensor_msgs/msg/NavSatFix"
    status = t["sensor_msgs/msg/NavSatStatus"](0, 1)
    for seconds in (0.0, 1.0):
        place = t[fix](header(seconds, "gps"), status, 63.4, 10.4, 30.0, none, 0)
        yield "/fix", fix, int((START + seconds) * 1e9), place
        reference = "sensor_msgs/msg/TimeReference"
        later = t["builtin_interfaces/msg/Time"](START + int(seconds) + int(ahead), 0)
        yield "/time", reference, START * 10**9, t[reference](header(seconds, ""), later, "gps")
    turn = t["geometry_msgs/msg/Transform"](
        vector([0, 0, 0]), t["geometry_msgs/msg/Quaternion"](*SIDE.as_quat())
    )
    told = t["geometry_msgs/msg/TransformStamped"](header(0.0, "imu_link"), "side_link", turn)
    yield "/tf_static", TREE, START * 10**9, t[TREE]([told])


def write_1(path: Path, compression=None, **facts) -> Path:
    writer = Writer1(path)
    if compression:
        writer.set_compression(getattr(Writer1.CompressionFormat, compression))
    with writer:
        known = {}
        for topic, kind, ns, message in messages(ROS1, **facts):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(known[topic], ns, ROS1.serialize_ros1(message, kind))
    return path


def write_2(path: Path, plugin=StoragePlugin.SQLITE3, compressed=False, **facts) -> Path:
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if compressed:
        writer.set_compression(CompressionMode.FILE, CompressionFormat.ZSTD)
    with writer:
        known = {}
        for topic, kind, ns, message in messages(ROS2, **facts):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(known[topic], ns, ROS2.serialize_cdr(message, kind))
    return path


def check(log):
    """Two magnetometers in tesla; everything else at their times, in their axes."""
    first, second = log.sensors
    assert (first.name, second.name) == ("imu/mag", "side/mag")
    np.testing.assert_allclose(first.field, FIELD * 1e9, rtol=1e-9)
    np.testing.assert_allclose(np.diff(first.time), 0.05, atol=1e-9)
    assert first.epoch.timestamp() == START
    for samples, turn, rows in (
        (first, Rotation.identity(), slice(None)), (second, SIDE.inv(), slice(0, N, 2))
    ):  # fmt: skip
        np.testing.assert_allclose(samples.field, turn.apply(FIELD[rows]) * 1e9, atol=1e-3)
        np.testing.assert_allclose(samples.acceleration[1:], turn.apply(ACC[rows])[1:], atol=1e-9)
        np.testing.assert_allclose(
            samples.rotation_rate, turn.apply(np.tile([0.1, 0.2, 0.3], (len(samples), 1)))
        )
        np.testing.assert_allclose(samples.latitude_deg, 63.4)
        angles = [samples.heading_deg, samples.pitch_deg, samples.roll_deg]
        ned = Rotation.from_euler("ZYX", np.stack(angles, axis=1), degrees=True)
        seen = ned.apply(np.array(samples.field))  # the IMU comes 3 ms late: 0.4°
        north = np.tile([20e3, 1e3, 44e3], (len(seen), 1))
        np.testing.assert_allclose(seen[1:], north[1:], atol=150)
        assert samples.heading_estimated
        k = np.arange(N)[rows]
        expected = {
            "output1_duty": 0.02 * k, "output2_duty": 0.5 + 0 * k, "esc1_A": k, "esc2_A": 2.0 * k
        }  # fmt: skip
        assert set(samples.disturbers) == set(expected)
        for name, values in expected.items():
            np.testing.assert_allclose(samples.disturbers[name], values, atol=1e-6)


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_ros_1(tmp_path, compression):
    log = open_log(write_1(tmp_path / "log.bag", compression))
    check(log)
    assert "/imu/data" in {stream.name for stream in log.streams}


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP], ids=["db3", "mcap"])
@pytest.mark.parametrize("compressed", [False, True], ids=["plain", "zstd"])
def test_ros_2(tmp_path, plugin, compressed):
    folder = write_2(tmp_path / "bag", plugin, compressed)
    check(open_log(folder))
    if not compressed:
        (inside,) = [part for part in folder.iterdir() if part.suffix in (".db3", ".mcap")]
        check(open_log(inside))


def test_a_single_mcap_file(tmp_path):
    folder = write_2(tmp_path / "bag", StoragePlugin.MCAP)
    (inside,) = folder.glob("*.mcap")
    alone = tmp_path / "alone.mcap"
    alone.write_bytes(inside.read_bytes())
    check(open_log(alone))


def test_a_driver_that_does_not_publish_tesla(tmp_path):
    path = write_1(tmp_path / "log.bag", scale=1e6)
    assert read(path).unit == "raw"
    assert "cannot be" in " ".join(read(path).notes)
    np.testing.assert_allclose(read(path, unit="uT").field, FIELD * 1e9, atol=1e-3)


def test_the_clock_of_a_time_reference(tmp_path):
    samples = read(write_1(tmp_path / "log.bag", ahead=3600.0))
    assert samples.epoch.timestamp() == START + 3600
    assert "time reference" in " ".join(samples.notes)


def test_bags_without_a_magnetometer_and_damaged_ones(tmp_path):
    path = tmp_path / "log.bag"
    with Writer1(path) as writer:
        kind = "std_msgs/msg/String"
        topic = writer.add_connection("/chatter", kind, typestore=ROS1)
        writer.write(topic, 1, ROS1.serialize_ros1(ROS1.types[kind]("hello"), kind))
    with pytest.raises(LogError, match=r"no topic of sensor_msgs/MagneticField in it \(/chatter\)"):
        read(path)
    whole = write_1(tmp_path / "whole.bag").read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(30):
        data = bytearray(whole[: int(rng.integers(20, len(whole)))])
        for at in rng.integers(13, len(data), 5):
            data[at] = int(rng.integers(0, 256))
        path.write_bytes(data)
        read_or_refused(open_log, path)


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "rows", "strength_nT"),
    [("sparkfun_razor", 2144, (45e3, 120e3)), ("phidgets_imu_upside_down", 6974, (34e3, 56e3))],
)
def test_recorded_bags(recordings, name, rows, strength_nT):
    (samples,) = open_log(recordings / f"ros/{name}.bag").sensors
    assert (samples.name, len(samples)) == ("imu/mag", rows)
    low, high = strength_nT
    assert low < np.median(np.linalg.norm(samples.field, axis=1)) < high
    gravity = np.median(np.linalg.norm(samples.acceleration, axis=1))
    assert gravity == pytest.approx(9.8, abs=0.4)
    assert samples.heading_deg is None  # nobody filled the orientation in
