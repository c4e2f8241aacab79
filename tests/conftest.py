"""What all tests share."""

import gc
import os
import shutil
import signal
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

Derivative = Callable[..., np.ndarray]

# The same examples every time, and none failed for the machine being busy.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")

# Ctrl+C is tested; a shell that starts the tests in its background turns it off for all of them.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

gc.disable()  # collecting tests makes much that lasts and no garbage: a third of its time


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than cores: pages, devices and servers are waited for a tenth of the time."""
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Generator[None, list[Any], list[Any]]:
    """Files of tests hold no examples: looking for some takes a tenth of the collection."""
    found = yield
    return [one for one in found if type(one) is pytest.Module or not file_path.match("test_*.py")]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The one long file first and the doctests last, so that all workers end together."""
    items.sort(key=lambda item: item.path.name != "test_site.py")


def pytest_collection_finish() -> None:
    """What was made until now lasts to the end: do not look through it again and again.

    Nor look often through what is made later: little of it is in cycles.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    gc.enable()


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings; tests that need it are skipped where it is absent."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    folder = Path(os.environ.get("AGONIC_RECORDINGS", beside))
    if not folder.is_dir():
        pytest.skip("recordings not found: set AGONIC_RECORDINGS")
    return folder


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to stand in, where a command leaves its files."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A browser; without one the tests are skipped, but never in continuous integration."""
    executable = next(
        filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None
    )
    if executable is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)("no Chromium was found on the path")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=executable,
            args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
        )
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def derivative() -> Derivative:
    """The derivative of a function of a vector by central differences, last axis the vector's."""

    def differences(function: Callable, at: np.ndarray, steps: np.ndarray | float) -> np.ndarray:
        at = np.asarray(at, dtype=float)
        sizes = np.broadcast_to(steps, at.shape)
        columns = [
            (function(at + size * axis) - function(at - size * axis)) / (2 * size)
            for size, axis in zip(sizes, np.eye(len(at)), strict=True)
        ]
        return np.stack(columns, axis=-1)

    return differences


@pytest.fixture(scope="session")
def kept_pages() -> list[Any]:
    """Pages of the browser that test after test may use: a new one costs as much as a report."""
    return []


@pytest.fixture
def opened(chromium: Any, kept_pages: list[Any], tmp_path: Path) -> Iterator[Callable[..., Any]]:
    """Opens a report as a file in a page that no other of the test has, with its size and colours.

    The page keeps the requests and complaints of the report; other settings, or `apart`, ask for
    a page that nothing else ever uses.
    """
    contexts, taken = [], 0

    def make_page(**settings: Any) -> Any:
        contexts.append(chromium.new_context(**settings))
        page = contexts[-1].new_page()
        page.on("request", lambda request: page.requests.append(request.url))
        page.on("console", lambda message: page.complaints.append(message.text))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        return page

    def take_page(viewport: dict[str, int] | None, color_scheme: str | None) -> Any:
        nonlocal taken
        if taken == len(kept_pages):
            kept_pages.append(make_page())
            contexts.pop()
        page = kept_pages[taken]
        taken += 1
        page.set_viewport_size(viewport or {"width": 1280, "height": 720})
        page.emulate_media(media="null", color_scheme=color_scheme or "null")
        page.mouse.move(0, 0)
        return page

    def open_page(text: str, *, apart: bool = False, **settings: Any) -> Any:
        path = tmp_path / "report.html"
        path.write_text(text, encoding="utf-8")
        if apart or settings.keys() - {"viewport", "color_scheme"}:
            page = make_page(**settings)
        else:
            page = take_page(settings.get("viewport"), settings.get("color_scheme"))
        page.requests, page.complaints = [], []
        page.goto(path.as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
