"""Wires: serial through a pseudo-terminal, TCP and UDP, cut and connected again."""

import os
import pty
import socket
import threading
import time
import tty
from queue import Empty, Queue

import numpy as np
import pytest

from agonic.errors import AgonicError, LogError
from agonic.exports.csv import write_csv
from agonic.live.streams import Chunk, Notice, open_source
from agonic.live.streams.connection import Connection, LineDecoder
from agonic.live.streams.links import SerialLink
from agonic.simulation import simulate


class Running:
    """A source read in a thread; `wait` gives the first event that is asked for."""

    def __init__(self, source):
        self.stop, self.events = threading.Event(), Queue()
        self.thread = threading.Thread(target=self._run, args=(source,), daemon=True)
        self.thread.start()

    def _run(self, source):
        for event in source.events(self.stop):
            self.events.put(event)

    def wait(self, what, seconds=5.0):
        until = time.monotonic() + seconds
        heard = []
        while time.monotonic() < until:
            try:
                heard.append(self.events.get(timeout=0.1))
            except Empty:
                continue
            if what(heard[-1]):
                return heard[-1]
        raise AssertionError(f"not heard: {heard[-5:]}")

    def close(self):
        self.stop.set()
        self.thread.join(3.0)
        assert not self.thread.is_alive()


@pytest.fixture
def running():
    begun = []

    def run(source):
        begun.append(Running(source))
        return begun[-1]

    yield run
    for one in begun:
        one.close()


def chunk(event):
    return isinstance(event, Chunk)


def says(text):
    return lambda event: isinstance(event, Notice) and text in event.text


def test_serial_unplugged_and_plugged_again(running, tmp_path):
    port = tmp_path / "ttyUSB0"

    def plugged():
        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(theirs))
        return ours, theirs

    ours, theirs = plugged()
    heard = running(open_source(f"serial:{port}:115200"))
    heard.wait(says("connected"))
    os.write(ours, b"\xff\x00garbage\nRaw:0,0,0,0,0,0,100,-200,300\n")
    first = heard.wait(chunk)
    assert first.unit == "mG"
    np.testing.assert_array_equal(first.field, [[100, -200, 300]])
    port.unlink()
    os.close(ours)
    os.close(theirs)
    assert not heard.wait(says("trying again")).connected
    ours, theirs = plugged()
    heard.wait(says("connected"))
    os.write(ours, b"Raw:0,0,0,0,0,0,1,2,3\n")
    np.testing.assert_array_equal(heard.wait(chunk).field, [[1, 2, 3]])
    os.close(ours)
    os.close(theirs)


def test_the_speed_of_a_port_is_its_last_part():
    link = open_source("serial:/dev/ttyACM1").link
    assert isinstance(link, SerialLink)
    assert (link.device, link.baud) == ("/dev/ttyACM1", 115_200)
    link = open_source("serial:COM3:9600").link
    assert (link.device, link.baud) == ("COM3", 9600)


@pytest.mark.parametrize(
    ("text", "port"),
    [
        ("/dev/ttyUSB0", ("/dev/ttyUSB0", 115_200)),
        ("/dev/cu.usbserial-10:57600", ("/dev/cu.usbserial-10", 57_600)),
        ("COM3", ("COM3", 115_200)),
        ("com12:9600", ("com12", 9600)),
        ("mavlink+/dev/ttyACM0", ("/dev/ttyACM0", 115_200)),
    ],
)
def test_a_serial_port_goes_by_its_own_name(text, port):
    link = open_source(text).link
    assert isinstance(link, SerialLink)
    assert (link.device, link.baud) == port


def test_tcp_is_connected_again(running):
    server = socket.create_server(("127.0.0.1", 0))
    heard = running(open_source(f"tcp://127.0.0.1:{server.getsockname()[1]}", unit="uT"))
    for k in range(2):
        peer, _ = server.accept()
        heard.wait(says("connected"))
        peer.sendall(b"%d,2,3\n" % k)
        assert heard.wait(chunk).field[0, 0] == k
        peer.close()
        heard.wait(says("trying again"))
    server.close()


def test_udp_tells_senders_apart(running):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    heard = running(open_source(f"udp://127.0.0.1:{port}"))
    heard.wait(says("connected"))
    names = []
    for _ in range(2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"1,2,3", ("127.0.0.1", port))
            names.append(heard.wait(chunk).sensor)
    assert names[0] == "mag"
    assert names[1].startswith("mag from 127.0.0.1:")
    heard.wait(says("silent"))


def test_a_taken_port_is_an_error():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        source = open_source(f"udp://127.0.0.1:{taken.getsockname()[1]}")
        with pytest.raises(AgonicError, match="cannot listen"):
            list(source.events(threading.Event()))


def test_a_flood_of_readings_waits():
    class Flood:
        name, hint = "flood", ""

        def open(self): ...
        def write(self, data): ...
        def close(self): ...

        def read(self):
            from agonic.live.streams.links import Packet

            return Packet(b"1,2,3\n" * 1000)

    stop, rows, began = threading.Event(), 0, time.monotonic()
    for event in Connection(Flood(), LineDecoder("raw")).events(stop):
        rows += len(event.time) if chunk(event) else 0
        if time.monotonic() - began > 1.5:
            stop.set()
    assert rows <= 15_000


class Clock:
    """Time that passes by being waited for."""

    now = 0.0

    def wait(self, seconds):
        self.now += seconds

    def is_set(self):
        return False


def test_a_log_is_replayed_at_its_own_pace(monkeypatch, tmp_path):
    made = simulate("tumble", n=50, rate_Hz=50.0).samples
    path = write_csv(made, tmp_path / "log.csv")
    whole = list(open_source(str(path), speed=0).events(threading.Event()))
    np.testing.assert_array_equal(np.concatenate([e.field for e in whole if chunk(e)]), made.field)
    assert whole[-1].ended
    clock = Clock()
    monkeypatch.setattr("agonic.live.streams.replay.time.monotonic", lambda: clock.now)
    paced = list(open_source(str(path), speed=2.0).events(clock))
    np.testing.assert_array_equal(np.concatenate([e.field for e in paced if chunk(e)]), made.field)
    assert clock.now == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("tcp://:80", "HOST:PORT"),
        ("udp://", "PORT"),
        ("ftp://host", "names no source"),
        ("mavlink+ftp://x:1", "names no source"),
        ("sim?colour=red", "no setting 'colour'"),
        ("sim?rate=fast", "not a number"),
    ],
)
def test_what_names_no_source(text, why):
    with pytest.raises(AgonicError, match=why):
        open_source(text)
    with pytest.raises(LogError):
        open_source("nothing-here.csv")
