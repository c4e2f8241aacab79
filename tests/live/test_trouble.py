"""Whatever a source sends or a driver does: it is told, nothing hangs, and nothing is lost."""

import socket
import threading
import time

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError
from agonic.live.fit import LiveFit
from agonic.live.streams import Chunk, Notice
from agonic.live.streams.replay import Replay
from agonic.live.streams.vehicle import Parameters
from agonic.live.web.plan import Plan
from agonic.live.web.session import Session
from agonic.samples import Samples

MADE = ag.simulate("hand", n=1200, rate_Hz=50.0, noise=150.0, seed=4).samples
GARBLED = ([4512345123451234.0, 12, 3], [4.5e6, 12, 3], [3e5, 0, 0], [0, 0, 0], [np.inf, 1, 2])


class Wire:
    """A source that gives chunks, fails where it finds an error among them, and then waits."""

    stack, device, lasting, name = "", None, True, "serial port /dev/ttyUSB0"

    def __init__(self, *pieces):
        self.pieces = list(pieces)

    def events(self, stop):
        yield Notice(True, "connected")
        while self.pieces:
            piece = self.pieces.pop(0)
            if isinstance(piece, Exception):
                raise piece
            yield Chunk("mag", MADE.time[piece], MADE.field[piece], "nT")
        stop.wait(20.0)


def wait_for(what, seconds=10.0):
    until = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < until
        time.sleep(0.02)
    return found


@pytest.fixture
def begin(tmp_path):
    sessions = []

    def start(source):
        plan = Plan(folder=tmp_path, reference=ag.Reference.constant(50_000.0))
        sessions.append(Session(source, plan))
        sessions[-1].start()
        return sessions[-1]

    yield start
    for session in sessions:
        session.stop()


@pytest.fixture(scope="module")
def clean():
    """The fit to good readings only."""
    live = LiveFit(magnitude=50_000.0)
    live.add(MADE.time, MADE.field)
    assert live.guidance.done
    return live


@pytest.mark.parametrize(
    ("reading", "at"),
    [*((reading, 0) for reading in GARBLED), (GARBLED[0], 57), (GARBLED[2], 700)],
    ids=str,
)
def test_a_reading_that_no_sensor_gives_changes_nothing(reading, at, clean):
    live = LiveFit(magnitude=50_000.0)
    field = MADE.field.copy()
    field[at] = reading
    live.add(MADE.time, field)
    assert live.left_out == 1
    assert live.guidance.done
    moved = live.calibration.bias - clean.calibration.bias
    assert (np.abs(moved) < clean.calibration.sd[:3]).all()
    halves = LiveFit(magnitude=50_000.0)
    for part in (slice(0, 333), slice(333, None)):
        halves.add(MADE.time[part], field[part])
    np.testing.assert_array_equal(halves.state.found.bias, live.state.found.bias)


def test_the_page_tells_of_garbled_readings_and_accept_works(begin):
    made = MADE.field.copy()
    made[[3, 600]] = [4512345123451234.0, 12, 3], [3e5, 0, 0]
    source = Wire()
    source.events = lambda stop: iter(
        [Notice(True, "connected"), Chunk("mag", MADE.time, made, "nT")]
    )
    session = begin(source)
    wait_for(lambda: session.status.sensors and session.status.sensors[0].done)
    assert "mag: 2 readings were left out" in session.status.notes[0]
    assert np.abs(session.shown[0].since(0, 5000)).max() < 1e6  # nor are they drawn
    assert session.accept()[0].verdict == "good"


def test_readings_that_do_not_fit_the_others_are_in_the_verdict(begin):
    """Half-way the wires of x and y are exchanged: the rest is kept out, and that is said."""
    other = MADE.field.copy()
    other[600:] = other[600:, [1, 0, 2]]
    parts = [slice(k, k + 25) for k in range(0, len(other), 25)]
    source = Wire()
    source.events = lambda stop: iter(
        [Notice(True, "connected"), *(Chunk("mag", MADE.time[p], other[p], "nT") for p in parts)]
    )
    session = begin(source)
    wait_for(lambda: session.status.sensors and session.status.sensors[0].n == len(other))
    [outcome] = session.accept()
    assert outcome.verdict == "check"
    assert "of the readings do not fit the others" in outcome.status


