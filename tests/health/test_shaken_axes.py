"""Axes of an accelerometer on a vehicle that waves shake, or that leans into its turns."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.health.turning import check_gravity_turning
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
    assert check_gravity_turning(logged) is None
    renamed = logged.with_columns(acceleration=logged.acceleration @ RENAMED[looks].T)
    found = check_gravity_turning(renamed)
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


@pytest.mark.parametrize("lean", [-0.3, 0.2])
def test_a_vehicle_that_leans_in_its_turns_is_not_blamed(lean: float) -> None:
    """It feels (1 − lean) v ω across while it rolls as if that were lean v ω the other way."""
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
    noise = np.random.default_rng(0).standard_normal((3000, 3))
    turning = np.stack([rolls, rate * np.sin(roll), rate * np.cos(roll)], axis=1)
    samples = ag.Samples(
        time=time,
        field=rot_nb.apply([20_000.0, 0.0, 45_000.0], inverse=True),
        acceleration=rot_nb.apply(felt, inverse=True) + 0.3 * noise,
        rotation_rate=turning,
    )
    assert check_gravity_turning(samples) is None
