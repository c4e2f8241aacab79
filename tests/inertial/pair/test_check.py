"""`check_pair`: a setup that holds is left alone, one that changed is told, and by what."""

import numpy as np
import pytest

import agonic as ag
from agonic.inertial.pair.simulate import SimulatedShots

PLACE = ag.Reference.constant(49_000.0)


def calibrated(seed: int) -> ag.Setup:
    """The setup of an instrument."""
    made = ag.inertial.simulate_shots(attitudes=12, seed=seed)
    return ag.fit_pair(made.samples, PLACE).make_setup(declination_deg=0.0)


def later(seed: int, **settings) -> SimulatedShots:
    """Eight shots by the same instrument on another day."""
    return ag.inertial.simulate_shots(attitudes=8, targets=0, seed=seed, survey=1, **settings)


@pytest.mark.slow
def test_a_setup_that_holds_is_good_and_the_statistic_is_honest() -> None:
    checks = [ag.inertial.check_pair(later(seed).samples, calibrated(seed)) for seed in range(8)]
    assert all(check.verdict == "good" for check in checks)
    assert "Still good: 8 shots" in checks[0].status
    ratio = np.mean([check.statistic / check.freedom for check in checks])
    assert 0.75 < ratio < 1.25


def test_targets_of_the_check_may_be_anywhere() -> None:
    made = ag.inertial.simulate_shots(attitudes=0, targets=2, rolls=4, seed=3, survey=5)
    check = ag.inertial.check_pair(made.samples, calibrated(3))
    assert check.verdict == "good"
    assert check.freedom == 8 * 5 - 2 - 4


@pytest.mark.parametrize("seed", [0, 1])
def test_a_new_bias_of_the_magnetometer_is_told(seed: int) -> None:
    setup, made = calibrated(seed), later(seed)
    push = np.array([0.0, 2500.0, 0.0])
    check = ag.inertial.check_pair(
        made.samples.with_columns(field=made.samples.field + push), setup
    )
    assert check.verdict == "refused"
    assert check.changes[0].name == "the magnetometer's bias"
    assert np.abs((check.changes[0].size - push) / check.changes[0].sd).max() < 4
    assert check.changes[0].turns_deg > 2 > check.seen_deg


def test_a_knocked_accelerometer_is_told() -> None:
    setup, made = calibrated(2), later(2)
    push = np.array([0.4, 0.0, 0.0])
    moved = made.samples.with_columns(acceleration=made.samples.acceleration + push)
    check = ag.inertial.check_pair(moved, setup)
    assert check.verdict != "good"
    assert check.changes[0].name == "the accelerometer's bias"


def test_one_odd_shot_does_not_condemn_the_setup() -> None:
    made = later(1, bad=1)
    check = ag.inertial.check_pair(made.samples, calibrated(1))
    assert check.verdict == "check"
    assert check.odd.tolist() == made.bad.tolist()
    assert f"shot {made.bad[0] + 1} alone" in check.status.lower()


def test_what_cannot_be_checked_is_refused() -> None:
    setup = calibrated(0)
    with pytest.raises(ag.CoverageError, match="6 are needed"):
        ag.inertial.check_pair(later(0).samples.select(np.arange(4)), setup)
    bare = ag.Setup(compasses=setup.compasses)
    with pytest.raises(ag.AgonicError, match="agonic fit pair"):
        ag.inertial.check_pair(later(0).samples, bare)
