"""A sensor on a TCP port that a test turns, disturbs and unplugs, and the command that reads it.

With AGONIC_PICTURES the tests of the page leave their pictures in that folder, for the docs.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

FIELD_N = 50_000 * np.array([0.5, 0.0, np.sqrt(0.75)])
BIAS = np.array([12_000.0, -5000.0, 3000.0])
HEADER = b"time_s,mag_x_nT,mag_y_nT,mag_z_nT\n"


def started(source, *options):
    """`agonic live` on a source: the process, and the address of its page."""
    process = subprocess.Popen(
        [sys.executable, "-m", "agonic", "live", source, "--port", "0", *options],
        stdout=subprocess.PIPE,
        text=True,
    )
    return process, re.search(r"http://\S+", process.stdout.readline())[0]


class Sensor:
    """Sends 100 readings a second; `moving` turns it, `near_metal` adds 18 % to the field."""

    def __init__(self):
        self.moving, self.near_metal, self.rate_Hz = True, False, 100.0
        self._rng = np.random.default_rng(5)
        self._attitude, self._rate = Rotation.random(rng=self._rng), np.zeros(3)
        self._server = self._peer = None
        self.port = 0
        self._stop, self._sending = threading.Event(), threading.Lock()
        self.plug()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def plug(self):
        self._server = socket.create_server(("127.0.0.1", self.port))
        self._server.settimeout(0.02)
        self.port = self._server.getsockname()[1]

    def unplug(self):
        for one in (self._server, self._peer):
            if one is not None:
                one.close()
        self._server = self._peer = None

    def reading(self, step_s):
        if self.moving:
            self._rate += step_s * (
                8 * self._rng.normal(size=3) / np.sqrt(step_s) - 1.5 * self._rate
            )
            self._attitude = self._attitude * Rotation.from_rotvec(self._rate * step_s)
        field = self._attitude.inv().apply(FIELD_N) * (1.18 if self.near_metal else 1.0)
        return field + BIAS + 100 * self._rng.normal(size=3)

    def send(self, *pieces):
        """Send pieces of bytes, and no readings between them."""
        with self._sending:
            for data in pieces:
                self._peer.sendall(data)

    def _run(self):
        began, sent = time.monotonic(), 0
        while not self._stop.is_set():
            time.sleep(0.01)
            try:
                if self._peer is None and self._server is not None:
                    self._peer, _ = self._server.accept()
                    self._peer.sendall(HEADER)
                    began, sent = time.monotonic(), 0
                if self._peer is None:
                    continue
                due = int((time.monotonic() - began) * self.rate_Hz)
                rows = [self.reading(1 / self.rate_Hz) for _ in range(due - sent)]
                lines = [
                    f"{(sent + k) / self.rate_Hz:.3f},{x:.1f},{y:.1f},{z:.1f}\n"
                    for k, (x, y, z) in enumerate(rows)
                ]
                self.send("".join(lines).encode())
                sent = due
            except (OSError, AttributeError):
                if self._peer is not None:
                    self._peer.close()
                self._peer = None

    def close(self):
        self._stop.set()
        self._thread.join(2.0)
        self.unplug()


def stopped(process):
    """Interrupt, and wait for a good end."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) in (0, -signal.SIGKILL)
    process.stdout.close()


@pytest.fixture
def sensor():
    one = Sensor()
    yield one
    one.close()


@pytest.fixture
def live(tmp_path):
    """Runs `agonic live` on a source; gives the address of its page."""
    running = []

    def start(source, *options):
        start.process, address = started(source, *options, "-o", str(tmp_path / "out"))
        running.append(start.process)
        return address

    yield start
    for process in running:
        stopped(process)


@pytest.fixture(scope="module")
def three_sensors(tmp_path_factory):
    """The address of a page with three simulated sensors, for tests that only look at it."""
    folder = tmp_path_factory.mktemp("three")
    process, address = started("sim?sensors=3&rate=20", "-o", str(folder))
    yield address
    stopped(process)


@pytest.fixture
def page(chromium):
    contexts = []

    def open_page(address, **settings):
        contexts.append(chromium.new_context(viewport={"width": 1100, "height": 900}, **settings))
        one = contexts[-1].new_page()
        one.complaints, one.foreign = [], []
        one.on(
            "console",  # the test reads pixels, which the browser remarks on
            lambda m: None if m.text.startswith("Canvas2D") else one.complaints.append(m.text),
        )
        one.on("pageerror", lambda error: one.complaints.append(str(error)))
        one.on(
            "request",
            lambda r: (
                None
                if "127.0.0.1" in r.url or r.url.startswith("data:")
                else one.foreign.append(r.url)
            ),
        )
        one.goto(address)
        return one

    yield open_page
    for context in contexts:
        context.close()


@pytest.fixture
def picture():
    """Takes a picture of a page for the docs, where they are asked for."""
    folder = os.environ.get("AGONIC_PICTURES")

    def take(page, name, part=None):
        if folder:
            (page.locator(part) if part else page).screenshot(path=Path(folder, name))

    return take