def test_a_fit_that_stops_is_told_and_goes_on_with_the_next_readings(begin, monkeypatch):
    session = begin(source := Wire(slice(0, 600)))
    wait_for(lambda: session.status.sensors and session.status.sensors[0].n == 600)
    add = LiveFit.add

    def fail_once(self, *rows):
        monkeypatch.setattr(LiveFit, "add", add)
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(LiveFit, "add", fail_once)
    session._take(Chunk("mag", MADE.time[600:610], MADE.field[600:610], "nT"))
    note = wait_for(lambda: session.status.notes)[0]
    assert "mag: the fit stopped (LinAlgError: Singular matrix)" in note
    session._take(Chunk("mag", MADE.time[610:], MADE.field[610:], "nT"))
    wait_for(lambda: session.status.sensors[0].n == 1190)  # the ten that stopped it are missing
    assert session.accept()[0].verdict == "good"
    assert source.pieces == []


def test_a_fit_that_cannot_go_on_begins_anew_and_keeps_what_was_saved(begin, tmp_path):
    session = begin(Wire(slice(0, 600)))
    wait_for(lambda: session.status.sensors and session.status.sensors[0].n == 600)
    session._save()
    state = session._watched["mag"].live.state
    object.__setattr__(state, "found", "nonsense")
    session._take(Chunk("mag", MADE.time[600:605], MADE.field[600:605], "nT"))
    note = wait_for(lambda: session.status.notes)[0]
    assert "started again; the earlier readings are kept as mag-1.live" in note
    assert LiveFit.resume(tmp_path / "mag-1.live").n == 600
    session._take(Chunk("mag", MADE.time, MADE.field, "nT"))
    wait_for(lambda: session.status.sensors[0].done)


@pytest.mark.parametrize("name", ["kept", "recent", "waiting", "voxels"])
def test_a_saved_state_that_was_poisoned_is_not_taken_up(name, tmp_path):
    live = LiveFit(magnitude=50_000.0)
    live.add(MADE.time, MADE.field)
    table = live.state.voxels.sums if name == "voxels" else getattr(live.state, name)
    table[-1] = np.nan if name == "voxels" else 4.5e15
    live.save(tmp_path / "mag.live")
    with pytest.raises(LogError, match=r"no sensor gives|damaged"):
        LiveFit.resume(tmp_path / "mag.live")


def test_every_wrong_bit_of_a_saved_state_is_noticed(tmp_path):
    live = LiveFit(magnitude=50_000.0)
    live.add(MADE.time, MADE.field)
    path = live.save(tmp_path / "mag.live")
    whole, draw = path.read_bytes(), np.random.default_rng(4)
    assert LiveFit.resume(path).n == 1200
    for at in draw.integers(len(whole), size=200):
        content = bytearray(whole)
        content[at] ^= 1 << int(draw.integers(8))
        path.write_bytes(content)
        with pytest.raises(LogError, match="not a usable state"):
            LiveFit.resume(path)


def test_a_driver_that_fails_is_told_and_opened_again(begin):
    session = begin(Wire(slice(0, 600), OverflowError("cannot convert"), slice(600, None)))
    wait_for(lambda: "stopped: OverflowError: cannot convert; trying" in session.status.heard)
    assert not session.status.ended
    wait_for(lambda: [one.n for one in session.status.sensors] == [1200])


def test_a_parameter_without_a_number_is_none():
    class Told:
        param_id, param_value, param_index, param_count = "COMPASS_DEV_ID", np.inf, 3, 9

    parameters = Parameters(lambda name: None, lambda: None)
    parameters.take(Told, 0.0)
    assert parameters.values == {}


def test_a_replay_ends_whatever_its_clock():
    for speed, count in ((0.0, 1200), (1.0, 20)):  # nanoseconds in a column of seconds
        rows = Samples(time=1e9 * MADE.time[:count], field=MADE.field[:count], unit="nT")
        events = list(Replay([rows], "log", speed).events(threading.Event()))
        assert sum(len(e.time) for e in events if isinstance(e, Chunk)) == count
        assert events[-1].ended


@pytest.mark.slow
def test_requests_that_are_never_finished_do_not_lock_pages_out(three_sensors):
    from urllib.parse import urlsplit
    from urllib.request import urlopen

    parts = urlsplit(three_sensors)
    half = []
    try:
        for _ in range(300):
            one = socket.create_connection((parts.hostname, parts.port), timeout=5)
            one.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
            half.append(one)
        assert urlopen(three_sensors, timeout=5).status == 200
        half[-1].settimeout(20)
        assert half[-1].recv(1) == b""  # and the server lets them go
    except ConnectionResetError:
        pass
    finally:
        for one in half:
            one.close()
