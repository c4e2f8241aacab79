"""The live page under load: 50 000 points at 100 Hz in headless Chromium.

    python -m benchmarks.live [--quick]

Frames a second and latency are what the page measures (`window.__stat`), the server's share of a
core is its own processor time over the wall's, with the browser on the same machine.
"""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path
from typing import Any

import numpy as np

import agonic as ag
from benchmarks import tables

POINTS, RATE_HZ = 50_000, 100.0

INTRODUCTION = """The live page in headless Chromium, filled with 50 000 readings and then fed at
100 Hz; frames a second, latency in ms, percent of a core and MB of the server. Then a line of 1 GB
without an end through a pseudo-terminal."""


def processor_s(pid: int) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def megabytes(pid: int) -> float:
    """Memory that a process holds."""
    text = Path(f"/proc/{pid}/status").read_text()
    return float(re.search(r"VmRSS:\s+(\d+)", text)[1]) / 1e3  # type: ignore[index]


def served(folder: str, log: Path, seconds: float) -> dict[str, Any]:
    """Fill the page, then watch it at 100 readings a second."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "agonic", "live", str(log), "--field", "50000"]
    process = subprocess.Popen(
        [*command, "--port", "0", "-o", folder], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    address = re.search(r"http://\S+", process.stdout.readline())[0]  # type: ignore[index]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1100, "height": 900})
        page.goto(address)
        while page.evaluate("window.__stat.points") < 0.98 * POINTS:
            time.sleep(0.2)
        time.sleep(2.0)
        used, began, frames = processor_s(process.pid), time.monotonic(), "window.__stat.frames"
        first, latency = page.evaluate(frames), []
        while time.monotonic() - began < seconds:
            time.sleep(0.1)
            latency.append(page.evaluate("window.__stat.latency"))
        wall = time.monotonic() - began
        result = {
            "points on the page": page.evaluate("window.__stat.points"),
            "frames a second": (page.evaluate(frames) - first) / wall,
            "latency, median, ms": float(np.median(latency)),
            "latency, 95 %, ms": float(np.percentile(latency, 95)),
            "server, % of a core": 100 * (processor_s(process.pid) - used) / wall,
            "server, MB": megabytes(process.pid),
        }
        browser.close()
    process.kill()
    process.wait()
    return result


def flooded(folder: str, size: float = 1e9) -> dict[str, float]:
    """A line of so many bytes without an end, through a pseudo-terminal: time and room."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    command = [sys.executable, "-m", "agonic", "live", f"serial:{os.ttyname(theirs)}"]
    process = subprocess.Popen(
        [*command, "--port", "0", "-o", folder], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(1.0)
    before, began, block, sent = megabytes(process.pid), time.monotonic(), b"8" * 65_536, 0
    while sent < size:
        sent += os.write(ours, block)
    wall = time.monotonic() - began
    os.write(ours, b"\n")
    result = {"1 GB line, s": wall, "1 GB line, MB more": megabytes(process.pid) - before}
    process.kill()
    process.wait()
    return result


def main() -> None:
    """Write a log whose first 50 000 readings come at once and the rest at 100 Hz, and play it."""
    seconds = 5.0 if tables.arguments("the live page under load", draws=1).quick else 30.0
    more = int((seconds + 60) * RATE_HZ)
    made = ag.simulate("tumble", n=POINTS + more, rate_Hz=RATE_HZ, noise=150.0).samples
    time_s = np.concatenate([np.arange(POINTS) * 1e-4, 5.0 + np.arange(more) / RATE_HZ])
    with tempfile.TemporaryDirectory() as folder:
        samples = ag.Samples(time=time_s, field=made.field)
        log = ag.write_csv(samples, Path(folder, "log.csv"))
        measured = served(folder, log, seconds) | flooded(folder)
        rows = [(name, f"{value:.1f}") for name, value in measured.items()]
    print(INTRODUCTION, tables.markdown(("", "measured"), rows), sep="\n\n")


if __name__ == "__main__":
    main()
