"""The report in a browser: it turns, fits every width, and asks for nothing but itself."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from agonic.provenance import Input
from agonic.recording.document import render
from tests.recording.handmade import BIAS

YAW, PITCH, FILL, DRAG = -0.6, 0.4, 0.40, 0.008


@pytest.fixture(scope="module")
def report(good, logged, refused) -> str:
    return render([good, logged, refused], title="flight.ulg", exports={"MAG0": ["MAG0.params"]})


@pytest.fixture(scope="module")
def single(good) -> str:
    return render([good], title="flight.ulg")


def settle(page) -> None:
    """Waits until what was asked for is drawn: two frames."""
    page.evaluate("() => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))")


def pixels(page, part: str, sensor: int = 1) -> np.ndarray:
    """The red, green, blue and alpha of a picture, (height, width, 4)."""
    settle(page)
    width, values = page.evaluate(
        """([part, sensor]) => {
            const canvas = document.querySelector(`#sensor-${sensor} [data-part=${part}]`);
            const all = [0, 0, canvas.width, canvas.height];
            const bytes = canvas.getContext("2d").getImageData(...all).data;
            let text = "";
            for (let i = 0; i < bytes.length; i += 8192) {
                text += String.fromCharCode(...bytes.subarray(i, i + 8192));
            }
            return [canvas.width, btoa(text)];
        }""",
        [part, sensor],
    )
    return np.frombuffer(base64.b64decode(values), np.uint8).astype(int).reshape(-1, width, 4)


def projected(points: np.ndarray, width: int, yaw: float = YAW, pitch: float = PITCH):
    """Columns and rows of points in radii of the sphere, and how near they are."""
    right = points @ [-np.sin(yaw), np.cos(yaw), 0]
    away = points @ [np.cos(yaw), np.sin(yaw), 0]
    up = np.cos(pitch) * points[:, 2] - np.sin(pitch) * away
    near = np.sin(pitch) * points[:, 2] + np.cos(pitch) * away
    return width / 2 + FILL * width * right, width / 2 - FILL * width * up, near


def near_readings(result, width: int, **view):
    """Where readings of the near half are drawn, and their deviations of magnitude."""
    centred = result.samples.field - BIAS
    columns, rows, near = projected(
        centred / np.median(np.linalg.norm(centred, axis=1)), width, **view
    )
    size = np.linalg.norm(result.samples.field, axis=1)
    keep = near > 0.5
    at = np.stack([rows, columns], axis=1)[keep].round().astype(int)
    return at, (size / size.mean() - 1)[keep]


def test_nothing_is_fetched_and_nothing_complains(opened, report):
    page = opened(report)
    settle(page)
    assert [url for url in page.requests if not url.startswith("data:")] == [page.url]
    assert page.complaints == []


def test_readings_are_drawn_where_they_are_in_the_colour_of_their_deviation(opened, good, single):
    picture = pixels(opened(single, color_scheme="light"), "before")
    at, deviation = near_readings(good, picture.shape[1])
    drawn = picture[at[:, 0], at[:, 1]]
    assert np.mean(drawn[:, 3] == 255) > 0.99
    red_over_blue = drawn[:, 0] - drawn[:, 2]
    assert np.corrcoef(red_over_blue, deviation)[0, 1] > 0.95
    assert np.median(red_over_blue[deviation > 0.3]) > 40


def test_the_calibrated_readings_lie_on_the_sphere(opened, good, single):
    picture = pixels(opened(single), "after")
    width = picture.shape[1]
    unit = good.fit.calibration.correct(good.samples.field) / good.fit.calibration.magnitude
    columns, rows, near = projected(unit, width)
    at = np.stack([rows, columns], axis=1)[near > 0.3].round().astype(int)
    assert np.mean(picture[at[:, 0], at[:, 1], 3] == 255) > 0.99
    corner = picture[: width // 20, : width // 20]
    assert corner[..., 3].max() == 0


def test_directions_never_seen_are_red(opened, refused, report):
    picture = pixels(opened(report, color_scheme="light"), "after", sensor=3)
    width = picture.shape[1]
    below = projected(np.array([[np.cos(YAW), np.sin(YAW), -0.6]]) / np.hypot(1, 0.6), width)
    red, green, _blue, alpha = picture[round(below[1][0]), round(below[0][0])]
    assert alpha > 0
    assert red > green + 60


def test_dragging_turns_every_sphere_by_the_way_of_the_pointer(opened, good, single):
    page = opened(single)
    parts = ("before", "after", "residuals")
    before = {part: pixels(page, part) for part in parts}
    picture = page.locator("#sensor-1 [data-part=before]")
    picture.scroll_into_view_if_needed()
    box = picture.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + 120, steps=5)
    page.mouse.up()
    after = {part: pixels(page, part) for part in parts}
    assert all((before[part] != after[part]).any() for part in parts)
    view = {"yaw": YAW - 50 * DRAG, "pitch": PITCH + 20 * DRAG}
    at, _ = near_readings(good, after["before"].shape[1], **view)
    assert np.mean(after["before"][at[:, 0], at[:, 1], 3] == 255) > 0.99
    page.mouse.move(box["x"] + 300, box["y"] + 300)
    assert (pixels(page, "before") == after["before"]).all()


def test_keys_turn_it_and_home_turns_it_back(opened, single):
    page = opened(single)
    start = pixels(page, "before")
    page.locator("#sensor-1 [data-part=after]").focus()
    for key in ("ArrowLeft", "ArrowUp"):
        page.keyboard.press(key)
    assert (pixels(page, "before") != start).any()
    page.keyboard.press("Home")
    assert (pixels(page, "before") == start).all()


@pytest.mark.parametrize("width", [360, 768, 1200])
def test_no_width_needs_scrolling_sideways(opened, report, width):
    page = opened(report, viewport={"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == width
    outside = page.evaluate(
        """() => [...document.querySelectorAll("td, th, p, canvas, svg.area, dd, h1, h2")]
            .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
            .filter((e) => getComputedStyle(e.closest("thead") ?? e).position !== "absolute")
            .map((e) => e.outerHTML.slice(0, 80))"""
    )
    assert outside == []


def test_a_page_of_paper_holds_it_in_ink_on_white(opened, report):
    page = opened(report, color_scheme="dark", viewport={"width": 680, "height": 900})
    page.emulate_media(media="print")
    settle(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= 680
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert not page.locator(".screen-only").first.is_visible()
    assert luminous(pixels(page, "after")) < 200
    assert page.pdf(format="A4").startswith(b"%PDF")


def luminous(picture: np.ndarray) -> float:
    """The mean brightness of what is fully drawn."""
    return float(picture[picture[..., 3] == 255][:, :3].mean())


def test_dark_is_dark_and_light_is_light(opened, single):
    ground = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    assert max(opened(single, color_scheme="dark").evaluate(ground)) < 40
    assert min(opened(single, color_scheme="light").evaluate(ground)) > 240


def test_changing_the_theme_repaints_the_spheres(opened, single):
    page = opened(single, color_scheme="light")
    light = pixels(page, "after")
    page.emulate_media(color_scheme="dark")
    assert (pixels(page, "after") != light).any()


def test_an_evil_name_neither_runs_nor_breaks_the_page(opened, good):
    evil = "</script><img src=x onerror=alert(1)>"
    named = replace(good, samples=good.samples.with_columns(name=evil, notes=(evil,)))
    page = opened(render([named], title=evil))
    settle(page)
    assert page.locator("h2").inner_text() == evil
    assert page.locator("img").count() == 0
    assert page.complaints == []
    assert pixels(page, "before")[..., 3].max() == 255


def test_dragging_along_a_strip_gives_the_command_for_that_interval(opened, good):
    source = Input(name="a flight.ulg", sha256="0" * 64, count=1)
    samples = good.samples.with_columns(source=source)
    page = opened(render([replace(good, samples=samples)], title="flight"))
    area = page.locator("[data-clock] .area").first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    for share, act in ((0.25, page.mouse.down), (0.5, page.mouse.up)):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + 20, steps=4)
        act()
    said = page.locator(".interval-command").first.inner_text()
    command, interval = said.split(" --between ")
    assert command == f"agonic calibrate 'a flight.ulg' --sensor {samples.name}"
    start, stop = samples.time[[0, -1]]
    expected = start + np.array([0.25, 0.5]) * (stop - start)
    assert np.array(interval.split(","), float) == pytest.approx(
        expected, abs=0.01 * (stop - start)
    )
