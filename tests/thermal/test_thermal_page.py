"""The pages about a calibration over temperature: what they say, draw, and keep from doing."""

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from agonic.calibration.steps import find_step
from agonic.calibration.thermal import Thermal
from agonic.health import Finding
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.report.digits import MINUS, THIN
from agonic.thermal import figures
from agonic.thermal.all_sensors import calibrate_campaign
from agonic.thermal.calibration_document import describe_calibration
from agonic.thermal.checks.boards import find_courses
from agonic.thermal.document import campaign_page
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor
from agonic.thermal.simulation.campaign import simulate_campaign

EVIL = "</style><img src=x onerror=alert(1)>&\"'"


def words(page: str) -> str:
    """The text of a page, with plain spaces."""
    body = re.sub(r"<(script|style).*?</\1>", " ", page, flags=re.DOTALL)
    text = unescape(re.sub(r"<[^>]*>", " ", body))
    return re.sub(r"\s+", " ", text.replace(THIN, " "))


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def result() -> CalibratedCampaign:
    made = simulate_campaign("2xMMC5883MA", rate_Hz=0.02, seed=6, anomalies=2e-3)
    return calibrate_campaign(made.campaign, degree="auto")


@pytest.fixture(scope="module")
def page(result) -> str:
    return campaign_page(result, title="Box 3", files={"MMC5883MA-1": ["out/MMC5883MA-1.json"]})


def test_the_table_is_the_published_ratio(result, page) -> None:
    rows = re.findall(r'<table class="ratios">.*?</table>', page, flags=re.DOTALL)
    cells = re.findall(r'<th scope="row">(.*?)</th>((?:<td>.*?</td>)+)', rows[0])
    for (name, shown), sensor in zip(cells, result.sensors, strict=True):
        assert name == sensor.name
        values = [float(v) for v in re.findall(r"<td>(.*?)</td>", shown)]
        spread = sensor.fit.spread
        ratio = spread.before.max(axis=0) / spread.after.max(axis=0)
        assert values[:4] == pytest.approx(ratio, abs=0.0051)
        assert values[4] == pytest.approx(sensor.held_out.spread.improvement[3], abs=0.0051)


def test_other_ratios_stand_beside_under_their_own_words(result) -> None:
    page = campaign_page(
        result, beside={"MMC5883MA-2": (11.71, 2.43, 1.47, 5.98)}, beside_words="measured elsewhere"
    )
    (row,) = re.findall(r'<tr class="beside">(.*?)</tr>', page)
    assert re.findall(r">([^<>]+)<", row) == ["measured elsewhere", "11.71", "2.43", "1.47", "5.98"]


def test_every_bin_is_a_dot_where_it_belongs(result) -> None:
    fit = result.sensors[0].fit
    curve = figures.evaluate_coefficients(fit.calibration)[4]
    cooling, heating = figures.select_dots(fit.bins, 4)
    drawn = figures.draw_coefficient(curve, (cooling, heating)).to_html()
    (d,) = re.findall(r'<path d="([^"]*)" class="dots cooling">', drawn)
    places = np.array([[float(v) for v in at.split()] for at in re.findall(r"M([\d. ]+)h0", d)])
    assert len(places) == np.isfinite(fit.bins.cooling[:, 4]).sum()
    right = np.polyfit(cooling.temperature, places[:, 0], 1)
    assert np.abs(np.polyval(right, cooling.temperature) - places[:, 0]).max() < 1.0
    inside = (places[:, 1] > 0) & (places[:, 1] < 1000)
    down = np.polyfit(cooling.values[inside], places[inside, 1], 1)
    assert down[0] < 0  # larger is higher
    assert np.abs(np.polyval(down, cooling.values[inside]) - places[inside, 1]).max() < 1.5


def test_what_the_polynomial_leaves_is_bin_less_curve(result) -> None:
    fit = result.sensors[0].fit
    curve = figures.evaluate_coefficients(fit.calibration)[0]
    (left, _) = figures.select_dots(fit.bins, 0, less=curve)
    there = np.isin(fit.bins.temperature, left.temperature)
    exact = fit.bins.cooling[there, 0] - fit.calibration.bias_at(left.temperature)[:, 0]
    scale = np.ptp(curve.value)
    assert left.values == pytest.approx(exact, abs=1e-3 * scale)


def test_the_curve_and_band_are_the_calibrations(result) -> None:
    calibration = result.sensors[0].fit.calibration
    for k, curve in enumerate(figures.evaluate_coefficients(calibration)):
        nine = np.array(
            [
                np.concatenate(
                    [
                        calibration.at(t).bias,
                        pack_symmetric(calibration.at(t).matrix),
                    ]
                )
                for t in curve.temperature[[0, 30, 60]]
            ]
        )
        assert curve.value[[0, 30, 60]] == pytest.approx(nine[:, k])
        assert curve.sd == pytest.approx(calibration.sd_at(curve.temperature)[:, k])


