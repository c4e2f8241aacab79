"""What is said of each result, in the first line of its text, and drawn on its page."""

from collections.abc import Callable

import pytest

import agonic as ag
from agonic.alignment.document import describe_remanence
from agonic.alignment.simulation.laboratory import simulate_di_flux, simulate_gravity
from agonic.alignment.star_sensor.document import describe_plan
from agonic.display.documents import describe
from agonic.report.document import Document

laboratory = ag.alignment


def session() -> Document:
    return describe(ag.fit_alignment(laboratory.simulate_session(orientations=5).session))


def plan() -> Document:
    return describe_plan(laboratory.plan_alignment([18_870, 1_390, 45_750], wanted_sd_arcsec=2.0))


def remanence() -> Document:
    return describe_remanence(laboratory.fit_remanence(laboratory.simulate_remanence()))


def direction() -> Document:
    night = laboratory.simulate_session(seed=1).session
    turn = ag.fit_alignment(night).calibration
    return describe(laboratory.field_direction(turn, night.magnetometer, night.star, night.site))


@pytest.mark.parametrize(
    ("make", "says", "drawn"),
    [
        (
            lambda: describe(ag.fit_coil(laboratory.simulate_coil(levels=(1.0, 0.5)).session)),
            "",
            {"<h2>": 5},
        ),
        (
            lambda: describe(ag.fit_gravity(simulate_gravity().samples)),
            "✓ mag: good (against the accelerometer, 24 orientations at rest)",
            {},
        ),
        (remanence, "✓ magnetometer: good (platform turned to 12 settings)", {}),
        (
            lambda: describe(ag.fit_north(laboratory.simulate_north().session)),
            "✓ simulated: good (north by a gyrotheodolite, damped sinusoid)",
            {'<figure class="strip"': 3},
        ),
        (
            lambda: describe(ag.fit_di_flux(simulate_di_flux().sheet)),
            "✓ simulated: good (absolute measurement with a fluxgate theodolite, 9 settings)",
            {"<tr>": 10},
        ),
        (
            session,
            "! magnetometer: check (alignment with a star sensor, 5 orientations)",
            {'class="dome"': 2, 'class="dot"': 10},
        ),
        (plan, "6 orientations of 20 readings each: the ", {"<svg": 1}),
        (direction, "", {}),
    ],
)
def test_results_say_what_they_are(
    make: Callable[[], Document], says: str, drawn: dict[str, int]
) -> None:
    made = make()
    assert made.to_text().splitlines()[0].startswith(says)
    page = made.to_html()
    assert {what: page.count(what) for what in drawn} == drawn


def test_readings_without_an_attitude_are_counted() -> None:
    assert "Readings     456 of magnetometer with an attitude, 24 without" in direction().to_text()
