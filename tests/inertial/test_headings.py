"""Headings that do not come from the magnetometer, beside accelerometer and gyro."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.inertial.maths.factors import Headings, sum_headings
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.track import find_attitudes, lay_track
from tests.inertial.drives import drive


def knowing(made, logged, error_deg, sd_deg: float, source: str = "GPS yaw") -> ag.Samples:
    """The log with headings that are off by so much."""
    heading = (made.samples.heading_deg + error_deg) % 360.0
    sd = np.full(len(logged), sd_deg)
    return logged.with_columns(heading_deg=heading, heading_sd_deg=sd, heading_source=source)


def lasting(seed: int, n: int, sd_deg: float, rows: int) -> np.ndarray:
    """Errors that last for so many rows, as a filter has them."""
    a = np.exp(-1.0 / rows)
    white = np.random.default_rng(1000 + seed).standard_normal(n + 10 * rows)
    return sd_deg * np.sqrt(1 - a * a) * lfilter([1.0], [1.0, -a], white)[10 * rows :]


def vehicle_error_deg(fit, made) -> float:
    """Mean error of the vehicle's heading, level, by the whole matrix."""
    turned = Rotation.from_euler("z", np.arange(0.0, 360.0, 10.0)[:, None], degrees=True)
    truth, found = made.truth, fit.calibration
    raw = turned.apply(made.field_n, inverse=True) @ np.linalg.inv(truth.matrix).T + truth.bias
    north, east, _ = turned.apply((raw - found.bias) @ found.matrix.T).T
    declination = np.arctan2(made.field_n[1], made.field_n[0])
    return float(np.degrees(np.angle(np.exp(1j * (np.arctan2(east, north) - declination))).mean()))


def test_gradients_are_those_of_the_cost() -> None:
    rng = np.random.default_rng(0)
    time = np.arange(200) / 25.0
    rate = 0.3 * rng.standard_normal((200, 3))
    track = lay_track(time, rate, [np.arange(200)])
    states = [np.eye(3)]
    for step in track.step:
        states.append(states[-1] @ step)
    near = 0.01 * rng.standard_normal((len(states), 3))
    states = Rotation.from_rotvec(near).as_matrix() @ np.stack(states)
    sd = np.where(np.arange(200) % 3 == 0, np.inf, 50.0)  # wide, so that no row is an outlier
    headings = Headings(rng.uniform(-0.3, 0.3, 200), sd, 0.5)

    def cost(move, offset) -> float:
        there = find_attitudes(track, Rotation.from_rotvec(move).as_matrix() @ states)
        ahead = there[:, :, 0]
        off = np.arctan2(ahead[:, 1], ahead[:, 0]) - headings.angle - 0.5 * offset
        rows = np.isfinite(sd) & (ahead[:, 0] ** 2 + ahead[:, 1] ** 2 > 0.25)
        return float(((np.angle(np.exp(1j * off))[rows] / 50.0) ** 2).sum())

    sums, _ = sum_headings(headings, track, find_attitudes(track, states), np.array([0.0, 0.2]))
    still, step = np.zeros_like(states[:, 0]), 1e-5
    slope = (cost(still, 0.2 + step) - cost(still, 0.2 - step)) / (4 * step)
    assert sums.own.sum(axis=0)[-1] == pytest.approx(slope, rel=1e-2)
    for k in range(3):
        move = still.copy()
        move[k] = step * rng.standard_normal(3)
        slope = (cost(move, 0.2) - cost(-move, 0.2)) / 4
        assert float(sums.gradient[k] @ move[k]) == pytest.approx(slope, rel=0.1, abs=1e-11)


@pytest.mark.slow
def test_headings_tell_how_the_sensor_is_turned_about_the_vertical() -> None:
    """Their errors last for five seconds, and count as few."""
    alone, joined, z = [], [], []
    for seed in (1, 2):
        made, logged, place = drive(
            "car", seed, n=4000, rate_Hz=25.0, declination_deg=8.0, unit={"gyro_noise": 5e-3}
        )
        fit = ag.fit_inertial(logged, place)
        off = lasting(seed, len(logged), 2.0, 125)
        known = knowing(made, logged, off, 2.0)
        told = ag.fit_inertial(known, place, heading_offset_sd_deg=0.1)
        assert fit.heading_source is None
        assert told.heading_source == "GPS yaw"
        assert "GPS yaw was used beside the gyro" in told.status
        alone.append(vehicle_error_deg(fit, made))
        joined.append(vehicle_error_deg(told, made))
        z.append(joined[-1] / told.coverage.heading_sd_deg)
    assert np.linalg.norm(joined) < 0.9 * np.linalg.norm(alone)
    assert np.abs(z).max() < 3.0


@pytest.mark.slow
def test_wrong_headings_are_left_out_and_named() -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000, declination_deg=8.0)
    true = made.samples
    tilt = kernel.tilt_from_angles(true.roll_deg, true.pitch_deg)
    read = kernel.heading_deg(true.field, tilt) - true.heading_deg
    wander = 60.0 * np.sin(2 * np.pi * true.time / 15.0)
    without = ag.fit_inertial(logged, place)
    for error, name in (
        (read, "heading follows the magnetometer"),
        (wander, "heading against the gyro"),
        (-2 * true.heading_deg, "heading"),
    ):
        fit = ag.fit_inertial(knowing(made, logged, error, 2.0), place)
        assert fit.verdict == "check"
        assert name in [finding.name for finding in fit.findings], fit.status
        assert fit.heading_source is None
        np.testing.assert_allclose(fit.calibration.bias, without.calibration.bias)


@pytest.mark.slow
def test_headings_of_another_zero_tell_by_their_changes() -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000, declination_deg=8.0)
    fit = ag.fit_inertial(knowing(made, logged, 40.0, 1.0), place)
    assert fit.heading_source == "GPS yaw"
    assert "only how it changes was used" in fit.status
    assert abs(vehicle_error_deg(fit, made)) < 3 * fit.coverage.heading_sd_deg
    nowhere = ag.fit_inertial(knowing(made, logged, 40.0, 1.0))  # nor is a declination known
    assert (nowhere.verdict, nowhere.heading_source) == ("good", "GPS yaw")


@pytest.mark.slow
def test_calibrate_says_what_told_the_heading() -> None:
    made, logged, place = drive(tilt_deg=10.0, n=2000)
    result = ag.calibrate(knowing(made, logged, 0.0, 1.0, "the course over ground"), place)
    assert (result.method, result.verdict) == ("inertial", "good")
    assert "the course over ground was used beside the gyro" in result.reason
