"""The live page in a real browser: from the first reading to the files, and what can go wrong."""

import json

from browsing import wait
from test_live_server import plain

import agonic as ag


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

    wait(shown, "document.querySelector('progress').value > 0.9", 60)
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
    assert cells[3] == "11000"
    assert shown.is_visible("th.before")


def test_several_sensors_and_small_screens(live, page):
    shown = page(live("sim?sensors=3&rate=20"))
    wait(shown, "document.querySelectorAll('.sensor').length === 3")
    for width in (360, 800, 1920):
        shown.set_viewport_size({"width": width, "height": 800})
        shown.wait_for_timeout(100)
        assert shown.evaluate("document.documentElement.scrollWidth") <= width
    names = shown.eval_on_selector_all(".sensor h2", "all => all.map(one => one.textContent)")
    assert names == ["mag", "mag1", "mag2"]


def test_keys_turn_the_sphere_and_it_is_named(live, page):
    shown = page(live("sim"))
    wait(shown, "window.__stat.points > 20")
    shown.uncheck(".follow")
    shown.focus("figure canvas")
    shown.keyboard.press("ArrowLeft")
    shown.keyboard.press("Home")
    unnamed = shown.evaluate(
        """() => [...document.querySelectorAll("button, input, canvas, progress")].filter(
            (one) => one.checkVisibility() && !one.closest(".strip[aria-label]")
              && !(one.textContent.trim() || one.ariaLabel
              || [...(one.labels || [])].some((label) => label.textContent.trim()))).length"""
    )
    assert unnamed == 0
    assert shown.complaints == []


def test_dark_and_light_are_told_apart(live, page):
    address = live("sim")
    colours = [
        page(address, color_scheme=scheme).evaluate(
            "getComputedStyle(document.body).backgroundColor"
        )
        for scheme in ("light", "dark")
    ]
    assert colours[0] != colours[1]


def test_the_page_says_when_the_program_has_stopped(live, page):
    address = live("sim")
    shown = page(address)
    wait(shown, "window.__stat.points > 20")
    live.process.kill()
    live.process.wait()
    wait(shown, "/has stopped/.test(document.getElementById('heard').textContent)")
    assert plain(address) is None
