"""The page of a vehicle that stays level: a compass rose in place of the sphere."""

import json

from tests.live.browsing import wait

LABEL = "(document.querySelector('figure canvas') || document.body).getAttribute('aria-label')"
INK = """() => {
    const canvas = document.querySelector("figure canvas");
    const all = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    return all.filter((value, i) => i % 4 === 3 && value > 0).length;
}"""


def test_a_rover_sees_its_headings_and_what_to_drive_and_accepts(live, page, picture, tmp_path):
    shown = page(live("sim?kind=rover&rate=10&minutes=5", "--speed", "4", "--target", "0.05"))
    shown.set_viewport_size({"width": 1100, "height": 1000})
    wait(shown, f"/Compass rose of headings: [0-9]+ of 12 seen/.test({LABEL})", 60)
    assert shown.is_visible(".of-rose")
    assert not shown.is_visible(".of-sphere")
    assert "headings seen, tilted up to" in shown.text_content(".seen")
    wait(shown, "/heading error then/.test(document.querySelector('.say').textContent)", 60)
    assert "with accelerometer and gyro" in shown.text_content(".heading")
    assert shown.evaluate(INK) > 10_000
    picture(shown, "live-rose.png")
    shown.set_viewport_size({"width": 400, "height": 900})
    wait(shown, "document.documentElement.scrollWidth <= 400")
    shown.click("#accept")
    wait(shown, "document.querySelector('#outcomes .word')", 90)
    written = json.loads((tmp_path / "out" / "mag.json").read_text())
    assert written["calibration"]["provenance"]["settings"]["fit"] == "inertial"
    assert shown.complaints == []
