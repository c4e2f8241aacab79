"""MATLAB files of both kinds, and the BROAD data set with its attitude."""

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from agonic.errors import LogError, MissingExtraError
from agonic.logs.arrays import stacked
from agonic.logs.read import open_log, read

FIELD = np.arange(15.0).reshape(5, 3)
TRIALS = (
    "02_undisturbed_slow_rotation_B",
    "07_undisturbed_fast_rotation_B",
    "12_undisturbed_slow_translation_C",
    "34_disturbed_attached_magnet_3cm",
)


def ned_from_sensor(samples):
    """The rotation that roll, pitch and heading stand for."""
    angles = np.stack([samples.heading_deg, samples.pitch_deg, samples.roll_deg], axis=1)
    return Rotation.from_euler("ZYX", angles, degrees=True)


@pytest.fixture
def version_7_3(tmp_path):
    """Writes arrays as MATLAB 7.3 does: HDF5 behind a block of text, axes reversed."""
    h5py = pytest.importorskip("h5py")

    def write(**arrays):
        path = tmp_path / "log.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, array in arrays.items():
                file[name] = np.asarray(array).T
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
        return path

    return write


@pytest.mark.parametrize("mag", [FIELD, FIELD.T], ids=["rows", "columns"])
def test_version_5(tmp_path, mag):
    path = tmp_path / "log.mat"
    savemat(path, {"imu": {"mag": mag, "gyr_deg_s": mag * 0 + 90, "note": "text"}, "fs": 50.0})
    samples = read(path, unit="uT")
    np.testing.assert_array_equal(samples.field, FIELD * 1e3)
    np.testing.assert_allclose(samples.rotation_rate, np.pi / 2)
    np.testing.assert_allclose(samples.time, np.arange(5) / 50)
    assert read(path).unit == "raw"


def test_version_7_3(version_7_3):
    samples = read(version_7_3(mag_uT=FIELD, time=np.arange(5)[:, None] / 8, image=np.eye(7)))
    np.testing.assert_array_equal(samples.field, FIELD * 1e3)
    np.testing.assert_array_equal(samples.time, np.arange(5) / 8)
    square = np.arange(9.0).reshape(3, 3)
    np.testing.assert_array_equal(read(version_7_3(mag=square)).field, square)


def test_version_7_3_without_h5py(version_7_3, monkeypatch):
    path = version_7_3(mag=FIELD)
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[space\]"):
        read(path)


@pytest.mark.slow
def test_what_is_no_log(tmp_path, version_7_3):
    path = tmp_path / "other.mat"
    savemat(path, {"picture": np.eye(4)})
    with pytest.raises(LogError, match=r"no magnetometer columns found among 'picture'"):
        open_log(path)
    savemat(path, {f"v{i}": 1.0 for i in range(4200)})
    with pytest.raises(LogError, match="more than 4096 variables"):
        open_log(path)
    with pytest.raises(LogError, match="more than 4096 variables"):
        open_log(version_7_3(**{f"v{i}": 1.0 for i in range(4200)}))


def test_attitude_of_one_right_angle():
    """Lying face up with x to the east, then turned 90° to the left, so that x is north: level."""
    quarter = np.sqrt(0.5)
    roll, pitch, heading = stacked.compute_attitude_deg(
        np.array([[1, 0, 0, 0], [quarter, 0, 0, quarter]])
    )
    np.testing.assert_allclose(roll, 0, atol=1e-9)
    np.testing.assert_allclose(pitch, 0, atol=1e-9)
    np.testing.assert_allclose(
        [np.cos(np.radians(heading)), np.sin(np.radians(heading))], [[0, 1], [1, 0]], atol=1e-9
    )


def test_attitude_is_held_at_rest_and_interpolated_over_short_gaps():
    t = np.arange(400) / 100
    angle = np.clip(t - 1, 0, None) * 60  # at rest for a second, then 60°/s
    true = Rotation.from_euler("z", angle[:, None], degrees=True).as_quat(scalar_first=True)
    seen = true.copy()
    seen[:90] = seen[150:180] = seen[250:380] = np.nan
    held = stacked.fill_at_rest(seen, moving=t > 1)
    np.testing.assert_allclose(held[:90], true[:90])
    filled = stacked.fill_short_gaps(held, t)
    np.testing.assert_allclose(filled[:250], true[:250], atol=1e-9)
    middle = np.isnan(filled[:, 0])
    assert middle.any()
    assert middle[250 + 50 : 380 - 50].all()


