"""Reading MAVLink telemetry: against pymavlink, against simulated truth, and damaged."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agonic.errors import LogError, MissingExtraError
from agonic.logs.ardupilot import dataflash as read_dataflash
from agonic.logs.ardupilot.dataflash_binary import load
from agonic.logs.ardupilot.mavlink import decode, find_packets, load_definitions
from agonic.logs.ardupilot.tlog import accepts, read
from agonic.logs.log import Log
from agonic.logs.read import open_log
from agonic.provenance import Input
from tests.logs.damage import damaged, read_or_refused
from tests.logs.dataflash_writer import dataflash
from tests.logs.dataflash_writer import parameters as logged_parameters
from tests.logs.tlog_writer import START_S, Sent, heartbeat, packet, parameters, stamped, tlog

ARDUPILOT, PX4, INVALID = 3, 12, 8
MG = 100.0  # nT
N = 200
SECONDS = 10.0 + 0.1 * np.arange(N)

OFFSET = np.array([-120.25, 75.5, 230.75])  # mG, added by the autopilot
SOFT_IRON = np.array([[1.08, 0.06, -0.04], [0.06, 0.93, 0.02], [-0.04, 0.02, 1.01]])
COMPASS = {
    "COMPASS_OFS_X": OFFSET[0],
    "COMPASS_OFS_Y": OFFSET[1],
    "COMPASS_OFS_Z": OFFSET[2],
    "COMPASS_DIA_X": 1.08,
    "COMPASS_DIA_Y": 0.93,
    "COMPASS_DIA_Z": 1.01,
    "COMPASS_ODI_X": 0.06,
    "COMPASS_ODI_Y": -0.04,
    "COMPASS_ODI_Z": 0.02,
    "COMPASS_SCALE": 0.0,
}
SECOND = {"COMPASS_OFS2_X": 40.0, "COMPASS_OFS2_Y": -30.0, "COMPASS_OFS2_Z": 20.0}


def load_log(path: Path) -> Log:
    return read(path, Input(name=path.name, sha256="0" * 64, count=0))


@pytest.fixture
def written(tmp_path: Path) -> Any:
    """Write a log and read it."""

    def write_and_read(*parts: bytes) -> Log:
        path = tmp_path / "flight.tlog"
        path.write_bytes(b"".join(parts))
        return load_log(path)

    return write_and_read


def raw_readings() -> np.ndarray:
    """Readings before any correction, mG: all over a sphere about the offset's opposite."""
    directions = np.random.default_rng(1).normal(size=(N, 3))
    return 520.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True) - OFFSET


def corrected(raw: np.ndarray, offset: np.ndarray = OFFSET, matrix: Any = SOFT_IRON) -> np.ndarray:
    """What the autopilot sends: whole milligauss, cut."""
    return np.trunc((raw + offset) @ np.asarray(matrix).T)


def imu(name: str, field: np.ndarray, seconds: np.ndarray = SECONDS, **others: Any) -> list[Sent]:
    """Messages of an inertial unit with a magnetometer, on the vehicle's clock `seconds`."""
    usec = name in ("RAW_IMU", "HIGHRES_IMU")
    clock, ticks = ("time_usec", 1e6) if usec else ("time_boot_ms", 1e3)
    whole = float if name == "HIGHRES_IMU" else int
    return [
        (
            t,
            name,
            {clock: round(t * ticks), "xmag": whole(x), "ymag": whole(y), "zmag": whole(z)}
            | others,
        )
        for t, (x, y, z) in zip(seconds.tolist(), field.tolist(), strict=True)
    ]


def beats(autopilot: int = ARDUPILOT) -> list[Sent]:
    return [(float(t), *heartbeat(autopilot)) for t in range(10, 30)]


# --- truth: what the sensor measured comes back ------------------------------------------------


