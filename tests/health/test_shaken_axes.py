"""Axes of an accelerometer on a vehicle that waves shake, or that leans into its turns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.health.finding import find_first
from agonic.health.turning import GRAVITY_TURNING
from agonic.maths.rotations.namings import compare_namings
from agonic.maths.rotations.right_angles import describe_renaming
from agonic.maths.rotations.turning import measure_left, sum_products
from agonic.units import STANDARD_GRAVITY_M_S2
from tests.inertial.drives import drive

EXCHANGED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
RENAMED = {
    "x and y are exchanged": EXCHANGED,
    "lies along −y, x, z": QUARTER,
    "x and y are reversed": np.diag([-1.0, -1, 1]),
}


@pytest.mark.parametrize("looks", list(RENAMED))
@pytest.mark.parametrize("seed", [0, 1])
def test_axes_of_an_accelerometer_are_named_in_waves(looks: str, seed: int) -> None:
    _, logged, _ = drive("boat", seed, rate_Hz=25.0)
    assert find_first([GRAVITY_TURNING], logged) is None
    renamed = logged.with_columns(acceleration=logged.acceleration @ RENAMED[looks].T)
    found = find_first([GRAVITY_TURNING], renamed)
    assert found is not None
    assert looks in found.what


@pytest.mark.parametrize(
    ("turn", "looks"),
    [(EXCHANGED, "x and y are exchanged"), (np.diag([-1.0, 1, 1]), "x is reversed")],
)
def test_a_boat_with_renamed_axes_is_not_good(turn: np.ndarray, looks: str) -> None:
    """Its headings would be off by 10°, at a stated 1°."""
    _, logged, place = drive("boat", n=2000, rate_Hz=25.0)
    result = ag.calibrate(logged.with_columns(acceleration=logged.acceleration @ turn.T), place)
    assert result.verdict == "check"
    assert looks in result.status


@pytest.mark.parametrize("looks", ["x and y are exchanged", "lies along −y, x, z"])
def test_exchanged_axes_are_named_where_a_bank_is_not_felt(looks: str) -> None:
    """Headings would be off by 30°, at a stated 0.8°."""
    _, logged, _ = drive("flight", n=2000, rate_Hz=25.0)
    assert find_first([GRAVITY_TURNING], logged) is None
    renamed = logged.with_columns(acceleration=logged.acceleration @ RENAMED[looks].T)
    found = find_first([GRAVITY_TURNING], renamed)
    assert found is not None
    assert looks in found.what


@pytest.mark.parametrize("turn", [np.diag([-1.0, 1, 1]), np.diag([1.0, -1, 1]), EXCHANGED[::-1]])
def test_axes_of_a_quadrotor_are_named(turn: np.ndarray) -> None:
    """It leans as it accelerates, so that nothing but its gusts is felt across."""
    copter = {"vehicle": "copter", "stray_nT_A": (0.0, 0.0, 0.0)}
    _, logged, _ = drive("flight", n=2500, rate_Hz=25.0, **copter)
    assert find_first([GRAVITY_TURNING], logged) is None
    found = find_first(
        [GRAVITY_TURNING], logged.with_columns(acceleration=logged.acceleration @ turn.T)
    )
    assert found is not None
    assert describe_renaming(turn.T) in found.what


@pytest.mark.parametrize(("seed", "late_s", "looks"), [(0, 0.3, "0.36 s"), (1, 1.5, "1.5 s")])
def test_a_clock_is_not_taken_for_axes(seed: int, late_s: float, looks: str) -> None:
    """A hand turns by right angles in a second; two axes seemed reversed."""
    _, logged, _ = drive("hand", seed, n=2500, rate_Hz=25.0)
    then = logged.time - late_s
    late = [np.interp(then, logged.time, axis) for axis in logged.acceleration.T]
    found = find_first([GRAVITY_TURNING], logged.with_columns(acceleration=np.stack(late, axis=1)))
    assert found is not None
    assert f"about {looks} late" in found.what
    assert "other axes" not in found.what


@pytest.mark.slow
def test_no_clean_car_is_blamed() -> None:
    """Its braking outweighs its slopes threefold, and seems to follow them by chance."""
    for seed in range(20):
        _, logged, _ = drive("car", seed, n=2500, rate_Hz=25.0)
        assert find_first([GRAVITY_TURNING], logged) is None


@pytest.mark.parametrize("lean", [-0.3, 0.2, 0.3, 0.4, 0.5, 1.0])
def test_a_vehicle_that_leans_in_its_turns_is_not_blamed(lean: float) -> None:
    """It feels (1 − lean) v ω across while it rolls as if that were lean v ω the other way."""
    samples = ride(lean)
    noise = 0.3 * np.random.default_rng(0).standard_normal((len(samples), 3))
    assert (
        find_first(
            [GRAVITY_TURNING], samples.with_columns(acceleration=samples.acceleration + noise)
        )
        is None
    )


def test_a_speed_explains_what_a_leaning_vehicle_feels() -> None:
    """0.4 of it leaned by: by the roll alone x and z would seem reversed."""
    samples = ride(lean=0.4)
    assert samples.time is not None
    assert samples.acceleration is not None
    assert samples.rotation_rate is not None
    products = sum_products(
        samples.acceleration, samples.rotation_rate, samples.time, smoothed_s=0.3, felt=True
    )
    turns = np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0])])
    farthest = np.repeat([0.5, 50.0], 3)
    own, reversed_roll = measure_left(products, turns, farthest)
    assert own < min(0.04, reversed_roll)  # 0.026 of it for a speed of 8 of at most 50 m/s
    own, reversed_roll = measure_left(products, turns, farthest[:3])
    assert own > 1.0 > reversed_roll


def ride(lean: float) -> ag.Samples:
    """At 8 m/s through bends, leaning by a share of what would balance them."""
    time, speed = np.arange(3000) / 25, 8.0
    pace = 2 * np.pi / np.array([11.0, 7.0])
    rate = (0.15 * np.sin(np.outer(time, pace))).sum(axis=1)
    heading = (0.15 * (1 - np.cos(np.outer(time, pace))) / pace).sum(axis=1)
    roll = lean * speed * rate / STANDARD_GRAVITY_M_S2
    change = (0.15 * pace * np.cos(np.outer(time, pace))).sum(axis=1)
    rolls = lean * speed * change / STANDARD_GRAVITY_M_S2
    rot_nb = Rotation.from_euler("ZX", np.stack([heading, roll], axis=1))
    across = np.stack([-np.sin(heading), np.cos(heading), 0 * heading], axis=1)
    felt = across * (speed * rate)[:, None] - [0, 0, STANDARD_GRAVITY_M_S2]
    turning = np.stack([rolls, rate * np.sin(roll), rate * np.cos(roll)], axis=1)
    return ag.Samples(
        time=time,
        field=rot_nb.apply([20_000.0, 0.0, 45_000.0], inverse=True),
        acceleration=rot_nb.apply(felt, inverse=True),
        rotation_rate=turning,
    )


def test_a_log_of_pauses_tells_no_axes() -> None:
    """As half of a log, in alternate parts: no window is without a pause."""
    time = np.arange(1000) / 25 + 60.0 * (np.arange(1000) // 50)
    rate, force = np.random.default_rng(0).normal(size=(2, 1000, 3))
    turns = np.stack([np.eye(3), EXCHANGED])
    assert compare_namings(force, rate, time, turns).shape == (2, 0)
