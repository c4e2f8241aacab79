"""A session that is stopped before Accept goes on from there, and nothing is lost."""

import signal

import numpy as np
import pytest

import agonic as ag
from agonic.errors import AgonicError
from agonic.live.fit import LiveFit
from agonic.live.state import LiveParams
from agonic.live.streams import Chunk, Notice
from agonic.live.web.folder import SavedFits
from agonic.live.web.plan import Plan
from agonic.live.web.session import Session
from tests.live.test_live_server import heard, run

MADE = ag.simulate("tumble", n=1200, rate_Hz=50.0, noise=150.0, seed=4).samples


class Wire:
    """A source that gives rows, each time it is opened; its clock may begin anew."""

    stack, device, lasting = "", None, True

    def __init__(self, rows, name="serial port /dev/ttyUSB0", clock_s=0.0):
        self.rows, self.name, self.clock_s = rows, name, clock_s

    def events(self, stop):
        yield Notice(True, "connected")
        time = MADE.time[self.rows] - MADE.time[self.rows][0] + self.clock_s
        yield Chunk("mag", time, MADE.field[self.rows], "nT")
        stop.wait(20.0)


def sat(folder, rows, **settings):
    """A session in which rows came, stopped."""
    fresh = settings.pop("fresh", False)
    plan = Plan(folder=folder, reference=ag.Reference.constant(50_000.0), fresh=fresh)
    session = Session(Wire(rows, **settings), plan)
    session.start()
    while not session.status.sensors or session.status.sensors[0].n < len(MADE.field[rows]):
        session._stop.wait(0.02)
    session.stop()
    return session


def test_two_sittings_are_one(tmp_path):
    halves = slice(0, 617), slice(617, None)
    first = sat(tmp_path, halves[0], clock_s=500.0)
    assert first.status.notes == []
    assert [path.name for path in tmp_path.iterdir()] == ["mag.live"]
    second = sat(tmp_path, halves[1])  # this machine was started anew, its clock too
    assert "continued from 617 readings" in second.status.notes[0]
    assert second.status.sensors[0].n == 1200
    assert second.shown[0].total >= 1200 - 10  # the page has the points of both
    live = second._watched["mag"].live
    whole = LiveFit(magnitude=50_000.0)
    whole.add(MADE.time, MADE.field)
    np.testing.assert_allclose(
        live.calibration.bias, whole.calibration.bias, atol=0.2 * whole.calibration.sd[:3].min()
    )
    assert (np.diff(live.samples.time) > 0).all()


def test_what_is_accepted_or_begun_again_is_not_gone_on_with(tmp_path):
    session = sat(tmp_path, slice(0, 1000))
    assert session.accept()[0].verdict == "good"
    assert not (tmp_path / "mag.live").exists()
    session.stop()
    assert not (tmp_path / "mag.live").exists()
    session.restart(None)
    session._watched["mag"].take(Chunk("mag", MADE.time[:50], MADE.field[:50], "nT"))
    session.stop()
    assert LiveFit.resume(tmp_path / "mag.live").n == 50
    session.restart("mag")
    assert not (tmp_path / "mag.live").exists()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"fresh": True}, "started again; the earlier readings are kept as mag-1.live"),
        ({"name": "UDP port 5005"}, "holds readings of serial port /dev/ttyUSB0"),
    ],
)
def test_what_is_not_gone_on_with_is_set_aside(tmp_path, settings, said):
    sat(tmp_path, slice(0, 300))
    second = sat(tmp_path, slice(300, 700), **settings)
    assert said in second.status.notes[0]
    assert second.status.sensors[0].n == 400
    assert LiveFit.resume(tmp_path / "mag-1.live").n == 300
    assert LiveFit.resume(tmp_path / "mag.live").n == 400


def test_a_damaged_file_is_set_aside(tmp_path):
    (tmp_path / "mag.live").write_bytes(b"not a state")
    live, said = SavedFits(tmp_path, "a wire").resume(LiveParams())
    assert live is None
    assert "not a usable state" in said
    assert (tmp_path / "mag-1.live").read_bytes() == b"not a state"


def test_a_full_disk_stops_nothing_and_is_told_as_long_as_it_lasts(tmp_path, monkeypatch):
    session = sat(tmp_path, slice(0, 300))

    def full(path, data, **options):
        raise AgonicError(f"cannot write {path}: No space left on device")

    more = Chunk("mag", 60 + MADE.time[300:900], MADE.field[300:900], "nT")
    session._watched["mag"].take(more)
    with monkeypatch.context() as patch:
        patch.setattr("agonic.live.files.write_atomically", full)
        session.stop()
    assert session.status.trouble == session.closing_message
    assert "the readings are not saved: cannot write" in session.closing_message
    assert LiveFit.resume(tmp_path / "mag.live").n == 300
    session.stop()
    assert session.status.trouble == ""
    assert "900 readings saved" in session.closing_message
    assert session.accept()[0].verdict == "good"


def test_a_sensor_that_was_not_asked_for_is_told_once(tmp_path):
    session = Session(Wire(slice(0, 9)), Plan(folder=tmp_path, sensor="compass"))
    for _ in range(3):
        session._take(Chunk("mag", MADE.time[:9], MADE.field[:9], "nT"))
    assert session.status.notes == ["mag is received and not used: only compass was asked for"]
    assert session.shown == []


def test_a_log_or_simulation_begins_again(tmp_path):
    Session(Wire(slice(0, 9)), Plan(folder=tmp_path))
    source = Wire(slice(0, 300))
    source.lasting = False
    session = Session(source, Plan(folder=tmp_path))
    session.start()
    session.stop()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_program_is_stopped_and_started_again(sensor, live, tmp_path):
    source = f"tcp://127.0.0.1:{sensor.port}"
    statuses, *_ = run(lambda: heard(live(source, "--field", "50000"), 1.2))
    before = statuses[-1]["sensors"][0]["n"]
    live.process.send_signal(signal.SIGINT)
    assert live.process.wait(timeout=10) == 0
    assert (tmp_path / "out" / "mag.live").is_file()
    statuses, *_ = run(lambda: heard(live(source, "--field", "50000"), 0.8))
    assert "continued from" in statuses[-1]["notes"][0]
    assert statuses[-1]["sensors"][0]["n"] > before
