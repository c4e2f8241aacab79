"""The attitude that an inertial unit feels, and what its errors do to it, against the truth."""

import numpy as np
import pytest

import agonic as ag
from agonic.inertial.attitude import estimate_attitude
from agonic.maths.rotations.attitude import down_b
from agonic.simulation import simulate

BIAS = 0.1 * np.array([1.0, -0.7, 0.5])
RATE = np.radians(0.5) * np.array([1.0, -1.0, 0.7])
SCALE = 0.01 * np.array([1.0, -0.6, 0.8])
SPEED = np.array([0.5, -0.2, 0.1])
ERRORS = {
    "none": np.zeros(14),
    "accelerometer": np.concatenate([BIAS, np.zeros(11)]),
    "gyro bias": np.concatenate([np.zeros(3), RATE, np.zeros(8)]),
    "gyro scale": np.concatenate([np.zeros(6), SCALE, np.zeros(5)]),
    "speed": np.concatenate([np.zeros(9), SPEED, np.zeros(2)]),
    "delay": np.append(np.zeros(12), [0.05, 0.0]),
    "delay of the acceleration": np.append(np.zeros(13), 0.05),
}


def rms_deg(vectors: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean(np.sum(vectors**2, axis=-1)))))


@pytest.mark.parametrize("tilt_deg", [5.0, 40.0])
@pytest.mark.parametrize("error", list(ERRORS))
def test_errors_act_as_foretold(error: str, tilt_deg: float) -> None:
    made = simulate("circle", n=4000, tilt_deg=tilt_deg, seed=1)
    true, given = made.samples, ERRORS[error]
    rate = true.rotation_rate
    force = _record_late(true.acceleration, true.time, given[13])
    logged = true.with_columns(
        acceleration=force + given[:3] + np.cross(rate, given[9:12]),
        rotation_rate=rate * (1 + given[6:9]) + given[3:6],
    )
    felt = estimate_attitude(logged)
    down, field = down_b(true.roll_deg, true.pitch_deg), made.field_b
    down, field = (_record_late(v, true.time, given[12]) for v in (down, field))
    wrong = felt.down - down
    left = wrong - felt.down_by @ given
    inner = slice(200, -200)  # the low-pass has only half of its data at the ends
    assert rms_deg(left[inner]) < max(0.06 * rms_deg(wrong[inner]), 0.01)
    level = field - down * (field * down).sum(axis=1, keepdims=True)
    aside = np.cross(felt.down, felt.ahead)
    azimuth = np.unwrap(np.arctan2((level * aside).sum(axis=1), (level * felt.ahead).sum(axis=1)))
    drift = (azimuth - felt.azimuth_by @ given)[10:]  # a delayed row before them has no moment
    assert np.degrees(np.ptp(drift)) < max(0.05 * np.degrees(np.ptp(azimuth)), 0.2)


def _record_late(vectors: np.ndarray, time: np.ndarray, delay_s: float) -> np.ndarray:
    """What stands in the rows of vectors (n, 3) that are recorded a delay after their moment."""
    return np.stack([np.interp(time - delay_s, time, axis) for axis in vectors.T], axis=1)


def test_pauses_begin_anew_and_rows_between_them_are_left_out() -> None:
    whole = simulate("circle", n=3000).samples
    rows = np.r_[0:1000, 1400:1410, 1700:3000]
    felt = estimate_attitude(whole.select(rows))
    assert felt.known.sum() == 2300
    assert len(np.unique(felt.part[felt.known])) == 2


def test_without_a_gyro_each_row_tells_down() -> None:
    true = simulate("circle", n=300).samples
    felt = estimate_attitude(true.with_columns(rotation_rate=None))
    assert felt.ahead is None
    np.testing.assert_allclose(felt.down, down_b(true.roll_deg, true.pitch_deg), atol=1e-9)
    leaning = true.with_columns(acceleration=true.acceleration + 0.01, rotation_rate=None)
    moved = estimate_attitude(leaning).down - felt.down
    np.testing.assert_allclose(moved, felt.down_by @ np.full(3, 0.01), atol=5e-6)


def test_without_an_accelerometer_it_says_what_is_missing() -> None:
    with pytest.raises(ag.LogError, match="hold no acceleration"):
        estimate_attitude(simulate("circle", n=300).samples.with_columns(acceleration=None))
