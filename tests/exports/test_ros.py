"""ROS parameters: tesla, row by row, and floats that every YAML reader takes for floats."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.errors import AgonicError, LogError
from agonic.exports.ros import write_ros
from tests.exports.read_back import parse_ros, turn_by_hand

MATRIX = np.array([[1.0, 0.25, 1e-7], [0.0, 2.0, 0.0], [0.0, -1.5, 3.0]])
MAG = Affine(bias=[10000.0, -25000.0, 0.0], matrix=MATRIX)


def test_bias_in_tesla_and_matrix_row_by_row(tmp_path):
    text = write_ros(MAG, tmp_path / "mag.yaml").path.read_text()
    assert "    initial_mag_bias_x: 1.0e-05\n    initial_mag_bias_y: -2.5e-05\n" in text
    assert "    initial_mag_bias_z: 0.0\n" in text
    assert "[1.0, 0.25, 1.0e-07, 0.0, 2.0, 0.0, 0.0, -1.5, 3.0]" in text


@pytest.mark.parametrize("ros", [1, 2])
def test_yaml_readers_see_floats(ros, tmp_path):
    yaml = pytest.importorskip("yaml")
    parameters = yaml.safe_load(write_ros(MAG, tmp_path / "mag.yaml", ros=ros).path.read_text())
    if ros == 2:
        parameters = parameters["/**"]["ros__parameters"]
    matrix = parameters.pop("initial_mag_scaling_matrix")
    assert all(type(value) is float for value in (*matrix, *parameters.values()))
    assert np.array_equal(np.reshape(matrix, (3, 3)), MATRIX)


def test_a_mounting_stays_with_tf(tmp_path):
    turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    upright = Affine(bias=[1000.0, 0, 0], matrix=np.diag([1.1, 1.2, 1.3]))
    export = write_ros(Chain(steps=(upright, turn)), tmp_path / "mag.yaml")
    matrix = parse_ros(export.path)["initial_mag_scaling_matrix"]
    assert np.allclose(np.reshape(matrix, (3, 3)), upright.matrix)
    assert any("90.00 deg" in w for w in export.warnings)


@pytest.mark.parametrize("ros", [1, 2])
def test_a_turn_at_any_angle_is_a_static_transform(ros, tmp_path):
    """Products of plane rotations by hand: tf's quaternion turns sensor axes into the parent's."""
    turn = turn_by_hand(roll=5.0, pitch=12.0, yaw=-30.0)
    own = Affine(bias=[3000.0, 0, 0], matrix=turn @ np.diag([1.1, 0.9, 1.0]), gauge="free",
                 frame_out="b")  # fmt: skip
    export = write_ros(own, tmp_path / "mag.yaml", ros=ros)
    (row,) = [row for row in export.path.read_text().splitlines() if "static_transform_p" in row]
    assert row.startswith("# ros2 run" if ros == 2 else "# rosrun")
    numbers = re.findall(r"(?<![\w.])-?\d\.\d{9}", row)
    x, y, z, w = map(float, numbers)
    raw = np.array([20_000.0, -5000.0, 43_000.0])
    matrix = np.reshape(parse_ros(export.path)["initial_mag_scaling_matrix"], (3, 3))
    v, u = matrix @ (raw - own.bias), np.array([x, y, z])
    turned = v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))
    assert turned == pytest.approx(own.correct(raw[np.newaxis])[0], abs=0.01)
    assert any("belongs to tf" in text for text in export.warnings)


def test_there_is_no_ros_3(tmp_path):
    with pytest.raises(AgonicError):
        write_ros(MAG, tmp_path / "mag.yaml", ros=3)


@pytest.mark.parametrize(
    "text", ["", "initial_mag_bias_x: one\n", "initial_mag_bias_x: 1.0\n", "a: [1, 2]\n"]
)
def test_incomplete_files_are_refused(text, tmp_path):
    path = tmp_path / "mag.yaml"
    path.write_text(text)
    with pytest.raises(LogError):
        parse_ros(path)
