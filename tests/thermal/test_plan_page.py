"""The plan on paper and screen: drawings that show the pose, complete words, a page that prints."""

import re

import numpy as np
import pytest

from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.thermal.campaign.description import list_standard_stations
from agonic.thermal.maths.stations import FACES
from agonic.thermal.plan.document import describe_plan
from agonic.thermal.plan.figures import draw_pose, draw_profile
from agonic.thermal.plan.plan import plan_thermal

SENSORS = "2xMMC5883MA,3xMPU-9255"


@pytest.fixture(scope="module")
def plan():
    return plan_thermal(SENSORS)


def names(drawing: str) -> set[str]:
    return set(re.findall(r'class="name"[^>]*>([a-z]+)<', drawing))


def centre(drawing: str, face: str) -> np.ndarray:
    """The pixels of the middle of a face."""
    polygon = re.search(rf'points="([^"]+)" class="face {face}"', drawing)
    return np.array([p.split(",") for p in polygon[1].split()], dtype=float).mean(axis=0)


@pytest.mark.parametrize("station", list_standard_stations(), ids=lambda s: str(s.number))
def test_each_drawing_shows_what_is_up_and_what_looks_to_the_door_and_left(station) -> None:
    def face(chamber):
        seen = station.rot_nb.apply(np.array(chamber, float), inverse=True).round().astype(int)
        return FACES[tuple(seen.tolist())].removesuffix(" side")

    up, door, left = face([0, 0, -1]), face([-1, 0, 0]), face([0, -1, 0])
    drawing = draw_pose(station.rot_nb, station.pose)
    assert names(drawing) == {up, door, left}
    assert station.pose.startswith(up)
    assert centre(drawing, up)[1] < min(centre(drawing, door)[1], centre(drawing, left)[1])
    assert centre(drawing, left)[0] < centre(drawing, door)[0]


def test_a_skew_pose_is_drawn_too() -> None:
    drawing = draw_pose(yaw_pitch_roll(20.0, 30.0, 10.0), "askew")
    assert drawing.count("<polygon") == 4  # three faces and the floor


def test_the_profile_is_drawn_to_scale(plan) -> None:
    drawing = draw_profile(plan.profile).to_html()
    path = re.search(r'd="M([^"]+)" class="course"', drawing)[1]
    points = np.array([p.split() for p in path.split("L")], dtype=float)
    right = (points[:, 0] - points[0, 0]) / np.ptp(points[:, 0])
    down = (points[:, 1] - points[:, 1].min()) / np.ptp(points[:, 1])
    time, level = plan.profile.corners
    np.testing.assert_allclose(right, time / time[-1], atol=1e-3)
    np.testing.assert_allclose(down, (50 - level) / 60, atol=2e-3)


def test_the_text_says_everything(plan) -> None:
    text = describe_plan(plan).to_text()
    assert text.splitlines()[0] == "12 stations, 5 sensors, −10 to +50 °C: 53 h 20 min in all"
    for said in (
        "cool to −10 °C in 120 min (0.5 °C/min)",
        "tip it 90° away from you",
        "8 640 000",
        "2 × MMC5883MA",
        "257 MB as CSV",
        "turns known to 1°",
    ):
        assert said in text
    assert max(map(len, text.splitlines())) <= 100


def test_stations_that_determine_nothing_are_warned_of(plan) -> None:
    from agonic.thermal.campaign.description import Station

    flat = [Station(number=k, rot_nb=yaw_pitch_roll(30.0 * k, 0, 0)) for k in range(1, 13)]
    assert "do not determine" in describe_plan(plan_thermal("MPU-9255", stations=flat)).to_text()
    assert "do not determine" not in describe_plan(plan).to_text()


@pytest.mark.parametrize("width", [360, 768, 1200])
def test_the_page_fits_every_width_and_fetches_nothing(opened, plan, width) -> None:
    page = opened(describe_plan(plan).to_html(), viewport={"width": width, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert [url for url in page.requests if not url.startswith("data:")] == [page.url]
    assert page.complaints == []
    assert page.locator("article").count() == 12


def test_it_prints_in_ink_on_a_few_sheets(opened, plan) -> None:
    page = opened(describe_plan(plan).to_html(), color_scheme="dark")
    printed = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) <= 4
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"


def test_an_evil_name_is_text(opened) -> None:
    evil = "</title><script>alert(1)</script>"
    page = opened(describe_plan(plan_thermal("MPU-9255", name=evil)).to_html())
    assert page.locator("h1").inner_text() == evil
    assert page.locator("script").count() == 0
