"""The deviation card: its numbers, its words, and the page in a browser."""

import re

import numpy as np
import pytest

from agonic.calibration.deviation import Deviation
from agonic.errors import AgonicError
from agonic.headings.deviation import fit_deviation
from agonic.headings.deviation.card import (
    card_text,
    describe_power,
    judge_size,
    make_coefficient_rows,
    make_rows,
)
from agonic.headings.deviation.document import card_page
from agonic.headings.deviation.figures import LEFT, RIGHT, WIDTH, draw_chart, draw_picture

ROSE = np.arange(0, 360, 45.0)
HANDBOOK = np.array([10.5, 20.0, 11.5, -1.2, -5.5, -8.0, -12.5, -6.8])


@pytest.fixture(scope="module")
def fit():
    return fit_deviation(ROSE, ROSE + HANDBOOK, power_state="engine on", current_A=12.0)


def test_rows_are_the_card_both_ways(fit) -> None:
    card = fit.calibration
    made = make_rows(card, 15.0)
    assert len(made) == 24
    for row in made:
        assert row.deviation == pytest.approx(float(card.at(row.heading)))
        assert row.magnetic == pytest.approx((row.heading + row.deviation) % 360)
        assert (
            float(card.magnetic(row.steer)) == pytest.approx(row.heading, abs=1e-9)
            or row.heading == 0
        )
    with pytest.raises(AgonicError, match="use 5, 10, 15, 30, 45"):
        make_rows(card, 20.0)


@pytest.mark.parametrize(
    ("largest", "says"),
    [
        (2.9, "within 3°, the limit of a compass just adjusted"),
        (4.9, "within 5°, the limit of a compass in service"),
        (5.1, "beyond 5°, the limit of a compass in service"),
    ],
)
def test_the_limits_are_named(largest, says) -> None:
    assert says in judge_size(Deviation(coefficients=[0.0, largest, 0, 0, 0]))


def test_least_squares_and_eight_headings_stand_side_by_side(fit) -> None:
    made = make_coefficient_rows(fit.calibration, fit.classical)
    assert [row[0] for row in made] == list("ABCDE")
    assert made[1][1].startswith("11.940 ±")
    assert made[1][2] == "12.00"


def test_a_state_that_was_not_noted_is_said_to_be_unknown(fit) -> None:
    unknown = fit_deviation(ROSE, ROSE + HANDBOOK)
    assert describe_power(fit.calibration) == "engine on, 12 A"
    assert "which was not noted" in card_text(unknown)
    assert 'class="state unknown"' in card_page(unknown)


def test_a_refused_swing_gives_no_table_to_steer_by() -> None:
    refused = fit_deviation(ROSE[:4], ROSE[:4])
    for made in (card_text(refused), card_page(refused)):
        assert "steer also 180° S" in made
        assert "To make good" not in made


def test_the_curve_and_the_dots_are_drawn_where_they_are(fit) -> None:
    drawn = str(draw_chart(fit))
    dots = re.search(r'd="((?:M[\d. ]+h0)+)" class="dots few"', drawn)[1]
    x, y = np.array([pair.split() for pair in dots.replace("h0", "").split("M")[1:]], float).T
    assert x == pytest.approx(LEFT + (WIDTH - LEFT - RIGHT) * ROSE / 360, abs=0.1)
    assert np.corrcoef(y, HANDBOOK)[0, 1] == pytest.approx(-1.0, abs=1e-6)  # east is up
    curve = re.search(r'd="([^"]+)" class="curve"', drawn)[1]
    points = np.array([pair.split() for pair in re.split("[ML]", curve)[1:]], float)
    at = np.interp(x, *points.T)
    assert at == pytest.approx(y, abs=1.0)


def test_many_readings_make_no_heavy_page() -> None:
    compass = np.random.default_rng(0).uniform(0, 360, 100_000)
    many = fit_deviation(compass, compass + np.random.default_rng(1).normal(size=100_000))
    assert len(card_page(many)) < 120_000


def test_an_evil_title_is_text(opened, fit) -> None:
    evil = "</title><script>alert(1)</script>"
    page = opened(card_page(fit, title=evil, details={evil: evil}))
    assert page.locator("h1").inner_text() == evil
    assert page.locator("script").count() == 0
    assert page.complaints == []


@pytest.mark.parametrize("width", [360, 768, 1200])
def test_the_page_fits_every_width_and_fetches_nothing(opened, fit, width) -> None:
    page = opened(card_page(fit), viewport={"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert [url for url in page.requests if not url.startswith("data:")] == [page.url]
    assert page.complaints == []


@pytest.mark.parametrize("paper", ["A4", "A5"])
def test_it_prints_on_one_sheet_in_ink_on_white(opened, fit, paper) -> None:
    page = opened(card_page(fit, paper=paper), color_scheme="dark")
    printed = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
    size = [
        float(n) for n in re.search(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", printed).groups()
    ]
    assert size == pytest.approx({"A4": [595, 842], "A5": [420, 595]}[paper], abs=1.5)
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    ink = "getComputedStyle(document.querySelector('path.dots')).stroke"
    assert page.evaluate(ink) == "rgb(25, 29, 34)"


def test_dark_is_dark_and_light_is_light(opened, fit) -> None:
    ground = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert max(opened(card_page(fit), color_scheme="dark").evaluate(ground)) < 40
    assert min(opened(card_page(fit), color_scheme="light").evaluate(ground)) > 240


def test_the_picture_stands_alone(fit) -> None:
    from xml.etree import ElementTree

    root = ElementTree.fromstring(draw_picture(fit))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    assert root.find("{http://www.w3.org/2000/svg}style") is not None
    assert root.get("width") == "760"


@pytest.mark.parametrize("width", [360, 400])
def test_the_chart_can_be_read_on_a_telephone(opened, fit, width) -> None:
    page = opened(card_page(fit), viewport={"width": width, "height": 900})
    assert not page.locator(".card-chart.wide").is_visible()
    shown = page.locator(".card-chart.narrow")
    sizes = shown.evaluate(
        """(svg) => [...svg.querySelectorAll("text")].map((text) =>
            parseFloat(getComputedStyle(text).fontSize) * svg.getScreenCTM().a)"""
    )
    assert min(sizes) >= 11
    boxes = shown.evaluate(
        """(svg) => [...svg.querySelectorAll("text")].map((t) => {
            const b = t.getBoundingClientRect(); return [b.left, b.right]; })"""
    )
    assert min(left for left, _ in boxes) >= 0
    assert max(right for _, right in boxes) <= width
    wide = opened(card_page(fit), viewport={"width": 1000, "height": 900})
    assert wide.locator(".card-chart.wide").is_visible()
    assert not wide.locator(".card-chart.narrow").is_visible()
