"""No speed is found where there is none, and a lean of the vehicle is not taken for its level."""

import numpy as np

import agonic as ag
from agonic.inertial.settings import Settings
from agonic.inertial.start import SLOW_M_S, choose_speed
from agonic.simulation import simulate
from tests.inertial.drives import drive


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
