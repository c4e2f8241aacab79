"""Make the pictures that README and documentation show: python docs/pictures.py."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

from agonic.cli import run

STATIC = Path(__file__).parent / "_static"


CAMPAIGN = ("simulate", "campaign", "--rate", "0.1", "--seed", "7")


def main() -> None:
    """Reports of `agonic demo` and of a campaign, as pages of 1100 points show them."""
    STATIC.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        run(["demo", "-o", folder])
        run([*CAMPAIGN, "-o", f"{folder}/recorded"])
        run(["fit", "thermal", f"{folder}/recorded", "-o", f"{folder}/chamber"])
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1100, "height": 1640})
        for file, picture in (
            ("report.html", "report.png"),
            ("chamber/report.html", "campaign.png"),
        ):
            page.goto(f"file://{folder}/{file}")
            page.wait_for_timeout(500)
            page.screenshot(path=STATIC / picture)
        browser.close()
    live_pictures()


def live_pictures() -> None:
    """The live page and its question before it writes, as its tests in a browser see them."""
    tests = Path(__file__).parents[1] / "tests" / "web"
    command = [sys.executable, "-m", "pytest", "-q", "-k", "first_reading or vehicle_is_written"]
    subprocess.run(
        [*command, str(tests / "test_live_page.py"), str(tests / "test_live_device.py")],
        env={**os.environ, "AGONIC_PICTURES": str(STATIC)},
        check=True,
    )


main()
