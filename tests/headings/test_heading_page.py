"""The page of headings: over time with their band, dip and strength, and what not to trust."""

import numpy as np
import pytest

import agonic as ag
from agonic.headings.document import describe_headings, list_flags
from agonic.simulation import simulate

MADE = simulate("circle", n=600, seed=2)


@pytest.fixture(scope="module")
def found() -> ag.Heading:
    compass = ag.Compass(calibration=ag.fit_ellipsoid(MADE.samples, 50_000).calibration)
    setup = ag.Setup(
        compasses=(compass,), declination_deg=0.0, horizontal=25_000.0, vertical=43_301.0
    )
    return ag.heading(MADE.samples, setup)


def test_the_page_draws_heading_error_strength_and_dip(found: ag.Heading) -> None:
    field = MADE.truth.correct(MADE.samples.field)
    page = describe_headings(found, MADE.samples, field=field).to_html()
    for name in (
        "Heading: true heading, °",
        "Standard error: standard error, °",
        "Strength of the field: strength, nT",
        "Dip of the field: dip, °",
    ):
        assert f"{name} over time since the first reading" in page
    assert "NaN" not in page
    assert "nan" not in page.split("</style>")[1].lower().replace("nanotesla", "").replace(
        "provenance", ""
    )
    assert "Strength of the field" not in describe_headings(found).to_html()


def test_no_band_is_drawn_across_north(found: ag.Heading) -> None:
    """Where a heading goes through north, the path is begun anew: no stroke crosses the paper."""
    page = describe_headings(found).to_html()
    drawn = page.split('class="mean"')[0].rsplit('d="', 1)[1]
    turns = int(np.sum(np.abs(np.diff(found.true_deg)) > 180))
    assert turns > 0
    assert drawn.count("M") >= turns


def test_flags_say_how_many_rows_and_why(found: ag.Heading) -> None:
    rows = list_flags(found)
    assert len(rows) == sum(bool(mask.any()) for mask in found.flags.values())
    page = describe_headings(found).to_html()
    assert "What not to trust" in page