@pytest.mark.recordings
@pytest.mark.parametrize("trial", TRIALS)
def test_broad_recording(recordings, trial):
    """Order and direction of the attitude, against gravity and the field itself."""
    log = open_log(recordings / f"vehicle/broad/{trial}.mat")
    samples = log.sensors[0]
    assert (log.format, samples.unit, dict(samples.rejected)) == ("MATLAB file", "nT", {})
    assert np.diff(samples.time) == pytest.approx(0.0035, rel=1e-6)
    assert "optical" in " ".join(samples.notes)
    rot_nm = ned_from_sensor(samples)
    force = rot_nm.apply(samples.acceleration.copy())  # SciPy wants arrays that it could write to
    np.testing.assert_allclose(np.median(force, axis=0), [0, 0, -9.82], atol=0.05)
    still = np.linalg.norm(samples.rotation_rate, axis=1) < np.radians(2)
    np.testing.assert_allclose(force[still].mean(axis=0), [0, 0, -9.82], atol=0.05)
    field = rot_nm.apply(samples.field.copy())
    north, east, down = np.median(field, axis=0)
    assert np.degrees(np.arctan2(down, north)) == pytest.approx(68.5, abs=2)  # Berlin's inclination
    assert abs(east) < 0.05 * north
    # a wrong order or direction lets the field turn with the sensor; the right one keeps it
    if "rotation" in trial:
        moving = samples.field[~still]
        assert rot_nm[~still].apply(moving).std(axis=0).max() < 5000
        assert rot_nm[~still].apply(moving, inverse=True).std(axis=0).min() > 10000


@pytest.mark.slow
@pytest.mark.recordings
def test_broad_loses_no_reading(recordings):
    from scipy.io import loadmat

    for trial in TRIALS:
        path = recordings / f"vehicle/broad/{trial}.mat"
        samples = read(path)
        forward_right_down = loadmat(path)["imu_mag"] * [1e3, -1e3, -1e3]
        np.testing.assert_allclose(samples.field, forward_right_down, rtol=1e-12)
        lost = int(np.isnan(loadmat(path)["opt_quat"]).any(axis=1).sum())
        assert f"{lost} rows have no optical attitude" in " ".join(samples.notes)
        assert samples.heading_deg is not None


def test_an_array_of_structures_is_a_table_of_rows(tmp_path):
    """One reading each: `log(k).mag`; texts in it, and gaps, do no harm."""
    field = np.random.default_rng(2).normal(0, 30, (20, 3))
    rows = np.zeros((1, 20), dtype=[("t_s", "O"), ("mag_uT", "O"), ("note", "O")])
    for k in range(20):
        rows[0, k] = (k * 0.1, field[k] if k != 7 else [], "x")
    savemat(tmp_path / "log.mat", {"log": rows})
    samples = read(tmp_path / "log.mat")
    np.testing.assert_allclose(samples.field, np.delete(field, 7, axis=0) * 1e3)
    np.testing.assert_allclose(samples.time, np.delete(np.arange(20) * 0.1, 7))


def test_structures_with_clocks_and_lengths_of_their_own(tmp_path):
    """Two magnetometers and an accelerometer, each at its own rate, in structures."""
    t1, t2, ta = np.arange(20) / 10, np.arange(50) / 25, np.arange(200) / 100
    first = np.column_stack([np.sin(t1), np.cos(t1), t1])
    second = np.column_stack([np.cos(t2), np.sin(t2), -t2])
    acc = np.column_stack([0 * ta, 0 * ta, 9.8 + ta])
    path = tmp_path / "log.mat"
    savemat(
        path,
        {
            "left": {"t": t1, "mag_uT": first},
            "right": {"t": t2, "mag_uT": second},
            "imu": {"t": ta, "acc_m_s2": acc},
        },
    )
    log = open_log(path)
    assert [samples.name for samples in log.sensors] == ["left", "right"]
    for samples, time, field in zip(log.sensors, (t1, t2), (first, second), strict=True):
        np.testing.assert_allclose(samples.time, time)
        np.testing.assert_allclose(samples.field, field * 1e3)
        np.testing.assert_allclose(samples.acceleration[:, 2], 9.8 + time, atol=1e-9)


def test_a_lone_matrix_is_taken_for_a_magnetometer_and_says_so(tmp_path):
    path = tmp_path / "cloud.mat"
    savemat(path, {"data": FIELD, "n": 5})
    samples = read(path)
    np.testing.assert_array_equal(samples.field, FIELD)
    assert samples.unit == "raw"
    assert "no column is named for a magnetometer" in " ".join(samples.notes)
    for other in ({"hard_iron_offset": FIELD}, {"acc": FIELD}, {"one": FIELD, "two": FIELD}):
        savemat(path, other)
        with pytest.raises(LogError, match="no magnetometer columns found"):
            read(path)


