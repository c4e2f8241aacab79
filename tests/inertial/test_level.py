"""Level is what the accelerometer reads, no speed is found in none, a lean is not level."""

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.known_heading import compute_mounted_heading
from agonic.inertial.problem import Settings
from agonic.inertial.start import SLOW_M_S, choose_speed
from agonic.simulation import simulate
from tests.inertial.drives import drive, used_error_deg
from tests.live import rover


@pytest.mark.slow
def test_headings_are_right_by_the_tilt_of_the_same_accelerometer() -> None:
    """What the fit takes for the accelerometer's bias does not turn level away from it: 0.1 m/s²
    would be 1.2° of heading at this dip."""
    errors, stated = [], []
    for seed in range(3):
        made, logged, place = drive(tilt_deg=5.0, seed=seed, unit={"accelerometer_bias": 0.1})
        fit = ag.fit_inertial(logged, place)
        errors.append(used_error_deg(fit.calibration, made, 5.0, accelerometer_bias=0.1, seed=seed))
        stated.append(compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg)
        assert np.linalg.norm(fit.accelerometer_bias) > 0.05
    ratio = np.array(errors) / stated
    assert np.sqrt(np.mean(np.square(errors))) < 0.6
    assert 0.2 < np.sqrt(np.mean(ratio**2)) < 1.4


@pytest.mark.slow
def test_rows_that_count_as_independent_in_one_model_only_do_not_make_a_speed() -> None:
    _, logged, place = drive(tilt_deg=2.0, seed=0)
    assert choose_speed(logged, place, Settings()).sds[9] == SLOW_M_S
    _, flown, place = drive("flight", n=4000, rate_Hz=25.0, stray_nT_A=(0.0, 0.0, 0.0))
    assert choose_speed(flown, place, Settings()).sds[9] == Settings().speed_sd_m_s


def test_a_short_log_that_leans_states_the_heading_of_a_level_vehicle() -> None:
    """Roll and pitch that were recorded know level, however few of them there are."""
    made = simulate("circle", tilt_deg=40.0, n=6000, inclination_deg=65.0)
    leaning = made.samples.select(np.flatnonzero(made.samples.roll_deg > 32.0))
    place = ag.Reference.vector(made.field_n, frame="n")
    fit = ag.fit_levelled(leaning, place)
    assert leaning.roll_deg is not None
    assert leaning.roll_deg.mean() > 32.0
    np.testing.assert_array_equal(fit.coverage.down, [0.0, 0.0, 1.0])


@pytest.mark.slow
def test_a_speed_that_looks_like_a_lean_is_doubted_until_the_vehicle_stops() -> None:
    once, stop = rover.turn(0, 720), rover.stand(0, seconds=10)
    for legs, verdict in (((once,), "check"), ((once, stop, rover.turn(0, -360), stop), "good")):
        made = rover.drive(*legs)
        felt = made.acceleration + np.cross(made.rotation_rate, [1.0, 0.0, 0.0])
        fit = ag.fit_inertial(made.with_columns(acceleration=felt), rover.PLACE)
        named = [finding.name for finding in fit.findings]
        assert (fit.verdict, "turned at one rate" in named) == (verdict, verdict == "check")
    assert rover.heading_error_deg(fit.calibration)[0] < 0.3
    np.testing.assert_allclose(fit.inertial_errors[9:11], [1.0, 0.0], atol=0.1)
