"""Axes of an accelerometer by the probability of what it reads, against a gyro."""

import numpy as np
import pytest

from agonic.maths.rotations.namings import compare_namings
from agonic.maths.rotations.right_angles import right_angles
from tests.inertial.drives import drive

COPTER = {"vehicle": "copter", "stray_nT_A": (0.0, 0.0, 0.0)}


@pytest.mark.parametrize(
    ("kind", "settings"), [("boat", {}), ("flight", COPTER), ("circle", {"tilt_deg": 5.0})]
)
def test_the_own_names_are_the_most_probable(kind: str, settings: dict) -> None:
    """The next best has e⁻¹⁵ of their probability and less, where a bank is not felt too."""
    _, log, _ = drive(kind, n=2500, rate_Hz=25.0, **settings)
    each = compare_namings(log.acceleration, log.rotation_rate, log.time, right_angles())
    own, *others = each.sum(axis=1)
    assert max(others) < own - 15


def test_a_renaming_takes_the_probability_with_it() -> None:
    """What T makes of the readings is as probable with T as the readings are without."""
    _, log, _ = drive("boat", n=1500, rate_Hz=25.0)
    turns = right_angles()
    own = compare_namings(log.acceleration, log.rotation_rate, log.time, turns[:1])
    for turn in turns[[5, 17]]:
        renamed = log.acceleration @ turn.T
        for sign in (1.0, -1.0):
            there = compare_namings(renamed, log.rotation_rate, log.time, sign * turn[None])
            assert np.allclose(there, own, atol=1e-6)


def test_a_pause_is_in_no_window() -> None:
    _, log, _ = drive("boat", n=2500, rate_Hz=25.0)
    later, broken = (log.time + 100.0 * (np.arange(2500) // rows) for rows in (1250, 200))
    shape = [
        compare_namings(log.acceleration, log.rotation_rate, time, right_angles()[:1]).shape[1]
        for time in (log.time, later, broken)
    ]
    assert shape == [6, 4, 0]


def test_short_bursts_are_no_error() -> None:
    _, log, _ = drive("boat", n=2500, rate_Hz=25.0)
    for n in (50, 60, 101):
        burst = log.acceleration[:n], log.rotation_rate[:n], log.time[:n] / 100
        assert np.isfinite(compare_namings(*burst, right_angles())).all()


def test_rows_that_no_curve_goes_through_are_in_no_window() -> None:
    _, log, _ = drive("boat", n=500, rate_Hz=25.0)
    twice = log.time.copy()
    twice[100] = np.nextafter(twice[99], np.inf)
    for rate, time in ((log.rotation_rate, twice), (1e3 * log.rotation_rate, log.time)):
        assert compare_namings(log.acceleration, rate, time, right_angles()).shape == (24, 0)
