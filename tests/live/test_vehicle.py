"""A vehicle over MAVLink, played by pymavlink in another process."""

import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from agonic.live.streams import Chunk, Notice, open_source
from agonic.live.streams.vehicle import Parameters, list_wanted
from agonic.live.web.plan import Plan
from agonic.live.web.session import Session
from agonic.reference import Reference
from tests.live.peer import FIELD, PARAMETERS, RAW_BIAS

pytest.importorskip("pymavlink")
MG = 100.0


@pytest.fixture
def vehicle(tmp_path):
    """Starts a vehicle and a session that listens to it."""
    running = []

    def start(autopilot, lost=""):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        source = open_source(f"mavlink+udp://127.0.0.1:{port}")
        session = Session(source, Plan(folder=tmp_path, reference=Reference.constant(50_000.0)))
        session.start()
        script = Path(__file__).with_name("peer.py")
        command = [sys.executable, str(script), str(port), str(autopilot), *filter(None, [lost])]
        running.append((session, subprocess.Popen(command)))
        return session

    yield start
    for session, process in running:
        process.kill()
        process.wait()
        session.stop()


def until(what, seconds=15.0):
    limit = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < limit, "never happened"
        time.sleep(0.05)


@pytest.mark.slow
def test_readings_are_taken_back_and_a_result_is_written_and_read_back(vehicle, tmp_path):
    session = vehicle(3)
    until(lambda: session.status.sensors and session.status.sensors[0].n > 150)
    assert session.source.stack == "ardupilot"
    outcome = session.accept()[0]
    assert outcome.verdict == "good", outcome.status
    made = session.results[0].fit.calibration
    # rounding of what is sent to whole milligauss: 0.29 mG on each axis of each reading
    np.testing.assert_allclose(made.bias, RAW_BIAS * MG, atol=0.3 * MG)
    np.testing.assert_allclose(made.matrix, np.eye(3) * 500.0 / FIELD, atol=2e-3)
    assert (made.frame_in, made.device_id) == ("b", 97539)
    assert (tmp_path / "RAW_IMU.param").is_file()

    session.offer("RAW_IMU")
    offered = {one.name: one for one in session.status.offer}
    assert offered["COMPASS_OFS_X"].old == PARAMETERS["COMPASS_OFS_X"]
    assert offered["COMPASS_OFS_X"].new == pytest.approx(-RAW_BIAS[0], abs=0.3)
    assert offered["COMPASS_OFS_X"].read_back is None
    session.write("RAW_IMU")
    assert session.status.device_says == "written and read back: the device has it"
    assert all(
        one.read_back == pytest.approx(one.new, abs=1e-4, rel=1e-6) for one in session.status.offer
    )
    # with the new parameters the readings are still taken back to what the sensor read
    session.restart(None)
    until(lambda: session.status.sensors and session.status.sensors[0].n > 100)
    again = session._watched["RAW_IMU"].live.calibration
    np.testing.assert_allclose(again.bias, RAW_BIAS * MG, atol=0.5 * MG)


@pytest.mark.slow
def test_nothing_is_written_that_was_not_offered(vehicle):
    session = vehicle(3)
    until(lambda: session.status.sensors and session.status.sensors[0].n > 100)
    session.write("RAW_IMU")
    assert session.status.offer == []
    assert session.source.decoder.parameters.values["COMPASS_OFS_X"] == -120.0


def test_px4_is_refused_with_the_reason(vehicle):
    session = vehicle(12)
    until(lambda: "PX4" in session.status.heard)
    assert "corrected" in session.status.heard
    time.sleep(0.5)
    assert session.status.sensors == []


def test_others_are_taken_as_they_send(vehicle):
    session = vehicle(0)
    until(lambda: len(session.status.sensors) == 2)
    units = {name: watched.params.unit for name, watched in session._watched.items()}
    assert units == {"RAW_IMU": "raw", "HIGHRES_IMU": "mG"}


def test_a_vehicle_that_hides_a_parameter_is_refused(vehicle, monkeypatch):
    monkeypatch.setattr("agonic.live.streams.vehicle.ASK_AGAIN_S", 0.05)
    monkeypatch.setattr("agonic.live.streams.vehicle.LIST_S", 0.5)
    session = vehicle(3, "COMPASS_OFS_Y")
    until(lambda: "COMPASS_OFS_Y" in session.status.heard)
    assert "cannot be taken back" in session.status.heard
    assert session.status.sensors == []


def test_a_whole_list_tells_what_is_absent():
    class Told:
        param_count = 3

        def __init__(self, index, name):
            self.param_index, self.param_id, self.param_value = index, name, 1.0

    asked, all_asked = [], []
    parameters = Parameters(asked.append, lambda: all_asked.append(1))
    for k in range(7):
        parameters.pursue("", 10.0 * k)
    assert set(asked) == set(list_wanted(""))
    assert all_asked == [1]
    for index, name in enumerate(list_wanted("")[:3]):
        assert parameters.missing("")
        parameters.take(Told(index, name), 70.0)
    assert parameters.missing("") == []  # old firmware, without a matrix


def test_noise_on_the_wire_harms_nothing():
    vehicle = open_source("mavlink+udp://127.0.0.1:1").decoder
    rng = np.random.default_rng(0)
    from agonic.live.streams.links import Packet

    events = []
    for k in range(100):
        events += vehicle.feed(Packet(rng.bytes(2000)), 0.1 * k)
    assert not any(isinstance(event, Chunk | Notice) for event in events)
