"""Writing to a device from the page: old and new are shown, and only a yes writes."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.live.browsing import wait
from tests.live.motioncal_device import Device

OPEN = "document.getElementById('confirm').open"
SAYS = "document.getElementById('confirm-says').textContent"


def settings(page):
    """The table of the dialog: name, in the device, new, read back."""
    rows = page.eval_on_selector_all(
        "#settings tr", "all => all.map(row => [...row.cells].map(cell => cell.textContent))"
    )
    return {name: [number(cell) for cell in cells] for name, *cells in rows}


def number(cell):
    return float(cell.replace("\u2212", "-")) if cell not in ("", "not reported") else cell


def offered(page, readings):
    """Ask for the dialog, as soon as there are so many readings."""
    wait(page, f"window.__stat.points > {readings}")
    page.click("button.device:not([disabled])")
    wait(page, OPEN, 30)


@pytest.fixture
def vehicle():
    """An ArduPilot vehicle in a process of its own; `told` gives what was set in it."""
    pytest.importorskip("pymavlink")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    script = Path(__file__).with_name("peer.py")
    command = [sys.executable, str(script), str(port), "3"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    yield port, lambda: (process.kill(), process.communicate()[0].split("\n")[:-1])[1]
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_vehicle_is_written_only_after_a_yes(vehicle, live, page, picture):
    port, told = vehicle
    shown = page(live(f"mavlink+udp://127.0.0.1:{port}", "--field", "50000"))
    offered(shown, 200)
    table = settings(shown)
    assert table["COMPASS_OFS_X"][0] == -120.0
    assert table["COMPASS_OFS_X"][1] == pytest.approx(-250.0, abs=0.5)
    assert table["COMPASS_OFS_X"][2] == ""
    assert table["COMPASS_LEARN"][:2] == [3.0, 0.0]
    picture(shown, "live-write.png", "#confirm")
    for leave in (lambda: shown.click("#leave"), lambda: shown.keyboard.press("Escape")):
        leave()
        wait(shown, f"!{OPEN}")
        offered(shown, 200)
        assert settings(shown) == table  # nothing was written
    shown.focus("#write")
    shown.keyboard.press("Enter")
    wait(shown, f"/written and read back/.test({SAYS})")
    after = settings(shown)
    assert {name: row[1] for name, row in after.items()} == {n: r[1] for n, r in table.items()}
    for _, new, read_back in after.values():
        assert read_back == pytest.approx(new, rel=1e-6, abs=1e-6)
    assert shown.is_disabled("#write")
    shown.click("text=Close")
    wait(shown, f"!{OPEN}")
    assert shown.complaints == []
    sets = told()
    assert {line.split()[0] for line in sets} == set(table)


@pytest.mark.slow
def test_a_motioncal_device_is_written_only_after_a_yes(live, page):
    device = Device()
    try:
        shown = page(live(f"serial:{device.path}", "--field", "50000"))
        offered(shown, 200)
        table = settings(shown)
        assert [row[0] for row in table.values()] == ["not reported"] * 10
        shown.click("#leave")
        wait(shown, f"!{OPEN}")
        shown.wait_for_timeout(200)
        assert device.kept is None
        offered(shown, 200)
        shown.click("#write")
        wait(shown, f"/written and read back/.test({SAYS})")
        new = [row[1] for row in table.values()]
        np.testing.assert_allclose(device.kept[6:], new, rtol=1e-5, atol=1e-5)
        shown.click("text=Close")
        wait(shown, f"!{OPEN}")
        offered(shown, 200)  # now the device has told what it keeps
        np.testing.assert_allclose([row[0] for row in settings(shown).values()], new, atol=1e-4)
        assert shown.complaints == []
    finally:
        device.close()
