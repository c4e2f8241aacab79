"""What makes the error of a heading is said on the screen, on the page and for programs."""

import re

import pytest

import agonic as ag
from agonic.recording.document import describe_sensor
from agonic.simulation import simulate


def test_what_the_heading_is_made_of_adds_up() -> None:
    made = simulate("flight", n=3000, noise=100.0, seed=2)
    place = ag.Reference.vector(made.field_n, frame="n")
    page = describe_sensor(ag.calibrate(made.samples, place))
    shares = page.values["shares"]
    heading = page.values["heading_sd_deg"]
    assert sum(sd**2 for sd in shares.values()) ** 0.5 == pytest.approx(heading, rel=0.25)
    said = page.entries["Made of"]
    assert [*shares] == re.findall(r"([a-z][a-z -]*[a-z]) \d", said)
    told = sum(map(float, re.findall(r"([\d.]+).%", said)))
    assert told == pytest.approx(100.0, abs=2.0)
    assert page.to_html().count("<rect") >= len(shares)
