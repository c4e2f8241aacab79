"""MATLAB files of both kinds, and the BROAD data set with its attitude."""

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from agonic.errors import LogError, MissingExtraError
from agonic.logs import broad
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
    """Lying face up with x to the east, then turned 90° to the left, so that x is north.

    Up is −down: a sensor whose z is up hangs upside down in north, east, down, a roll of 180°.
    """
    quarter = np.sqrt(0.5)
    roll, pitch, heading = broad.compute_attitude_deg(
        np.array([[1, 0, 0, 0], [quarter, 0, 0, quarter]])
    )
    np.testing.assert_allclose(np.abs(roll), 180, atol=1e-9)
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
    held = broad.hold_at_rest(seen, moving=t > 1)
    np.testing.assert_allclose(held[:90], true[:90])
    filled = broad.fill_short_gaps(held, t)
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


@pytest.mark.recordings
def test_broad_loses_no_reading(recordings):
    from scipy.io import loadmat

    for trial in TRIALS:
        path = recordings / f"vehicle/broad/{trial}.mat"
        samples = read(path)
        np.testing.assert_array_equal(samples.field, loadmat(path)["imu_mag"] * 1e3)
        lost = int(np.isnan(loadmat(path)["opt_quat"]).any(axis=1).sum())
        assert f"{lost} rows have no optical attitude" in " ".join(samples.notes)
        assert samples.heading_deg is not None