def test_export_of_mission_planner(tmp_path):
    """Messages as matrices with labels: the same readings as from the dataflash log."""
    bias, raw = np.array([120.0, -80.0, 45.0]), FIELD * 10 + 200
    mag = np.column_stack([np.arange(5) + 7, np.arange(5) * 1e5, raw + bias, np.tile(bias, (5, 1))])
    labels = ["LineNo", "TimeUS", *(f"Mag{a}" for a in "XYZ"), *(f"Ofs{a}" for a in "XYZ")]
    att = np.column_stack([np.arange(9), np.arange(9) * 5e4, np.tile([3.0, -4.0, 50.0], (9, 1))])
    path = tmp_path / "log.mat"
    cells = {
        "MAG": mag,
        "MAG_label": np.array(labels, dtype=object)[:, None],
        "ATT": att,
        "ATT_label": np.array(["LineNo", "TimeUS", "Roll", "Pitch", "Yaw"], dtype=object)[:, None],
        "PARM": np.array([["COMPASS_SCALE", 0.0], ["COMPASS_DIA_X", 0.0]], dtype=object),
    }
    savemat(path, cells)
    log = open_log(path)
    assert (log.stack, log.sensors[0].name, log.sensors[0].frame) == ("ardupilot", "MAG", "b")
    samples = log.sensors[0]
    np.testing.assert_allclose(samples.field, raw * 100)
    np.testing.assert_allclose(samples.logged.bias, -bias * 100)
    np.testing.assert_allclose(samples.time, np.arange(5) / 10)
    np.testing.assert_allclose(samples.heading_deg, 50)
    assert samples.heading_estimated


def test_texts_that_mission_planner_writes_as_zeros(tmp_path):
    mag = np.column_stack([np.arange(5), np.arange(5) * 1e5, FIELD * 10 + 200])
    labels = [["LineNo", "TimeUS", "MagX", "MagY", "MagZ"], ["LineNo", "TimeUS", "Message"]]
    first, second = (np.array(names, dtype=object)[:, None] for names in labels)
    path = tmp_path / "log.mat"
    savemat(path, {"MAG": mag, "MAG_label": first, "MSG": np.zeros((4, 3)), "MSG_label": second})
    np.testing.assert_allclose(read(path).field, (FIELD * 10 + 200) * 100)


def test_telemetry_exported_by_mission_planner(tmp_path):
    """A matrix for each field of a message: the day, as MATLAB counts them, and the value."""
    days = 739_680.5 + np.arange(5) * 0.1 / 86_400
    fields = {
        **{f"{a}mag_mavlink_raw_imu_t": FIELD[:, k] for k, a in enumerate("xyz")},
        **{f"{a}gyro_mavlink_raw_imu_t": FIELD[:, k] * 100 for k, a in enumerate("xyz")},
        "time_usec_mavlink_raw_imu_t": np.arange(5) * 1e5,
        "roll_mavlink_attitude_t": np.full(5, np.pi / 6),
        "time_boot_ms_mavlink_attitude_t": np.arange(5) * 100.0,
        "custom_mode_mavlink_heartbeat_t": np.zeros(5),
    }
    path = tmp_path / "log.tlog.mat"
    savemat(path, {name: np.column_stack([days, values]) for name, values in fields.items()})
    samples = read(path)
    assert (samples.name, samples.corrected) == ("RAW_IMU", True)
    np.testing.assert_allclose(samples.field, FIELD * 100)
    np.testing.assert_allclose(samples.rotation_rate, FIELD / 10)
    np.testing.assert_allclose(samples.roll_deg, 30)
    np.testing.assert_allclose(samples.time - samples.time[0], np.arange(5) / 10, atol=1e-3)


def test_broad_in_hdf5(tmp_path):
    """The data set comes as HDF5 too, with its sampling rate beside the arrays."""
    h5py = pytest.importorskip("h5py")
    turn = Rotation.from_euler("z", np.linspace(0, 90, 40)[:, None], degrees=True)
    arrays = {
        "imu_mag": turn.inv().apply([0.0, 20.0, -40.0]),
        "imu_acc": np.tile([0, 0, 9.8], (40, 1)),
        "imu_gyr": np.zeros((40, 3)),
        "opt_quat": turn.as_quat(scalar_first=True),
        "movement": np.ones(40, bool),
    }
    for rate_in_attribute in (True, False):
        path = tmp_path / f"trial_{rate_in_attribute}.hdf5"
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values
            if rate_in_attribute:
                file.attrs["sampling_rate"] = 2000 / 7
            else:
                file["sampling_rate"] = 2000 / 7
        samples = read(path)
        np.testing.assert_allclose(np.diff(samples.time), 7 / 2000, atol=1e-12)
        north = ned_from_sensor(samples).apply(np.array(samples.field))
        np.testing.assert_allclose(north, np.tile([20_000, 0, 40_000], (40, 1)), atol=1e-6)


@pytest.mark.recordings
def test_recorded_matrices_of_one_sensor_a_file(recordings):
    """HMC5883L as (n, 4), the time first; the file of the accelerometer is refused."""
    samples = read(recordings / "imu/hmc5883l_compass.mat", unit="G")
    assert len(samples) > 8100
    np.testing.assert_allclose(
        samples.field[0], np.array([0.24128440, -0.33761468, -0.38899083]) * 1e5, rtol=1e-6
    )
    assert samples.time[1] - samples.time[0] == pytest.approx(0.0022908, abs=1e-6)
    with pytest.raises(LogError, match="no magnetometer columns found"):
        read(recordings / "imu/mpu6050_accelerometer.mat")
