"""What is wrong with accelerometer and gyro is named before any fit, and how to correct it."""

import numpy as np
import pytest

import agonic as ag
from agonic.health.inertial_unit import find_faults, find_stopped_readings, repair
from agonic.maths.rotations.right_angles import right_angles
from tests.inertial.drives import drive

G = 9.80665


def halt(values):
    """Readings that repeat one from the middle on."""
    stopped = values.copy()
    stopped[len(values) // 2 :] = values[len(values) // 2]
    return stopped


FAULTS = {
    "it is in g": lambda s: {"acceleration": s.acceleration / G},
    "in thousandths of g": lambda s: {"acceleration": 1000 * s.acceleration / G},
    "its unit is another one": lambda s: {"acceleration": 16_384 * s.acceleration / G},
    "axis y of the gyro reads 0 rad/s in all rows": lambda s: {
        "rotation_rate": s.rotation_rate * [1, 0, 1]
    },
    "axis x of the accelerometer reads 0 m/s²": lambda s: {
        "acceleration": s.acceleration * [0, 1, 1]
    },
    "the gyro repeats one reading in 50 % of the rows": lambda s: {
        "rotation_rate": halt(s.rotation_rate)
    },
    "the accelerometer repeats one reading": lambda s: {"acceleration": halt(s.acceleration)},
    "gyro reads nothing but zeros": lambda s: {"rotation_rate": 0 * s.rotation_rate},
}


@pytest.mark.parametrize("what", list(FAULTS))
def test_a_fault_is_named_on_a_vehicle_that_keeps_level(what: str) -> None:
    _, logged, _ = drive(tilt_deg=3.0, n=2000, unit={"vibration": 0.1})
    faults = find_faults(logged.with_columns(**FAULTS[what](logged)))
    assert [what in fault.finding.what for fault in faults] == [True]


@pytest.mark.parametrize("kind", ["circle", "hand", "car", "boat", "flight", "tumble", "static"])
def test_nothing_is_wrong_with_a_unit_as_it_should_be(kind: str) -> None:
    for push in (0.0, 1.0):
        logged = drive(kind, n=2000, unit={"vibration": 1.0, "push": push})[1]
        assert find_faults(logged) == ()
        assert find_stopped_readings(logged) is None


def test_an_axis_at_rest_in_a_motion_without_noise_is_not_dead() -> None:
    rate = np.zeros((400, 3))
    for turning in (np.r_[np.full(200, 0.5), np.full(200, -0.5)], np.sin(np.arange(400) / 50)):
        rate[:, 2] = turning
        angle = np.cumsum(turning) * 0.02
        field = np.stack([np.cos(angle), -np.sin(angle), np.ones(400)], axis=1)
        made = ag.Samples(time=np.arange(400) * 0.02, field=field, rotation_rate=rate)
        assert find_faults(made) == ()


def test_an_accelerometer_of_other_axes_is_put_right_by_what_is_told() -> None:
    """All 48 renamings, but for gravity's sign, by which nothing turns otherwise."""
    _, logged, _ = drive(tilt_deg=3.0, n=1500, unit={"vibration": 0.05})
    for turn in right_angles():
        (fault, *none) = find_faults(
            logged.with_columns(acceleration=logged.acceleration @ turn.T)
        ) or (None,)
        assert not none
        assert (fault is None) == np.array_equal(turn, np.eye(3))
        if fault is not None:
            either = fault.finding.what.partition("other axes (")[2].rstrip(")")
            told = [read(one) for one in either.split(", or with gravity's sign the other way ")]
            assert any(np.array_equal(one @ turn, np.eye(3)) for one in told)
            assert np.array_equal(told[0], -told[1])


def read(what: str) -> np.ndarray:
    """The turn (3, 3) from axes as named to true ones that words describe."""
    if "lies along" in what:
        along = [one.strip() for one in what.partition("along ")[2].split(",")]
        columns = [(-1 if "−" in one else 1) * np.eye(3)["xyz".index(one[-1])] for one in along]
        return np.stack(columns, axis=1)
    named = ["xyz".index(one) for one in what.replace(",", "").split() if one in tuple("xyz")]
    turn = np.eye(3)
    if "exchanged" in what:
        return turn[:, [named[::-1][named.index(i)] if i in named else i for i in range(3)]]
    turn[named, named] = -1
    return turn


def test_which_of_three_sensors_has_other_axes_is_told() -> None:
    _, logged, _ = drive(tilt_deg=20.0, n=2000)
    turn = right_angles()[5]
    for column, first in (("field", "magnetometer"), ("rotation_rate", "gyro")):
        wrong = logged.with_columns(**{column: getattr(logged, column) @ turn.T})
        (fault,) = find_faults(wrong)
        assert first in fault.finding.move.partition(":")[0]


@pytest.mark.slow
def test_an_acceleration_in_another_unit_is_used_in_metres_per_second_squared() -> None:
    _, logged, place = drive(tilt_deg=10.0, n=1000)
    repaired, _ = repair(logged.with_columns(acceleration=logged.acceleration / G))
    assert np.allclose(repaired.acceleration, logged.acceleration)
    fit = ag.fit_inertial(logged.with_columns(acceleration=logged.acceleration / G), place)
    assert np.allclose(fit.calibration.bias, ag.fit_inertial(logged, place).calibration.bias)
    assert fit.verdict == "check"


@pytest.mark.slow
def test_readings_of_a_magnetometer_that_stopped_are_left_out() -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000)
    result = ag.calibrate(logged.with_columns(field=halt(logged.field)), place)
    assert "magnetometer repeats one reading in 50 % of the rows" in result.fit.status
    assert (np.abs(result.fit.calibration.bias - made.truth.bias) < 4 * result.fit.sd[:3]).all()


def test_an_accelerometer_that_cannot_be_used_ends_a_fit_beside_it_in_words() -> None:
    _, logged, place = drive(tilt_deg=5.0, n=1000)
    wrong = logged.with_columns(acceleration=halt(logged.acceleration))
    with pytest.raises(ag.AgonicError, match="the accelerometer repeats one reading"):
        ag.fit_inertial(wrong, place)
    result = ag.calibrate(wrong, place)
    assert result.verdict == "refused"
    assert "record again with the accelerometer running throughout" in result.fit.status
