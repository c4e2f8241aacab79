"""Make the pictures that README and documentation show: python docs/pictures.py."""

from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

from agonic.cli import run

STATIC = Path(__file__).parent / "_static"


def main() -> None:
    """The report of `agonic demo`, as a page of 1100 points shows it."""
    STATIC.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        run(["demo", "-o", folder])
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1100, "height": 1640})
        page.goto(f"file://{folder}/report.html")
        page.wait_for_timeout(500)
        page.screenshot(path=STATIC / "report.png")
        browser.close()


main()
