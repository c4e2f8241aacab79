"""Make the pictures that README and documentation show: python docs/pictures.py."""

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser, sync_playwright

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
        live_picture(browser, folder)
        browser.close()


def live_picture(browser: Browser, folder: str) -> None:
    """The live page while a simulated hand turns a sensor."""
    command = [sys.executable, "-m", "agonic", "live", "sim?kind=tumble", "--target", "0.01"]
    with subprocess.Popen(
        [*command, "--port", "0", "-o", folder + "/live"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        page = browser.new_page(viewport={"width": 1100, "height": 1000})
        page.goto(re.findall(r"http://\S+", process.stdout.readline())[0])
        page.wait_for_timeout(7000)
        page.screenshot(path=STATIC / "live.png")
        process.terminate()


main()
