"""Make the pictures that README and documentation show: python docs/pictures.py."""

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


main()