@pytest.mark.parametrize("version", [1, 2])
def test_raw_readings_come_back(written: Any, version: int) -> None:
    raw = raw_readings()
    sent = [*parameters(COMPASS), *beats(), *imu("RAW_IMU", corrected(raw))]
    log = written(tlog(sent, version=version))
    (sensor,) = log.sensors
    worst = np.linalg.norm(np.linalg.inv(SOFT_IRON), np.inf)  # of cutting to 1 mG
    assert np.abs(sensor.field - raw * MG).max() <= 1.001 * worst * MG
    assert sensor.logged is not None
    np.testing.assert_allclose(sensor.logged.bias, -OFFSET * MG)
    np.testing.assert_allclose(sensor.logged.matrix, SOFT_IRON, rtol=1e-6)
    assert (sensor.frame, sensor.unit, sensor.name) == ("b", "nT", "RAW_IMU")
    assert (log.stack, log.format, log.notes) == ("ardupilot", "MAVLink telemetry", ())


def test_each_message_is_of_a_compass_with_parameters_of_its_own(written: Any) -> None:
    raw = raw_readings()
    offsets = np.array(list(SECOND.values()))
    third = {name.replace("2", "3"): -value for name, value in SECOND.items()}
    log = written(
        tlog(
            [
                *parameters(COMPASS | SECOND | third),
                *beats(),
                *imu("RAW_IMU", corrected(raw)),
                *imu("SCALED_IMU", corrected(raw)),  # the first compass once more
                *imu("SCALED_IMU2", corrected(raw, offsets, np.eye(3))),
                *imu("SCALED_IMU3", corrected(raw, -offsets, np.eye(3))),
                *imu("HIGHRES_IMU", corrected(raw) * 1e3, fields_updated=0x1FFF),
            ]
        )
    )
    assert [sensor.name for sensor in log.sensors] == ["RAW_IMU", "SCALED_IMU2", "SCALED_IMU3"]
    for sensor in log.sensors:
        assert np.abs(sensor.field - raw * MG).max() <= 130.0


def test_a_telemetry_log_and_a_dataflash_log_of_one_flight_agree(
    written: Any, tmp_path: Path
) -> None:
    """The same readings, the same parameters, the same attitude: through both readers."""
    field, heading = corrected(raw_readings()), (300.0 + 7.0 * SECONDS) % 360.0
    turns = [
        (t, "ATTITUDE", {"time_boot_ms": round(t * 1e3), "roll": 0.1, "yaw": np.radians(h - 360.0)})
        for t, h in zip(SECONDS.tolist(), heading.tolist(), strict=True)
    ]
    power = [(float(t), "BATTERY_STATUS", {"current_battery": 1250}) for t in SECONDS]
    sent = [*beats(), *imu("RAW_IMU", field, zacc=-1000, xgyro=500), *turns, *power]
    sent.sort(key=lambda message: message[0])
    ours = written(tlog([*parameters(COMPASS), *sent])).sensors[0]
    us = {"TimeUS": np.round(SECONDS * 1e6)}
    path = tmp_path / "flight.bin"
    path.write_bytes(
        dataflash(
            logged_parameters(COMPASS),
            (
                "MAG",
                {
                    **us,
                    **{f"Mag{a}": field[:, k] for k, a in enumerate("XYZ")},
                    **{f"Ofs{a}": np.trunc(OFFSET[k]) for k, a in enumerate("XYZ")},
                },
            ),
            ("ATT", {**us, "Roll": np.degrees(0.1), "Yaw": heading}),
            ("IMU", {**us, "GyrX": 0.5, "AccZ": -9.80665}),
            ("BAT", {**us, "Curr": 12.5}),
        )
    )
    theirs = read_dataflash.read(path, Input(name="", sha256="", count=0)).sensors[0]
    np.testing.assert_allclose(ours.field, theirs.field, atol=1e-6)
    assert set(ours.columns()) == set(theirs.columns())
    tolerances = {"time": 1e-6, "roll_deg": 0.01, "heading_deg": 0.03}  # hundredths in that log
    for name, column in ours.columns().items():
        expected = theirs.columns()[name]
        np.testing.assert_allclose(column, expected, atol=tolerances.get(name, 1e-5), err_msg=name)


def test_a_parameter_that_changes_is_undone_from_there_on(written: Any) -> None:
    raw, late = raw_readings(), SECONDS >= 20.0
    field = np.where(late[:, None], corrected(raw, OFFSET + 50.0), corrected(raw))
    change = parameters({f"COMPASS_OFS_{a}": OFFSET[k] + 50.0 for k, a in enumerate("XYZ")})
    rows = imu("RAW_IMU", field)
    sent = [*parameters(COMPASS, 900), *beats()[:1], *rows[:100], *change, *rows[100:]]
    (sensor,) = written(tlog(sent)).sensors
    assert np.abs(sensor.field - raw * MG).max() <= 130.0
    assert any("changed" in note for note in sensor.notes)


