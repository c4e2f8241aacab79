"""PX4 parameters: signs, names, types, and what PX4 would not take over."""

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.errors import AgonicError, LogError
from agonic.exports.px4 import compute_px4_parameters, write_px4
from tests.exports.read_back import apply_px4, parse_px4, turn_by_hand

MATRIX = np.array([[1.2, 0.03, -0.02], [0.03, 1.1, 0.05], [-0.02, 0.05, 1.0]])
MAG = Affine(bias=[3000.0, -2000.0, 100.0], matrix=MATRIX)


def test_offsets_are_the_bias_in_gauss():
    parameters, _ = compute_px4_parameters(MAG)
    assert [parameters[f"CAL_MAG0_{a}OFF"] for a in "XYZ"] == pytest.approx([0.03, -0.02, 0.001])


def test_the_whole_matrix_is_in_scale_and_off_diagonals():
    parameters, _ = compute_px4_parameters(MAG, slot=2)
    assert [parameters[f"CAL_MAG2_{a}SCALE"] for a in "XYZ"] == pytest.approx([1.2, 1.1, 1.0])
    # set_offdiagonal: x is (0, 1), y is (0, 2), z is (1, 2)
    off = [parameters[f"CAL_MAG2_{a}ODIAG"] for a in "XYZ"]
    assert off == pytest.approx([0.03, -0.02, 0.05])


def test_apply_subtracts_then_multiplies():
    parameters = dict.fromkeys(compute_px4_parameters(MAG)[0], 0.0)
    parameters |= {"CAL_MAG0_XOFF": 0.1, "CAL_MAG0_XSCALE": 2.0, "CAL_MAG0_YODIAG": 0.5}
    assert apply_px4(parameters, [0.6, 0.0, 0.2]) == pytest.approx([1.1, 0.0, 0.25])


def test_rows_are_those_of_a_ground_station(tmp_path):
    export = write_px4(MAG, tmp_path / "mag.params", slot=1, device_id=396809, rotation=-1)
    lines = export.path.read_text().splitlines()
    rows = [line for line in lines if not line.startswith("#")]
    assert "# Vehicle-Id Component-Id Name Value Type" in lines
    assert rows[:3] == [
        "1\t1\tCAL_MAG1_ID\t396809\t6",
        "1\t1\tCAL_MAG1_ROT\t-1\t6",
        "1\t1\tCAL_MAG1_XOFF\t0.03\t9",
    ]
    assert len(rows) == 11
    assert parse_px4(export.path)["CAL_MAG1_ID"] == 396809


def test_a_device_id_above_31_bits_is_a_negative_parameter():
    parameters, _ = compute_px4_parameters(MAG, device_id=2**31 + 5)
    assert parameters["CAL_MAG0_ID"] == 5 - 2**31


def test_numpy_integers_are_integers(tmp_path):
    export = write_px4(
        MAG, tmp_path / "mag.params", device_id=np.uint32(396809), rotation=np.int8(4)
    )
    text = export.path.read_text()
    assert "CAL_MAG0_ID\t396809\t6" in text
    assert "CAL_MAG0_ROT\t4\t6" in text


def test_without_the_id_the_slot_is_ignored():
    assert any("CAL_MAG3_ID" in w for w in compute_px4_parameters(MAG, slot=3)[1])
    assert not any("CAL_MAG3_ID" in w for w in compute_px4_parameters(MAG, slot=3, device_id=1)[1])


def test_automatic_calibration_is_warned_of():
    assert any("SENS_MAG_AUTOCAL" in w for w in compute_px4_parameters(MAG, device_id=1)[1])


@pytest.mark.parametrize(
    ("bias", "diagonal", "ignored"),
    [
        ([0, 0, 0], [1, 1, 1], []),  # nothing to take over
        ([900, 0, 0], [1, 1, 1], ["offset"]),
        ([900, 900, 0], [1, 1, 1], []),
        ([5000, 0, 0], [1.005, 0.996, 1.004], ["scale"]),
        ([5000, 0, 0], [1.02, 1, 1], []),
    ],
)
def test_corrections_below_the_dead_band_are_named(bias, diagonal, ignored):
    warnings = compute_px4_parameters(Affine(bias=bias, matrix=np.diag(diagonal)), device_id=1)[1]
    named = [w.split()[1] for w in warnings if "may be ignored" in w]
    assert named == ignored


def test_small_off_diagonals_are_below_the_dead_band():
    matrix = np.array([[1.1, 0.004, 0], [0.004, 1.0, 0], [0, 0, 1.0]])
    warnings = compute_px4_parameters(Affine(bias=[5000, 0, 0], matrix=matrix), device_id=1)[1]
    assert any("off-diagonal correction of 0.0040" in w for w in warnings)


def test_scale_limits():
    far = Affine(bias=[5000, 0, 0], matrix=np.diag([3.2, 1.0, 1.0]))
    assert any("limits" in w for w in compute_px4_parameters(far)[1])
    assert not any("limits" in w for w in compute_px4_parameters(MAG)[1])


@pytest.mark.parametrize("wrong", [{"slot": 4}, {"device_id": 0}, {"device_id": 2**32}])
def test_impossible_places_are_refused(wrong, tmp_path):
    with pytest.raises(AgonicError):
        write_px4(MAG, tmp_path / "mag.params", **wrong)


def test_a_damaged_row_is_named(tmp_path):
    path = tmp_path / "mag.params"
    path.write_text("# x\n1\t1\tCAL_MAG0_XOFF\t0.1\n")
    with pytest.raises(LogError, match="row 2"):
        parse_px4(path)


def test_a_sensor_at_any_angle_gets_angles_of_its_own() -> None:
    """PX4 corrects the reading in sensor axes, then turns it (SensorCalibration, Magnetometer)."""
    turn = turn_by_hand(roll=35.0, pitch=-12.0, yaw=140.0)
    matrix = np.array([[1.1, 0.02, 0.0], [0.02, 0.97, 0.01], [0.0, 0.01, 1.0]])
    own = Affine(bias=(3000.0, -2000.0, 100.0), matrix=turn @ matrix, gauge="free", frame_out="b")
    found, _ = compute_px4_parameters(own, slot=1, device_id=5)
    assert found["CAL_MAG1_ROT"] == 100
    angles = {name.lower(): found[f"CAL_MAG1_{name}"] for name in ("YAW", "PITCH", "ROLL")}
    raw = np.array([[20_000.0, 5000.0, -30_000.0], [-40_000.0, 100.0, 9000.0]])
    seen = apply_px4(found, raw / 1e5, slot=1)
    body = seen @ turn_by_hand(**angles).T
    assert 1e5 * body == pytest.approx(own.correct(raw), abs=0.5)