def test_the_page_says_what_was_found(result, page) -> None:
    said = words(page)
    assert "Box 3" in said
    assert "Turns known: the turns of the stations are described." in said
    assert "All sensors saw the field change in the axes of the chamber by" in said
    assert "the smallest after which no variance falls markedly" in said
    assert "out/MMC5883MA-1.json" in said
    count = sum(anomaly.count for anomaly in result.sensors[0].fit.anomalies)
    assert count > 1
    assert f"{count} readings were outliers against the running median of their station" in said
    for share in result.chamber_field.shares:
        assert f"{share.name} {round(share.total_sd)} nT" in said
    assert "4 fits, each without some of the stations" in said
    low, high = result.sensors[0].fit.calibration.validity.temperature_C
    assert f"{low:.1f} to {high:.1f} °C".replace("-", MINUS) in said


def test_each_sensor_has_its_nine_figures_and_what_they_leave(page) -> None:
    assert page.count("<article") == 2
    for label in ("bias x, nT", "matrix zz", "matrix yz"):
        assert page.count(f">{label}</p>") == 4


def test_a_refused_sensor_and_findings_on_the_campaign_are_told(result) -> None:
    spoilt = replace(
        result,
        sensors=(*result.sensors, CalibratedSensor(name="MAG3", refused="It never moved.")),
        findings=(Finding("range", "check", "station 4 got no colder than 5 °C", "record again"),),
        chamber_field=None,
    )
    said = words(campaign_page(spoilt))
    first = "Refused : do not use Station 4 got no colder than 5 °C."
    assert f"{first} To be checked: MAG3." in said
    assert "Do next: Record again." in said
    assert "It never moved." in said
    assert "It takes two sensors with times" in said


def test_names_cannot_become_markup(result) -> None:
    evil = replace(result, sensors=(replace(result.sensors[0], name=EVIL),))
    page = campaign_page(evil, title=EVIL, files={EVIL: [EVIL]})
    assert "<img" not in page
    assert words(page).count("onerror=alert(1)") > 3


def test_nothing_is_fetched_and_nothing_runs(page) -> None:
    assert "<script" not in page
    assert "http://" not in page
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page).group(1)
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-")


def test_a_calibration_without_covariance_or_range_is_drawn_too() -> None:
    bare = Thermal(
        bias=[[1, 2, 3], [40, 50, 60]],
        matrix=[np.eye(3)] * 2,
        centre_C=0.0,
        half_range_C=10.0,
        unit_in="raw",
        gauge="free",
    )
    page = describe_calibration(bare, bare).to_html()
    assert page.count('class="plot small"') == 12
    assert "key band" not in page
    assert "bias x, raw units" in page
    assert find_step(bare, Thermal) is bare


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1200])
def test_the_page_fits_its_screen(opened, page, width, scheme) -> None:
    shown = opened(page, viewport={"width": width, "height": 900}, color_scheme=scheme)
    shown.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    assert shown.complaints == []
    assert len(shown.requests) == 1
    columns = shown.evaluate(
        "getComputedStyle(document.querySelector('.multiples:not(.courses)')).gridTemplateColumns"
    )
    assert len(columns.split()) == (1 if width == 360 else 3)
    background = shown.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (background == "rgb(255, 255, 255)") == (scheme == "light")


def test_the_page_has_contents_that_lead_somewhere(page) -> None:
    anchors = re.findall(r'href="#([^"]+)"', page)
    assert len(anchors) > 20
    assert set(anchors) <= set(re.findall(r'id="([^"]+)"', page))
    assert len(set(re.findall(r'id="([^"]+)"', page))) == len(re.findall(r'id="([^"]+)"', page))
    text = words(page)
    for title in ("The recordings", "Scale factors and angles", "The chamber’s field"):
        assert text.count(title) >= 2  # in the contents and over its part


def test_the_temperature_at_every_station_is_drawn(result, page) -> None:
    drawn = re.findall(r'aria-label="[^"]*: station (\d+), °C over hours".*?</svg>', page)
    assert [int(number) for number in drawn] == list(range(1, 13))
    first = page[page.index(": station 1, °C over hours") :]
    (curve,) = re.findall(r'<path d="M([^"]*)" class="common"', first[: first.index("</svg>")])
    down = np.array([float(pair.split()[1]) for pair in curve.split("L")])
    level = find_courses(result.campaign)[0][1].level_C
    assert int(np.argmax(down)) == pytest.approx(int(np.nanargmin(level)), abs=12)
    assert np.ptp(down) > 800.0  # thousandths of the height