@pytest.mark.parametrize("lost", [*COMPASS, "COMPASS_"])
def test_without_its_parameters_readings_stay_corrected_and_a_note_says_so(
    written: Any, lost: str
) -> None:
    """A single one that is lost on the way makes the rest useless."""
    field = corrected(raw_readings())
    known = [
        (t, n, f) for t, n, f in parameters(COMPASS | SECOND) if lost.encode() not in f["param_id"]
    ]
    (sensor,) = written(tlog([*known, *beats(), *imu("RAW_IMU", field)])).sensors
    np.testing.assert_allclose(sensor.field, field * MG)
    assert sensor.logged is None
    assert any("load them in the ground station" in note for note in sensor.notes)


@pytest.mark.parametrize(("motct", "noted"), [(0.0, False), (2.0, True)])
def test_a_compensation_of_the_motors_is_mentioned(written: Any, motct: float, noted: bool) -> None:
    known = parameters(COMPASS | {"COMPASS_MOTCT": motct})
    (sensor,) = written(tlog([*known, *beats(), *imu("RAW_IMU", raw_readings())])).sensors
    assert any("motors" in note for note in sensor.notes) == noted


def test_silence_is_no_reading(written: Any) -> None:
    """Zeros stand for a compass that is not there or has not measured yet."""
    field = corrected(raw_readings())
    field[:30] = 0.0
    sent = [*beats(), *imu("RAW_IMU", field), *imu("SCALED_IMU2", 0.0 * field)]
    (sensor,) = written(tlog(sent)).sensors
    assert len(sensor) == N - 30
    assert dict(sensor.rejected) == {"no reading": 30}


# --- PX4 and others ----------------------------------------------------------------------------


def test_px4_in_its_units_and_frames(written: Any) -> None:
    field = raw_readings()
    turns = [(t, "ATTITUDE", {"time_boot_ms": round(t * 1e3)}) for t in SECONDS.tolist()]
    old, new = (
        imu("HIGHRES_IMU", field / 1e3, fields_updated=0x3F),
        imu(
            "HIGHRES_IMU", field / 1e3, SECONDS + 0.05, fields_updated=0x1FF, zacc=-9.81, ygyro=0.25
        ),
    )
    sent = [*beats(PX4), *turns, *old, *new, *imu("SCALED_IMU2", field)]
    sent.sort(key=lambda message: message[0])
    log = written(tlog(sent))
    body, own = log.sensors
    assert log.stack == "px4"
    assert (body.name, body.frame, own.name, own.frame) == ("HIGHRES_IMU", "b", "SCALED_IMU2", "m")
    np.testing.assert_allclose(body.time, SECONDS + 0.05)  # not those that repeat a reading
    np.testing.assert_allclose(body.field, field * MG, rtol=1e-6)
    np.testing.assert_allclose(own.field, np.trunc(field) * MG)
    np.testing.assert_allclose(body.acceleration, np.tile([0.0, 0.0, -9.81], (N, 1)), rtol=1e-6)
    np.testing.assert_allclose(body.rotation_rate, np.tile([0.0, 0.25, 0.0], (N, 1)))
    assert own.acceleration is None  # which way that sensor is mounted is not known
    assert own.heading_deg is not None
    assert any(".ulg" in note for note in body.notes)
    assert not any(".ulg" in note for note in own.notes)


def test_a_sensor_that_is_not_a_number_is_none(written: Any) -> None:
    field = raw_readings() / 1e3
    field[:50] = np.nan
    sent = [*beats(PX4), *imu("HIGHRES_IMU", field, fields_updated=0x1FF)]
    (sensor,) = written(tlog(sent)).sensors
    assert dict(sensor.rejected) == {"no reading": 50}
    with pytest.raises(LogError, match="no readings of a magnetometer"):
        written(tlog([*beats(PX4), *imu("HIGHRES_IMU", np.nan * field, fields_updated=0x1FF)]))


