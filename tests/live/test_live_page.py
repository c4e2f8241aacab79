"""The live page in a real browser: from the first reading to the files, and what can go wrong."""

import json

import pytest

import agonic as ag
from tests.live.browsing import wait


def seen(page):
    return int(page.text_content(".seen").split()[0])


def points(page):
    return page.evaluate("window.__stat.points")


def drawn(page):
    """Pixels of the sphere that are not empty."""
    return page.evaluate(
        """() => {
            const canvas = document.querySelector("figure canvas");
            const all = [0, 0, canvas.width, canvas.height];
            const data = canvas.getContext("2d").getImageData(...all).data;
            let n = 0;
            for (let i = 3; i < data.length; i += 4) n += data[i] > 0;
            return n;
        }"""
    )


FORGET = "document.getElementById('forget').open"
FOCUSED = """(() => {
    const one = document.activeElement, box = one.getBoundingClientRect();
    const top = document.elementFromPoint(box.x + box.width / 2, box.bottom - 2);
    const ring = getComputedStyle(one).outlineStyle === "solid";
    return [one.id || one.className || one.tagName, ring, !one.contains(top)];
})()"""


def look(canvas):
    """The drawing, as a number."""
    return canvas.evaluate(
        """(one) => [...one.toDataURL()].reduce((h, c) => (31 * h + c.charCodeAt(0)) | 0, 0)"""
    )


SAY = "document.querySelector('.say').textContent"


def test_from_the_first_reading_to_the_files(sensor, live, page, picture, tmp_path):
    shown = page(live(f"tcp://127.0.0.1:{sensor.port}", "--field", "50000", "--target", "0.05"))
    shown.set_viewport_size({"width": 1100, "height": 1000})
    wait(shown, "window.__stat.points > 50")
    first, few = seen(shown), drawn(shown)
    wait(shown, f"/°/.test({SAY})")
    say = shown.text_content(".say")
    wait(shown, f"{SAY} !== {json.dumps(say)}")  # the next turn changes as it is turned
    wait(shown, f"+document.querySelector('.seen').textContent.split(' ')[0] > {first + 10}")
    assert drawn(shown) != few
    picture(shown, "live.png")
    assert shown.get_attribute("progress", "value") is not None
    label = shown.get_attribute("figure canvas", "aria-label")
    assert "of 80 seen" in label

    wait(shown, "document.querySelector('progress').value > 0.7", 60)
    sensor.moving, sensor.near_metal = False, True
    wait(shown, "/stronger than elsewhere/.test(document.querySelector('.problems').textContent)")
    sensor.moving, sensor.near_metal = True, False
    wait(shown, "document.querySelector('.problems').textContent === ''")

    before = points(shown)
    shown.reload()
    wait(shown, f"window.__stat && window.__stat.points >= {before}")
    assert seen(shown) > first

    sensor.unplug()
    wait(shown, "/trying again/.test(document.getElementById('heard').textContent)")
    kept = points(shown)
    sensor.plug()
    wait(shown, "/connected/.test(document.getElementById('heard').textContent)")
    wait(shown, f"window.__stat.points > {kept + 100}")

    wait(shown, "!document.getElementById('accept').disabled")
    shown.focus("#accept")
    shown.keyboard.press("Enter")
    shown.wait_for_selector("#outcomes .verdict", timeout=30_000)
    assert shown.evaluate("document.activeElement.id") == "accept"  # the focus stays
    folder = tmp_path / "out"
    written = ag.load(folder / "mag.json")
    assert abs(written.bias[0] - 12_000) < 6 * written.sd[0]
    assert {p.name for p in folder.iterdir()} >= {"mag.json", "mag.h", "report.html", "setup.toml"}
    with shown.expect_popup() as popup:
        shown.click("text=Open the report")
    assert "Live" in popup.value.text_content("h1")
    shown.reload()
    shown.wait_for_selector("#outcomes .verdict")
    assert shown.foreign == []
    assert shown.complaints == []


