"""Make the pictures that README and documentation show: python docs/pictures.py [NAME…].

Names are those of pages of the gallery; without any it makes all, the live page too.
"""

import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser, sync_playwright

from agonic.cli import run

STATIC = Path(__file__).parent / "_static"


CAMPAIGN = ("simulate", "campaign", "--rate", "0.1", "--seed", "7")


GALLERY: dict[str, tuple[str, ...]] = {
    "calibrate": (
        "simulate hand -o hand.csv --seed 3",
        "calibrate hand.csv --field 50000 -o hand",
        "hand/report.html",
    ),
    "heading": (
        "simulate vehicle -o flown.csv -n 6000",
        "calibrate flown.csv -o flown",
        "heading flown/setup.toml flown.csv -o h.csv --report heading.html",
        "heading.html",
    ),
    "refused": (
        "simulate circle -o flat.csv --tilt 1",
        "calibrate flat.csv --field 50000 -o flat",
        "flat/report.html",
    ),
    "alignment": (
        "simulate alignment -o night",
        "fit alignment night -o night.json --report alignment.html",
        "alignment.html",
    ),
    "north": ("simulate north -o pier", "fit north pier --report north.html", "north.html"),
    "coil": ("simulate coil -o coil", "fit coil coil --report coil.html", "coil.html"),
    "pair": (
        "simulate shots -o shots.csv --bad 1",
        "fit pair shots.csv -o shots.toml --report pair.html",
        "pair.html",
    ),
    "inflight": (
        "simulate orbit -n 20000 --seed 5 --moved 1500 -o day.csv",
        "fit inflight day.csv --ground day.ground.json -o now.json",
        "now.html",
    ),
    "track": (
        "simulate orbit -n 12000 --seed 5 -o pass1.csv",
        "track pass1.csv --state state.json --walk 0.4 --report track.html",
        "track.html",
    ),
    "retrain": (
        "simulate paper -n 4500 -o paper.csv",
        "fit network paper.csv --reference paper.reference.csv --between 0,14.99 --base none "
        "-o ground.json",
        "retrain paper.csv --reference paper.reference.csv --window 15s --every 15s "
        "--ground ground.json --state retrained.json -o later.json --report retrain.html",
        "retrain.html",
    ),
    "network": ("simulate network -o wang", "wang/network.html"),
    "evaluate": (
        "simulate vehicle -o vehicle.csv -n 6000",
        "evaluate vehicle.csv --report evaluate.html",
        "evaluate.html",
    ),
    "history": (
        *(
            f"simulate hand -o board-{month}.csv --seed 3 --noise {200 + 10 * month}"
            for month in range(1, 8)
        ),
        *(
            f"calibrate board-{month}.csv --field 50000 --store boards.sqlite --as board-7 "
            f"--date 2026-{month:02}-12 -o board-{month}"
            for month in range(1, 8)
        ),
        "history board-7 --store boards.sqlite -o history.html",
        "history.html",
    ),
    "fleet": (
        "simulate fleet -o boards --sensors 60",
        "fleet boards/logs --field 48000 -o boards-out",
        "boards-out/report.html",
    ),
}
"""Commands that make each page of the gallery, and the page."""


WHOLE_FIGURE = """() => Math.max(1100, ...[...document.querySelectorAll("figure")]
    .map((figure) => figure.getBoundingClientRect())
    .filter((box) => box.top < 1100 && box.bottom > 1100).map((box) => box.bottom + 10))"""
"""How far down a page is drawn, so that no figure is cut."""


def gallery_pictures(browser: Browser, folder: str, names: Iterable[str]) -> None:
    """The top of each page, 1100 points wide, down to the end of the figure at 1100 points."""
    (STATIC / "gallery").mkdir(exist_ok=True)
    view = browser.new_page(viewport={"width": 1100, "height": 1100})
    for name in names:
        *commands, page = GALLERY[name]
        for command in commands:
            subprocess.run([sys.executable, "-m", "agonic", *command.split()], cwd=folder)
        view.goto(f"file://{folder}/{page}")
        view.wait_for_timeout(500)
        size = {"x": 0, "y": 0, "width": 1100, "height": view.evaluate(WHOLE_FIGURE)}
        path = STATIC / "gallery" / f"{name}.png"
        view.screenshot(path=path, scale="css", full_page=True, clip=size)


def report_pictures(browser: Browser, folder: str) -> None:
    """Reports of `agonic demo` and of a campaign, as pages of 1100 points show them."""
    run(["demo", "-o", folder])
    run([*CAMPAIGN, "-o", f"{folder}/recorded"])
    run(["fit", "thermal", f"{folder}/recorded", "-o", f"{folder}/chamber"])
    page = browser.new_page(viewport={"width": 1100, "height": 1420})
    for file, picture in (
        ("report.html", "report.png"),
        ("chamber/report.html", "campaign.png"),
    ):
        page.goto(f"file://{folder}/{file}")
        page.wait_for_timeout(500)
        page.screenshot(path=STATIC / picture)


def live_pictures() -> None:
    """The live page and its question before it writes, as its tests in a browser see them."""
    tests = Path(__file__).parents[1] / "tests" / "live"
    command = [sys.executable, "-m", "pytest", "-q", "-k", "first_reading or vehicle_is_written"]
    subprocess.run(
        [*command, str(tests / "test_live_page.py"), str(tests / "test_live_device.py")],
        env={**os.environ, "AGONIC_PICTURES": str(STATIC)},
        check=True,
    )


def main(names: list[str]) -> None:
    """Pictures of these pages, or all."""
    STATIC.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        if not names:
            report_pictures(browser, folder)
        gallery_pictures(browser, folder, names or GALLERY)
        browser.close()
    if not names:
        live_pictures()


main(sys.argv[1:])