def test_raw_numbers_of_an_unknown_autopilot_have_no_unit(written: Any) -> None:
    log = written(tlog([*beats(0), *imu("RAW_IMU", raw_readings())]))
    assert (log.stack, log.sensors[0].unit, log.sensors[0].frame) == ("", "raw", "m")


def test_the_vehicle_with_the_magnetometer_is_read(written: Any) -> None:
    field = corrected(raw_readings())
    link = {"system": 255, "component": 190}
    log = written(
        tlog(beats(PX4), system=7),
        tlog([*beats(INVALID), *imu("RAW_IMU", 2.0 * field)], **link),
        tlog([*beats(), *imu("RAW_IMU", field)], system=3),
        tlog(imu("RAW_IMU", 3.0 * field), system=3, component=44),
    )
    (sensor,) = log.sensors
    np.testing.assert_allclose(sensor.field, field * MG)
    assert log.stack == "ardupilot"
    assert "vehicle 3 was read; not read: 7" in log.notes
    assert {stream.name: stream.rows for stream in log.streams} == {"HEARTBEAT": 20}


def test_without_heartbeats_readings_are_taken_as_sent(written: Any) -> None:
    field = raw_readings()
    log = written(tlog([*parameters(COMPASS), *imu("SCALED_IMU2", field)]))
    np.testing.assert_allclose(log.sensors[0].field, np.trunc(field) * MG)
    assert log.stack == ""
    assert any("no heartbeat" in note for note in log.notes)


# --- what was recorded beside, and when --------------------------------------------------------


def flight(delay: np.ndarray, boot: np.ndarray = SECONDS) -> list[Sent]:
    """Readings whose x, in mG, and headings, in degrees, are ten times the vehicle's seconds."""
    field = np.stack([10.0 * SECONDS, 0 * SECONDS, 0 * SECONDS - 400.0], axis=1)
    readings = imu("RAW_IMU", np.round(field), boot)
    sent = []
    for late, t, ms, (_, name, fields) in zip(delay, SECONDS, boot * 1e3, readings, strict=True):
        turn = {"time_boot_ms": round(ms), "yaw": np.radians((10.0 * t) % 360.0)}
        sent += [(t + late, "ATTITUDE", turn), (t + late, name, fields)]
    return [*beats()[:1], *sent]


def apart(log: Log) -> float:
    """How far headings are from the readings of the same moment, degrees."""
    (s,) = log.sensors
    assert s.heading_deg is not None
    turned = (s.heading_deg - s.field[:, 0] / MG + 180.0) % 360.0 - 180.0
    return float(np.abs(turned).max())


def test_times_are_those_of_the_vehicle_not_of_the_arrival(written: Any) -> None:
    delay = np.random.default_rng(3).uniform(0.0, 3.0, N)
    log = written(tlog(flight(delay)))
    (sensor,) = log.sensors
    np.testing.assert_allclose(sensor.time, SECONDS, atol=1e-6)
    assert apart(log) < 0.02
    assert sensor.epoch is not None
    start = datetime.fromtimestamp(START_S, UTC)
    assert 0.0 <= (sensor.epoch - start).total_seconds() <= 3.0


def test_a_restart_of_the_vehicle_does_not_turn_time_back(written: Any) -> None:
    before = SECONDS < 20.0
    sent = flight(np.zeros(N), np.where(before, SECONDS + 500.0, SECONDS - 19.0))
    (sensor,) = written(tlog(sent)).sensors
    assert len(sensor) == N
    np.testing.assert_allclose(sensor.time, SECONDS + 500.0, atol=2e-3)


def test_a_clock_of_32_bits_is_taken_further(written: Any) -> None:
    boot = SECONDS + 2**32 / 1e6 - 20.0
    sent = flight(np.zeros(N), boot)
    for _, name, fields in sent:
        if name == "RAW_IMU":
            fields["time_usec"] %= 2**32
    (sensor,) = written(tlog(sent)).sensors
    np.testing.assert_allclose(sensor.time, boot, atol=1e-6)