@pytest.mark.slow
def test_the_calibration_before_stands_beside(sensor, live, page, tmp_path):
    before = tmp_path / "before.json"
    ag.save(
        ag.Affine(bias=[11_000.0, -5000, 3000], matrix=[[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]), before
    )
    shown = page(
        live(f"tcp://127.0.0.1:{sensor.port}", "--field", "50000", "--before", str(before))
    )
    wait(shown, "document.querySelectorAll('tbody tr').length > 5")
    cells = shown.eval_on_selector_all(
        "#sensors tbody tr:nth-child(3) > *", "all => all.map(c => c.textContent)"
    )
    assert cells[0] == "bias x, nT"
    assert cells[3] == "11\u202f000"
    assert shown.is_visible("th.before")


def test_several_sensors_and_small_screens(three_sensors, page):
    shown = page(three_sensors)
    wait(shown, "document.querySelectorAll('.sensor').length === 3")
    for width in (360, 800, 1920):
        shown.set_viewport_size({"width": width, "height": 800})
        shown.wait_for_timeout(100)
        assert shown.evaluate("document.documentElement.scrollWidth") <= width
    names = shown.eval_on_selector_all(".sensor h2", "all => all.map(one => one.textContent)")
    assert names == ["mag", "mag1", "mag2"]


def test_everything_by_keyboard(three_sensors, page):
    shown = page(three_sensors)
    wait(shown, "window.__stat.points > 60")
    stops = []
    for _ in range(9):
        shown.keyboard.press("Tab")
        stops.append(shown.evaluate(FOCUSED))
    assert [stop[0] for stop in stops] == ["accept", "restart"] + ["CANVAS", "follow"] * 3 + [
        "BODY"
    ]
    assert all(ring and not covered for name, ring, covered in stops if name != "BODY")
    shown.locator(".follow").first.uncheck()
    canvas = shown.locator("figure canvas").first
    canvas.focus()
    looks = {look(canvas)}
    for key in ("ArrowLeft", "ArrowUp"):
        shown.keyboard.press(key)
        shown.wait_for_timeout(100)
        looks.add(look(canvas))
    assert len(looks) == 3
    unnamed = shown.evaluate(
        """() => [...document.querySelectorAll("button, input, canvas, progress")].filter(
            (one) => one.checkVisibility() && !one.closest(".strip[aria-label]")
              && !(one.textContent.trim() || one.ariaLabel
              || [...(one.labels || [])].some((label) => label.textContent.trim()))).length"""
    )
    assert unnamed == 0
    assert shown.complaints == []


@pytest.mark.slow
def test_start_again_asks_first(live, page):
    shown = page(live("sim"))
    wait(shown, "window.__stat.points > 100")
    shown.focus("#restart")
    shown.keyboard.press("Enter")
    wait(shown, FORGET)
    assert "readings would be thrown away" in shown.text_content("#forget-says")
    inside = []
    for _ in range(4):
        inside.append(shown.evaluate("document.activeElement.id"))
        shown.keyboard.press("Tab")
    assert inside[:2] == ["keep", "throw"]
    assert "accept" not in inside
    shown.keyboard.press("Escape")
    wait(shown, f"!{FORGET}")
    assert shown.evaluate("document.activeElement.id") == "restart"
    assert points(shown) > 100
    shown.keyboard.press("Enter")
    wait(shown, FORGET)
    shown.click("#throw")
    wait(shown, "window.__stat.points < 100", 5.0)
    live.process.kill()
    live.process.wait()
    wait(shown, "/has stopped/.test(document.getElementById('heard').textContent)")
    assert shown.is_disabled("#accept")
    assert shown.is_disabled("#restart")


@pytest.mark.slow
def test_dark_and_light_are_told_apart(three_sensors, page):
    colours = [
        page(three_sensors, color_scheme=scheme).evaluate(
            "getComputedStyle(document.body).backgroundColor"
        )
        for scheme in ("light", "dark")
    ]
    assert colours[0] != colours[1]
