"""ArduPilot parameters: signs, names, the scale band, and what the vehicle objects to."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.errors import AgonicError, LogError
from agonic.exports.ardupilot import compute_ardupilot_parameters, write_ardupilot
from tests.exports.read_back import apply_ardupilot, parse_ardupilot, turn_by_hand

MATRIX = np.array([[1.2, 0.03, -0.02], [0.03, 1.1, 0.05], [-0.02, 0.05, 1.0]])


def body(bias=(3000.0, -2000.0, 100.0), matrix=MATRIX):
    return Affine(bias=bias, matrix=matrix, frame_in="b", frame_out="b")


def test_offsets_are_minus_the_bias_in_milligauss():
    parameters, warnings = compute_ardupilot_parameters(body())
    assert [parameters[f"COMPASS_OFS_{a}"] for a in "XYZ"] == pytest.approx([-30.0, 20.0, -1.0])
    assert warnings == ()


def test_the_scale_is_split_from_the_matrix():
    parameters, _ = compute_ardupilot_parameters(body())
    assert parameters["COMPASS_SCALE"] == pytest.approx(1.1)
    assert parameters["COMPASS_DIA_X"] == pytest.approx(1.2 / 1.1)
    # ODI_X, Y, Z are xy, xz, yz: Matrix3f mat(dia.x, odi.x, odi.y, odi.x, dia.y, odi.z, …)
    odi = [parameters[f"COMPASS_ODI_{a}"] * 1.1 for a in "XYZ"]
    assert odi == pytest.approx([0.03, -0.02, 0.05])


def test_apply_is_the_firmwares_arithmetic():
    parameters = dict.fromkeys(compute_ardupilot_parameters(body())[0], 0.0)
    parameters |= {"COMPASS_OFS_X": 10.0, "COMPASS_DIA_X": 2.0, "COMPASS_DIA_Y": 1.0}
    parameters |= {"COMPASS_ODI_Z": 0.5, "COMPASS_SCALE": 1.25}
    assert apply_ardupilot(parameters, [90.0, 0.0, 8.0]).tolist() == [250.0, 5.0, 0.0]


@pytest.mark.parametrize("scale", [0.0, 0.66, 1.51, -1.0])
def test_a_scale_outside_the_band_counts_as_one(scale):
    parameters = compute_ardupilot_parameters(body())[0]
    one = apply_ardupilot(parameters | {"COMPASS_SCALE": 1.0}, [100.0, 200.0, 300.0])
    assert np.array_equal(
        apply_ardupilot(parameters | {"COMPASS_SCALE": scale}, [100.0, 200.0, 300.0]), one
    )


def test_all_zero_diagonals_count_as_one():
    zeros = dict.fromkeys(compute_ardupilot_parameters(body())[0], 0.0)
    assert apply_ardupilot(zeros, [1.0, 2.0, 3.0]).tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("gain", [0.5, 0.7, 1.4, 1.6, 2.5])
def test_any_gain_reaches_the_field(gain):
    parameters, warnings = compute_ardupilot_parameters(body(matrix=np.eye(3) * gain))
    inside = 1 / 1.5 <= gain <= 1.5
    assert parameters["COMPASS_SCALE"] == pytest.approx(gain if inside else 1.0)
    assert any("COMPASS_SCALE" in w for w in warnings) == (not inside)
    field = apply_ardupilot(parameters, [130.0, -20.0, 1.0])
    assert field == pytest.approx([100.0 * gain, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(("compass", "number"), [(1, ""), (2, "2"), (3, "3")])
def test_names_carry_the_number_of_the_compass(compass, number, tmp_path):
    export = write_ardupilot(body(), tmp_path / "mag.param", compass=compass)
    names = list(parse_ardupilot(export.path))
    assert names[0] == f"COMPASS_OFS{number}_X"
    assert names[3] == f"COMPASS_DIA{number}_X"
    assert names[-1] == f"COMPASS_SCALE{number}"
    assert len(names) == 10
    assert not any("MOT" in name or "DEV_ID" in name for name in names)


def test_there_is_no_fourth_compass(tmp_path):
    with pytest.raises(AgonicError, match="1, 2 or 3"):
        write_ardupilot(body(), tmp_path / "mag.param", compass=4)


def test_offsets_that_keep_the_vehicle_from_arming():
    assert any(
        "arm" in w for w in compute_ardupilot_parameters(body(bias=[110000, 110000, 110000]))[1]
    )
    assert not any(
        "arm" in w for w in compute_ardupilot_parameters(body(bias=[100000, 100000, 100000]))[1]
    )


def test_a_matrix_that_the_on_board_calibration_would_refuse():
    odd = np.diag([0.15, 1.4, 1.4])
    assert any("DIA" in w for w in compute_ardupilot_parameters(body(matrix=odd))[1])


def test_learning_is_warned_of_in_the_file(tmp_path):
    text = write_ardupilot(body(), tmp_path / "mag.param").path.read_text()
    assert "# Set COMPASS_LEARN 0" in text


def test_files_of_other_ground_stations_are_read(tmp_path):
    path = tmp_path / "mav.parm"
    path.write_text("# saved\nCOMPASS_OFS_X    -30.5  # mG\n\nCOMPASS_SCALE,1.1\n")
    assert parse_ardupilot(path) == {"COMPASS_OFS_X": -30.5, "COMPASS_SCALE": 1.1}


def test_a_damaged_row_is_named(tmp_path):
    path = tmp_path / "mag.param"
    path.write_text("COMPASS_OFS_X,1\nCOMPASS_OFS_Y,one\n")
    with pytest.raises(LogError, match="row 2"):
        parse_ardupilot(path)


def test_each_motor_of_the_first_compass_has_its_own_term(tmp_path) -> None:
    """By the formula of Compass_PerMotor.cpp: duty times voltage, to a power, milligauss."""
    rng = np.random.default_rng(5)
    names = tuple(f"motor{k}_duty^1.5" for k in range(1, 5))
    mag = Interference(
        bias=[2000.0, -3000.0, 1000.0],
        matrix=1.1 * np.eye(3) + 0.02,
        frame_in="b",
        frame_out="b",
        sources=names,
        coefficients=rng.normal(0, 3000, (3, 4)),
        typical=np.full(4, 0.3),
    )
    export = write_ardupilot(mag, tmp_path / "mag.param", voltage_V=15.2)
    parameters = parse_ardupilot(export.path)
    raw, duty = rng.normal(0, 30_000, (50, 3)), rng.uniform(0, 1, (50, 4))
    field = apply_ardupilot(parameters, raw / 100)
    for k in range(4):
        c = np.array([parameters[f"COMPASS_PMOT{k + 1}_{axis}"] for axis in "XYZ"])
        field += c * ((15.2 * duty[:, [k]]) ** parameters["COMPASS_PMOT_EXP"])
    wanted = mag.correct(raw, **{f"motor{k + 1}_duty": duty[:, k] for k in range(4)})
    assert np.abs(field * 100 - wanted).max() < 0.5
    assert parameters["COMPASS_PMOT_EN"] == 1
    assert "COMPASS_MOTCT" not in parameters
    assert any("first compass only" in warning for warning in export.warnings)


def test_motors_are_held_where_the_voltage_or_another_compass_leaves_no_term() -> None:
    mag = Interference(
        bias=np.zeros(3),
        matrix=np.eye(3),
        frame_in="b",
        frame_out="b",
        sources=("motor1_duty+motor2_duty^1.5",),
        coefficients=[[1000.0], [0.0], [0.0]],
        typical=[0.5],
    )
    parameters, warnings = compute_ardupilot_parameters(mag)
    assert parameters["COMPASS_OFS_X"] == pytest.approx(-5.0)
    assert any("--voltage" in warning for warning in warnings)
    second, said = compute_ardupilot_parameters(mag, compass=2, voltage_V=15.0)
    assert not any("PMOT" in name for name in second)
    assert any("held at their average" in warning for warning in said)
    both, _ = compute_ardupilot_parameters(mag, voltage_V=4.0)
    assert both["COMPASS_PMOT1_X"] == both["COMPASS_PMOT2_X"] == pytest.approx(-10 / 8)
    assert both["COMPASS_PMOT3_X"] == 0
    with pytest.raises(AgonicError, match="battery"):
        compute_ardupilot_parameters(mag, voltage_V=-1.0)


@pytest.mark.parametrize("compass", [1, 2])
def test_a_compass_at_any_angle_gets_an_orientation_of_its_own(compass: int) -> None:
    """AP_Compass turns the reading first (rotate_field), then corrects it in body axes."""
    turn = turn_by_hand(roll=5.0, pitch=12.0, yaw=-30.0)
    own = Affine(bias=(3000.0, -2000.0, 100.0), matrix=turn @ MATRIX, gauge="free", frame_out="b")
    found, warnings = compute_ardupilot_parameters(own, compass=compass)
    assert found[f"COMPASS_ORIENT{'' if compass == 1 else compass}"] == 100 + compass
    assert found["CUST_ROT_ENABLE"] == 1
    assert not any("orientation" in text for text in warnings)
    angles = {n.lower(): found[f"CUST_ROT{compass}_{n}"] for n in ("YAW", "PITCH", "ROLL")}
    raw = np.array([[20_000.0, 5000.0, -30_000.0], [-40_000.0, 100.0, 9000.0]])
    turned = raw / 100.0 @ turn_by_hand(**angles).T
    seen = apply_ardupilot(found, turned, compass=compass)
    assert 100.0 * seen == pytest.approx(own.correct(raw), abs=0.5)


def test_an_orientation_by_right_angles_stays_the_vehicles() -> None:
    turn = Rotation.from_euler("ZYX", [91.0, 0.0, 1.0], degrees=True).as_matrix()
    own = Affine(bias=(0.0, 0.0, 0.0), matrix=turn @ MATRIX, gauge="free", frame_out="b")
    found, warnings = compute_ardupilot_parameters(own)
    assert "COMPASS_ORIENT" not in found
    assert any("set its sensor orientation" in text for text in warnings)