def test_clocks_that_count_from_1970_are_left_aside(written: Any) -> None:
    sent = flight(np.zeros(N))
    for seconds, name, fields in sent:
        if name == "RAW_IMU":
            fields["time_usec"] = round((START_S + seconds + 0.7) * 1e6)
    (sensor,) = written(tlog(sent)).sensors
    np.testing.assert_allclose(sensor.time, SECONDS, atol=1e-3)


def test_without_any_clock_times_are_those_of_the_arrival(written: Any) -> None:
    sent = [(t, "RAW_IMU", fields) for t, _, fields in imu("RAW_IMU", raw_readings(), 0 * SECONDS)]
    moved = [(float(t), n, f) for t, (_, n, f) in zip(SECONDS, sent, strict=True)]
    (sensor,) = written(tlog([*moved, *beats()])).sensors
    assert sensor.time is not None
    assert sensor.epoch is not None
    np.testing.assert_allclose(sensor.time, SECONDS - SECONDS[0], atol=1e-5)
    assert sensor.epoch.timestamp() == pytest.approx(START_S + SECONDS[0], abs=1e-3)


def test_power_and_place(written: Any) -> None:
    lost = {"lat": -330000000, "lon": 1799000000, "alt": 5000}
    sent: list[Sent] = [*beats(), *imu("RAW_IMU", raw_readings())]
    for t in SECONDS.tolist():
        fix = {"fix_type": 3 if t > 20 else 1}
        sent += [
            (t, "BATTERY_STATUS", {"current_battery": -1}),
            (t, "SYS_STATUS", {"current_battery": 321}),
            (t, "VFR_HUD", {"throttle": 40}),
            (t, "GPS_RAW_INT", (lost if t > 20 else {}) | fix),
            (t, "GLOBAL_POSITION_INT", {"lat": 10, "lon": 10, "time_boot_ms": round(t * 1e3)}),
        ]
    s = written(tlog(sorted(sent, key=lambda message: message[0]))).sensors[0]
    np.testing.assert_allclose(s.current_A, 3.21)
    np.testing.assert_allclose(s.throttle, 0.40)
    np.testing.assert_allclose(s.latitude_deg, -33.0)
    np.testing.assert_allclose(s.longitude_deg, 179.9)
    np.testing.assert_allclose(s.altitude_m, 5.0)


def test_the_firmware_is_named(written: Any) -> None:
    banner = (10.0, "STATUSTEXT", {"text": b"ArduCopter V4.5.1 (abcdef)"})
    log = written(tlog([banner, *beats(), *imu("RAW_IMU", raw_readings())]))
    assert log.notes == ("firmware ArduCopter V4.5.1 (abcdef)",)


# --- recordings, and what is none ---------------------------------------------------------------


