"""`calibrate --mounting`: a sensor by right angles in its vehicle; its file takes raw readings."""

import numpy as np
import pytest
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.interference import turn_calibration, turn_field
from agonic.console.parse import parse_mounting
from agonic.exports.csv import write_csv
from agonic.recording.calibrated import calibrate_as_named
from agonic.recording.mounting import calibrate, find_turn, turn_back, turn_readings
from agonic.simulation import simulate
from tests.command_line import answer
from tests.inertial.drives import drive

MOUNTED = "x up, y forward"


def flown(seed: int = 3, **place):
    """A flight whose sensor sits with x up and y forward, and the field in the body."""
    made = simulate(
        "flight", n=3000, rate_Hz=25.0, noise=50.0, stray_nT_A=(0.0,) * 3, seed=seed, **place
    )
    bare = dict.fromkeys(("heading_deg", "current_A", "throttle", "acceleration", "rotation_rate"))
    turn = parse_mounting(MOUNTED)
    samples = made.samples.with_columns(field=made.samples.field @ turn, **bare)
    return samples, made.field_b, ag.Reference.vector(made.field_n, frame="n"), turn


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("x up, y forward", [[0, 0, -1], [1, 0, 0], [0, -1, 0]]),
        ("x points up, y forward, z left", [[0, 0, -1], [1, 0, 0], [0, -1, 0]]),
        ("Z up, X forward", [[1, 0, 0], [0, -1, 0], [0, 0, -1]]),
    ],
)
def test_words_say_where_axes_point(text: str, columns: list[list[int]]) -> None:
    assert parse_mounting(text).T.tolist() == columns


@pytest.mark.parametrize("text", ["", "x up", "x up, x down", "x up, y upwards", "x up; y left"])
def test_words_that_are_not_understood(text: str) -> None:
    with pytest.raises(ag.AgonicError, match="is not understood"):
        parse_mounting(text)


@pytest.mark.parametrize("text", ["x up, y down", "x forward, y right, z up"])
def test_mountings_that_cannot_be(text: str) -> None:
    with pytest.raises(ag.AgonicError, match="is not a mounting"):
        parse_mounting(text)


@pytest.mark.slow
def test_the_calibration_takes_readings_as_they_are_logged() -> None:
    samples, field_b, place, turn = flown()
    assert calibrate_as_named(samples, place).method == "ellipsoid"  # in axes of its own
    result = turn_back(ag.calibrate(turn_readings(samples, turn), place), turn)
    assert (result.method, result.verdict) == ("levelled", "good")
    assert "x points up, y forward, z left" in result.reason
    found = result.calibration
    np.testing.assert_allclose(result.samples.field, samples.field, atol=1e-6)
    assert (found.frame_in, found.frame_out) == ("m", "b")
    off = (found.correct(samples.field) - field_b).mean(axis=0)
    assert np.abs(off).max() < 60.0


def test_its_uncertainty_is_that_of_the_turned_readings() -> None:
    samples, _, place, turn = flown()
    samples = samples.with_columns(current_A=np.random.default_rng(0).uniform(0, 9, len(samples)))
    turned = turn_readings(samples, turn)
    fit = ag.fit_interference(turned, place)
    back = turn_calibration(fit.calibration, turn)
    some, current = slice(0, 50), samples.current_A[:50]
    np.testing.assert_allclose(
        back.correct(samples.field[some], current_A=current),
        fit.calibration.correct(turned.field[some], current_A=current),
    )
    np.testing.assert_allclose(
        back.uncertainty(samples.field[some], current_A=current),
        fit.calibration.uncertainty(turned.field[some], current_A=current),
    )


def test_a_field_that_is_turned_keeps_its_uncertainty() -> None:
    samples, _, _, turn = flown()
    own = ag.fit_ellipsoid(samples, ag.Reference.constant(48_000.0)).calibration
    turned, some = turn_field(own, turn), samples.field[:50]
    np.testing.assert_allclose(turned.correct(some), own.correct(some) @ turn.T)
    wanted = turn @ own.uncertainty(some) @ turn.T
    np.testing.assert_allclose(turned.uncertainty(some), wanted, atol=1e-6 * np.abs(wanted).max())


def test_readings_in_body_axes_need_another_orientation_instead() -> None:
    samples, _, _, turn = flown()
    with pytest.raises(ag.AgonicError, match="body axes"):
        turn_readings(samples.with_columns(frame="b"), turn)


def test_a_mounting_that_is_certain_is_applied_and_told() -> None:
    samples, field_b, place, _ = flown()
    result = calibrate(samples, place)
    assert (result.method, result.verdict) == ("levelled", "good")
    assert "x points up, y forward, z left" in result.status
    off = (result.calibration.correct(samples.field) - field_b).mean(axis=0)
    assert np.abs(off).max() < 60.0
    plain = samples.with_columns(field=samples.field @ parse_mounting(MOUNTED).T)
    assert find_turn(plain, place) is None


@pytest.mark.slow
def test_a_mounting_is_applied_only_where_dip_and_axes_agree() -> None:
    """Roll counted the wrong way round looks like a sensor that lies on its back."""
    samples, _, place, turn = flown()
    plain = samples.with_columns(field=samples.field @ turn.T)
    banked = calibrate(plain.with_columns(roll_deg=-plain.roll_deg), place)
    assert banked.method == "ellipsoid"  # in axes of its own
    assert "is mounted so that" not in banked.status
    assert find_turn(samples, ag.Reference.constant(50_000.0)) is None


@pytest.mark.slow
def test_beside_an_accelerometer_the_axes_are_those_of_it() -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000)
    turn = parse_mounting("x backward, y right")
    result = calibrate(logged.with_columns(field=logged.field @ turn), place)
    assert (result.method, result.verdict) == ("inertial", "good")
    assert "x points backward, y right, z up" in result.status
    off = result.calibration.correct(logged.field @ turn) - made.field_b
    assert np.degrees(np.linalg.norm(off.mean(axis=0)) / 50_000.0) < 2.0


def test_from_the_command_line(tmp_path, capsys) -> None:
    field = np.ravel(ag.igrf().at(47.0, 8.0, 500.0, "2026-05-01").field_n)
    size, level = np.linalg.norm(field), np.hypot(*field[:2])
    dip = np.degrees(np.arctan2(field[2], level))
    samples, field_b, _, _ = flown(magnitude=size, inclination_deg=dip)
    log, folder = str(write_csv(samples, tmp_path / "flown.csv")), tmp_path / "out"
    asked = ("calibrate", log, "--date", "2026-05-01", "-o", str(folder))
    status, said = answer(capsys, *asked, "--mounting", MOUNTED)
    assert (status, said["sensors"][0]["method"]) == (0, "levelled")
    found = ag.load(folder / "mag.json")
    assert (found.frame_in, found.frame_out) == ("m", "b")
    along = found.correct(samples.field)
    cosine = (along * field_b).sum(axis=1) / np.linalg.norm(along, axis=1) / size
    assert np.degrees(np.arccos(np.minimum(cosine, 1.0))).mean() < 0.5


@pytest.mark.parametrize("angle_deg", [-30.0, 10.0, 60.0])
def test_a_compass_at_any_angle_beside_accelerometer_and_gyro(angle_deg: float) -> None:
    """The magnitude alone is sure, and does not see the turn: heading off by the whole angle."""
    made = simulate("tumble", n=3000, rate_Hz=50.0, noise=100.0, seed=6)
    turn = Rotation.from_euler("ZYX", [angle_deg, 5.0, -8.0], degrees=True).as_matrix()
    result = calibrate(made.samples.with_columns(field=made.samples.field @ turn))
    assert (result.method, result.verdict) == ("ellipsoid", "good")
    assert "is turned in the vehicle (roll −8." in result.status or "(roll −7." in result.status
    assert result.fit.accuracy is not None
    assert result.fit.accuracy.vehicle_deg is not None
    found = polar(result.calibration.matrix)[0]
    left = Rotation.from_matrix(found @ turn.T).magnitude()
    assert np.degrees(left) < 4 * result.fit.accuracy.vehicle_deg < 4.0
    assert result.calibration.frame_out == "b"


def test_a_compass_at_any_angle_beside_roll_and_pitch_with_a_place() -> None:
    """It fell to the magnitude alone before, silently."""
    samples, field_b, place, right_angles = flown()
    body = samples.field @ right_angles.T
    turn = Rotation.from_euler("ZYX", [30.0, 0.0, 0.0], degrees=True).as_matrix()
    result = calibrate(samples.with_columns(field=body @ turn), place)
    assert (result.method, result.verdict) == ("levelled", "good")
    assert "yaw 30." in result.status or "yaw 29." in result.status
    off = (result.calibration.correct(body @ turn) - field_b).mean(axis=0)
    assert np.abs(off).max() < 60.0


def test_an_orientation_that_the_autopilot_was_given_wrongly_is_named() -> None:
    samples, field_b, place, right_angles = flown()
    turn = Rotation.from_euler("z", 45.0, degrees=True).as_matrix()
    body = samples.field @ right_angles.T
    result = calibrate(samples.with_columns(field=body @ turn, frame="b"), place)
    assert (result.method, result.verdict) == ("levelled", "check")
    (told,) = result.objections
    assert "yaw 45." in told.what or "yaw 44." in told.what
    assert "COMPASS_ORIENT" in told.move
    off = (result.calibration.correct(body @ turn) - field_b).mean(axis=0)
    assert np.abs(off).max() < 60.0