@pytest.mark.recordings
def test_a_dive(recordings: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = recordings / "vehicle/ardusub/small.tlog"
    assert accepts(path.read_bytes()[:65536])
    log = load_log(path)
    first, second = log.sensors
    known = load_definitions()
    data = load(path)
    packets = find_packets(data)
    messages = {
        name: decode(data, packets.select(packets.kind == known[name].id), known[name]).values
        for name in ("RAW_IMU", "SCALED_IMU2", "SENSOR_OFFSETS")
    }
    for sensor in log.sensors:
        sent = np.stack([messages[sensor.name][f"{axis}mag"] for axis in "xyz"], axis=1)
        assert sensor.logged is not None
        again = (sensor.field - sensor.logged.bias) @ sensor.logged.matrix.T
        np.testing.assert_allclose(again, sent * MG, atol=1e-6)
    offsets = [messages["SENSOR_OFFSETS"][f"mag_ofs_{axis}"][0] for axis in "xyz"]
    assert first.logged is not None
    assert np.abs(first.logged.bias + np.array(offsets) * MG).max() < MG  # sent as whole mG
    assert (len(first), len(second)) == (528, 528)
    assert first.time is not None
    np.testing.assert_allclose(np.median(np.diff(first.time)), 0.5, atol=1e-3)
    assert np.diff(first.time).max() < 1.0
    assert first.epoch is not None
    assert abs((first.epoch - datetime(2023, 5, 4, 17, 4, 11, tzinfo=UTC)).total_seconds()) < 2
    np.testing.assert_allclose(first.latitude_deg, 48.386, atol=0.001)
    assert log.notes == ("firmware ArduSub V4.1.1 BETA5 (66c674c1)",)
    assert capfd.readouterr() == ("", "")


def test_other_files_are_not_taken_for_telemetry() -> None:
    rng = np.random.default_rng(0)
    record = stamped(START_S, packet(*heartbeat(ARDUPILOT)))
    assert accepts(2 * record)
    assert accepts(rng.bytes(500) + 2 * record)  # damaged at its start
    assert not accepts(stamped(START_S, b"")[:3] + record)
    assert not accepts(stamped(-1e8 + 946684800.0, packet(*heartbeat(ARDUPILOT))) * 2)
    assert not any(accepts(rng.bytes(65536)) for _ in range(20))
    assert not accepts(b"")


@pytest.mark.recordings
def test_recordings_of_other_kinds_are_not_taken_for_telemetry(recordings: Path) -> None:
    files = [path for path in recordings.rglob("*") if path.is_file() and path.suffix != ".tlog"]
    assert not [path for path in files if accepts(path.read_bytes()[:65536])]


def test_without_pymavlink_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(tlog(beats()))
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[mavlink\]"):
        open_log(path)


# --- damage ------------------------------------------------------------------------------------


def test_a_log_without_magnetometer_is_refused_with_the_next_move(written: Any) -> None:
    with pytest.raises(LogError, match="have the vehicle send RAW_IMU"):
        written(tlog(beats()))
    with pytest.raises(LogError, match="40 bytes are damaged"):
        written(bytes(40))


def test_a_spoilt_message_is_left_out_and_counted(written: Any) -> None:
    rows = imu("RAW_IMU", corrected(raw_readings()))
    whole = tlog([*parameters(COMPASS), *beats()])
    record = bytearray(tlog(rows[:1]))
    record[8 + 10 + 20] ^= 0x40  # within xmag
    log = written(whole, bytes(record), tlog(rows[1:]))
    assert len(log.sensors[0]) == N - 1
    assert "1 messages with a wrong checksum were left out" in log.notes


def test_noise_costs_only_what_it_hits(written: Any) -> None:
    rows = imu("RAW_IMU", corrected(raw_readings()))
    noise = np.random.default_rng(4).bytes(1000)
    cut = tlog(rows[100:101])[:-7]
    log = written(tlog([*beats(), *rows[:100]]), cut, noise, tlog(rows[101:]), noise[:13])
    (sensor,) = log.sensors
    np.testing.assert_allclose(sensor.time, np.delete(SECONDS - SECONDS[0], 100), atol=1e-3)
    assert log.notes == (
        f"{1000 - 7 + 13} bytes are damaged or cut off and were skipped",
        "1 messages with a wrong checksum were left out",  # the one that was cut
    )


@pytest.mark.slow
@pytest.mark.recordings
def test_damaged_recordings_are_read_or_refused(recordings: Path, tmp_path: Path) -> None:
    data = np.fromfile(recordings / "vehicle/ardusub/small.tlog", np.uint8)[:400_000]
    path = tmp_path / "damaged.tlog"
    rng = np.random.default_rng(6)
    whole = load_log_of(path, data).sensors[0]
    for _ in range(40):
        log = read_or_refused(lambda p: load_log_of(p, damaged(data, rng)), path)
        if log is None:
            continue
        for sensor in log.sensors:
            assert all(np.isfinite(column).all() for column in sensor.columns().values())
        kept = np.isin(log.sensors[0].time, whole.time)
        assert kept.mean() > 0.9  # and what was read, was read right
        if log.sensors[0].logged is not None:
            np.testing.assert_array_equal(
                log.sensors[0].field[kept],
                whole.field[np.isin(whole.time, log.sensors[0].time)],
            )


def load_log_of(path: Path, data: Any) -> Log:
    path.write_bytes(bytes(data))
    return load_log(path)


@pytest.mark.parametrize("length", [0, 1, 7, 8, 15, 16, 17, 18, 26, 5000])
def test_noise_is_refused(tmp_path: Path, length: int) -> None:
    rng = np.random.default_rng(length)
    path = tmp_path / "noise.tlog"
    for _ in range(10):
        path.write_bytes(rng.bytes(length))
        assert read_or_refused(load_log, path) is None
