"""Reading ArduPilot dataflash logs: against pymavlink, against simulated truth, and damaged."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.ardupilot.dataflash import read
from agonic.logs.ardupilot.dataflash_binary import DTYPES, read_binary
from agonic.logs.formats import is_dataflash
from agonic.logs.log import Log
from agonic.logs.rows.calendar import GPS_EPOCH
from agonic.maths.equation.affine import correct
from agonic.provenance import Input
from tests.logs.damage import damaged, read_or_refused
from tests.logs.dataflash_writer import FORMATS, Columns, dataflash, parameters
from tests.logs.levelled import heading_error_deg

MG = 100.0  # nT
N = 400
SECONDS = 10.0 + np.arange(N) * 0.1

OFFSET = np.array([-120.25, 75.5, 230.75])  # mG, added by the autopilot
SOFT_IRON = np.array([[1.08, 0.06, -0.04], [0.06, 0.93, 0.02], [-0.04, 0.02, 1.01]])


def load(path: Path) -> Log:
    return read(path, Input(name=path.name, sha256="0" * 64, count=path.stat().st_size))


@pytest.fixture
def written(tmp_path: Path) -> Any:
    """Write a log and read it."""

    def write_and_read(*tables: tuple[str, Columns], **keywords: Any) -> Log:
        path = tmp_path / "flight.bin"
        path.write_bytes(dataflash(*tables, **keywords))
        return load(path)

    return write_and_read


def sphere(n: int = N, radius: float = 520.0) -> np.ndarray:
    """Raw readings, mG: all over a sphere about the offset's opposite."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(n, 3))
    return radius * directions / np.linalg.norm(directions, axis=1, keepdims=True) - OFFSET


def compass(
    raw: np.ndarray,
    offset: np.ndarray = OFFSET,
    matrix: np.ndarray = SOFT_IRON,
    motor: np.ndarray | None = None,
    instance: int = 0,
    seconds: np.ndarray = SECONDS,
) -> tuple[str, Columns]:
    """MAG messages as the autopilot writes them: corrected, and cut to whole milligauss."""
    moved = np.zeros_like(raw) if motor is None else motor
    field = (raw + offset) @ np.broadcast_to(matrix, (3, 3)).T + moved
    vectors = {"Mag": field, "Ofs": np.broadcast_to(offset, raw.shape), "MO": moved}
    columns: Columns = {
        stem + axis: np.trunc(values[:, k])
        for stem, values in vectors.items()
        for k, axis in enumerate("XYZ")
    }
    return "MAG", {"TimeUS": seconds * 1e6, "I": instance, "Health": 1, **columns}


def named(offset: np.ndarray, matrix: np.ndarray, scale: float = 0.0, slot: str = "") -> dict:
    """COMPASS_* parameters."""
    m = matrix
    dia, odi = np.diag(m), (m[0, 1], m[0, 2], m[1, 2])
    stems = {"OFS": offset, "DIA": dia, "ODI": odi}
    values = {
        f"COMPASS_{stem}{slot}_{axis}": float(value)
        for stem, triple in stems.items()
        for axis, value in zip("XYZ", triple, strict=True)
    }
    return {**values, f"COMPASS_SCALE{slot}": scale}


# --- truth: what the sensor measured comes back ------------------------------------------------


@pytest.mark.parametrize("scale", [0.0, 0.5, 1.0, 1.25, 1.5, 3.0])
def test_raw_readings_come_back(written: Any, scale: float) -> None:
    """Out of 1/1.5…1.5 the autopilot leaves the scale unused, and so must the reader."""
    used = scale if 1 / 1.5 <= scale <= 1.5 else 1.0
    raw = sphere()
    log = written(
        parameters(named(OFFSET, SOFT_IRON, scale)), compass(raw, matrix=used * SOFT_IRON)
    )
    (sensor,) = log.sensors
    worst = np.linalg.norm(np.linalg.inv(used * SOFT_IRON), np.inf)  # of cutting to 1 mG
    assert np.abs(sensor.field - raw * MG).max() <= 1.001 * worst * MG
    assert sensor.logged is not None
    np.testing.assert_allclose(sensor.logged.bias, -OFFSET * MG)
    np.testing.assert_allclose(sensor.logged.matrix, used * SOFT_IRON, rtol=1e-6)
    assert (sensor.frame, sensor.unit, sensor.name) == ("b", "nT", "MAG[0]")


def test_zero_diagonals_mean_identity(written: Any) -> None:
    raw = sphere()
    log = written(parameters(named(OFFSET, np.zeros((3, 3)))), compass(raw, matrix=np.eye(3)))
    assert np.abs(log.sensors[0].field - raw * MG).max() <= 1.001 * MG


def test_the_part_of_the_motors_is_taken_out_before_the_matrix_is_undone(written: Any) -> None:
    raw = sphere()
    motor = np.round(np.linspace(0.0, 90.0, N))[:, None] * [1.0, -1.0, 0.5]
    log = written(parameters(named(OFFSET, SOFT_IRON)), compass(raw, motor=np.trunc(motor)))
    (sensor,) = log.sensors
    assert np.abs(sensor.field - raw * MG).max() <= 130.0
    assert any("motor" in note for note in sensor.notes)


def test_every_compass_has_parameters_of_its_own(written: Any) -> None:
    raw = sphere()
    others = [np.diag([1.1, 0.9, 1.0]), np.diag([0.8, 1.0, 1.2])]
    log = written(
        parameters(
            named(OFFSET, SOFT_IRON)
            | named(-OFFSET, others[0], slot="2")
            | named(OFFSET / 2, others[1], slot="3")
        ),
        compass(raw, instance=0),
        compass(raw, -OFFSET, others[0], instance=1),
        compass(raw, OFFSET / 2, others[1], instance=2),
    )
    assert [sensor.name for sensor in log.sensors] == ["MAG[0]", "MAG[1]", "MAG[2]"]
    for sensor in log.sensors:
        assert np.abs(sensor.field - raw * MG).max() <= 130.0


def test_parameters_that_change_are_undone_row_by_row(written: Any) -> None:
    raw = sphere()
    late = SECONDS >= 30.0
    offset = np.where(late[:, None], OFFSET + 50.0, OFFSET)
    matrix = np.where(late[:, None, None], np.eye(3), SOFT_IRON)
    field = correct((raw + offset)[:, None], np.zeros(3), matrix)[:, 0]
    columns: Columns = {f"Mag{a}": np.trunc(field[:, k]) for k, a in enumerate("XYZ")}
    columns |= {f"Ofs{a}": np.trunc(offset[:, k]) for k, a in enumerate("XYZ")}
    log = written(
        parameters(named(OFFSET, SOFT_IRON)),
        ("MAG", {"TimeUS": SECONDS * 1e6, "I": 0, "Health": 1, **columns}),
        parameters(named(OFFSET + 50.0, np.eye(3)), time_us=29.95e6),
    )
    (sensor,) = log.sensors
    assert np.abs(sensor.field - raw * MG).max() <= 130.0
    assert sensor.logged is not None
    np.testing.assert_allclose(sensor.logged.bias, -(OFFSET + 50.0) * MG)
    assert any("changed" in note for note in sensor.notes)


def test_parameters_listed_after_the_first_readings_hold_for_those_too(written: Any) -> None:
    raw = sphere()
    log = written(compass(raw), parameters(named(OFFSET, SOFT_IRON), time_us=12.0e6))
    (sensor,) = log.sensors
    assert np.abs(sensor.field - raw * MG).max() <= 130.0
    assert not any("changed" in note for note in sensor.notes)


def test_a_compass_without_readings_is_listed(written: Any) -> None:
    log = written(compass(sphere()), compass(np.zeros((N, 3)), np.zeros(3), instance=1))
    assert [np.ptp(s.field) > 0 for s in log.sensors] == [True, False]


def test_unhealthy_readings_are_kept_and_counted(written: Any) -> None:
    name, columns = compass(sphere())
    columns["Health"] = (np.arange(N) % 4 > 0).astype(int)
    (sensor,) = written((name, columns)).sensors
    assert len(sensor) == N
    assert any(f"{N // 4} of {N} readings are marked unhealthy" in note for note in sensor.notes)


# --- what was recorded beside ------------------------------------------------------------------


def test_columns_meet_the_magnetometer_in_time(written: Any) -> None:
    fine = np.arange(0.0, 60.0, 0.02)
    heading = (170.0 + 20.0 * fine) % 360.0
    us = {"TimeUS": fine * 1e6}
    log = written(
        compass(sphere()),
        ("ATT", {**us, "Roll": -3.0 + fine / 10, "Pitch": fine / 20, "Yaw": heading}),
        ("IMU", {**us, "I": 0, "GyrX": 0.25, "AccZ": -9.81, "AccX": fine}),
        ("IMU", {**us, "I": 1, "GyrX": 9.0, "AccZ": 9.0, "AccX": 9.0}),
        ("BAT", {**us, "Instance": 0, "Curr": 2.0 * fine}),
        ("CTUN", {**us, "ThO": fine / 60}),
    )
    s = log.sensors[0]
    turned = (s.heading_deg - 170.0 - 20.0 * s.time + 180.0) % 360.0 - 180.0
    assert np.abs(turned).max() < 0.011  # hundredths of a degree in the log
    np.testing.assert_allclose(s.roll_deg, -3.0 + s.time / 10, atol=0.011)
    np.testing.assert_allclose(s.pitch_deg, s.time / 20, atol=0.011)
    np.testing.assert_allclose(
        s.acceleration, np.stack([s.time, 0 * s.time, -9.81 + 0 * s.time], axis=1), atol=1e-5
    )
    np.testing.assert_allclose(s.rotation_rate[:, 0], 0.25)
    np.testing.assert_allclose(s.current_A, 2.0 * s.time, rtol=1e-6)
    np.testing.assert_allclose(s.throttle, s.time / 60, rtol=1e-6)
    assert s.temperature is None
    assert {stream.name: stream.rows for stream in log.streams} == {
        "ATT": 3000,
        "IMU": 6000,
        "BAT": 3000,
        "CTUN": 3000,
    }
    assert {round(x.rate_Hz) for x in log.streams if x.name == "ATT" and x.rate_Hz} == {50}


def motors(firmware: str, functions: dict[str, float]) -> list[tuple[str, Columns]]:
    """Messages of a vehicle with outputs, speed controllers and two batteries."""
    fine = np.arange(0.0, 60.0, 0.02)
    us = {"TimeUS": fine * 1e6}
    return [
        ("MSG", {"TimeUS": 1e3, "Message": firmware}),
        parameters(functions),
        ("RCOU", {**us, "C1": 1000 + 10 * fine, "C2": 1500, "C3": 1900 - 5 * fine}),
        ("ESC", {**us, "Instance": 0, "Curr": fine}),
        ("ESC", {**us, "Instance": 1, "Curr": 2 * fine}),
        ("BAT", {**us, "Instance": 0, "Curr": 3 * fine}),
        ("BAT", {**us, "Instance": 1, "Curr": 4 * fine}),
    ]


OUTPUTS = {"RCOU": (9, "QHHH", "TimeUS,C1,C2,C3"), "ESC": (10, "QBf", "TimeUS,Instance,Curr")}


def test_motors_controllers_and_batteries_are_disturbers(written: Any) -> None:
    functions = {"SERVO1_FUNCTION": 33, "SERVO2_FUNCTION": 34, "SERVO3_FUNCTION": 19}
    pulses = {"MOT_PWM_MIN": 1000, "MOT_PWM_MAX": 2000}
    log = written(
        compass(sphere()), *motors("ArduCopter V4.5.0", functions | pulses), formats=OUTPUTS
    )
    s = log.sensors[0]
    assert set(s.disturbers) == {"motor1_duty", "esc1_A", "esc2_A", "battery2_A"}  # 19: a servo
    np.testing.assert_allclose(s.disturbers["motor1_duty"], s.time / 100, atol=1e-3)
    np.testing.assert_allclose(s.disturbers["esc2_A"], 2 * s.time, atol=1e-5)
    np.testing.assert_allclose(s.disturbers["battery2_A"], 4 * s.time, atol=1e-5)


def test_outputs_without_functions_and_motors_that_turn_both_ways(written: Any) -> None:
    log = written(compass(sphere()), *motors("ArduSub V4.1.0", {"X": 1}), formats=OUTPUTS)
    s = log.sensors[0]
    np.testing.assert_allclose(s.disturbers["output3_duty"], 0.8 - s.time / 100, atol=2e-3)
    assert "output2_duty" not in s.disturbers  # it never moves


@pytest.mark.parametrize(
    ("fmt", "columns", "throttle"),
    [
        ((4, "Qff", "TimeUS,ThI,ThO"), {"ThO": 0.4}, 0.4),  # Copter
        ((4, "Qhh", "TimeUS,ThrIn,ThrOut"), {"ThrOut": 400}, 0.4),  # Copter before 3.4
        ((4, "Qcf", "TimeUS,NavRoll,ThO"), {"ThO": 40.0}, 0.4),  # Plane
        ((4, "Qhch", "TimeUS,Steer,Roll,ThrOut"), {"ThrOut": 40}, 0.4),  # Rover
    ],
)
def test_throttle_is_a_fraction_for_every_vehicle(
    written: Any, fmt: Any, columns: Columns, throttle: float
) -> None:
    log = written(compass(sphere()), ("CTUN", {"TimeUS": 1e6, **columns}), formats={"CTUN": fmt})
    np.testing.assert_allclose(log.sensors[0].throttle, throttle, rtol=1e-6)


@pytest.mark.parametrize(("letter", "logged"), [("h", 1250), ("f", 12.5)])
def test_current_is_in_amperes_in_every_version(written: Any, letter: str, logged: float) -> None:
    formats = {"CURR": (5, f"Q{letter}", "TimeUS,Curr")}
    log = written(compass(sphere()), ("CURR", {"TimeUS": 1e6, "Curr": logged}), formats=formats)
    np.testing.assert_allclose(log.sensors[0].current_A, 12.5)


@pytest.mark.parametrize(
    ("utc", "leap"),
    [
        (datetime(2012, 6, 30, 12, tzinfo=UTC), 15),
        (datetime(2014, 3, 1, tzinfo=UTC), 16),
        (datetime(2016, 12, 31, 12, tzinfo=UTC), 17),
        (datetime(2024, 5, 5, 5, tzinfo=UTC), 18),
    ],
)
def test_epoch_is_the_utc_of_boot(written: Any, utc: datetime, leap: int) -> None:
    gps = (utc + timedelta(seconds=leap) - GPS_EPOCH).total_seconds() + SECONDS
    fix = {"TimeUS": SECONDS * 1e6, "Status": 3, "Lat": 47.5, "Lng": 8.5, "Alt": 430.0}
    week = np.where(np.arange(N) < 5, 0, gps // 604800)  # the receiver does not know it at first
    log = written(
        compass(sphere()), ("GPS", {**fix, "GWk": week, "GMS": np.round(gps % 604800 * 1e3)})
    )
    (s,) = log.sensors
    assert s.epoch is not None
    assert abs((s.epoch - utc).total_seconds()) < 1e-3
    np.testing.assert_allclose(s.latitude_deg, 47.5)
    np.testing.assert_allclose(s.longitude_deg, 8.5)
    np.testing.assert_allclose(s.altitude_m, 430.0)


def test_places_without_a_fix_do_not_count(written: Any) -> None:
    have = SECONDS > 20.0
    gps: Columns = {
        "TimeUS": SECONDS * 1e6,
        "Status": np.where(have, 3, 1),
        "Lat": np.where(have, -33.0, 0.0),
        "Lng": np.where(have, 179.9, 0.0),
        "Alt": 5.0,
    }
    (s,) = written(compass(sphere()), ("GPS", gps)).sensors
    np.testing.assert_allclose(s.latitude_deg, -33.0)
    np.testing.assert_allclose(s.longitude_deg, 179.9)
    assert s.epoch is None


def test_messages_without_time_meet_by_place_in_the_file(written: Any) -> None:
    formats = {"MAG": (103, "hhh", "MagX,MagY,MagZ"), "ATT": (68, "ccC", "Roll,Pitch,Yaw")}
    pairs: list[tuple[str, Columns]] = []
    for k in range(40):
        pairs += [("ATT", {"Roll": 1.0 * k}), ("MAG", {"MagX": 10 * k, "MagY": 1, "MagZ": 2})]
    log = written(*pairs, formats=formats)
    (s,) = log.sensors
    assert s.time is None
    assert s.roll_deg is not None
    # each reading stands between its own attitude and the next, ten times its roll
    lag = s.field[:-1, 0] / (10 * MG) - s.roll_deg[:-1]
    assert ((lag < 0) & (lag > -1)).all()


# --- the format itself -------------------------------------------------------------------------


def test_all_letters_as_pymavlink_reads_them(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    letters = "".join(letter for letter in DTYPES if letter != "a")
    names = [f"C{k}" for k in range(len(letters))]
    halves = (letters[:10], letters[10:])  # an FMT holds sixteen letters
    formats = {
        name: (200 + k, half, ",".join(names[: len(half)]))
        for k, (name, half) in enumerate(zip(("AAA", "BBB"), halves, strict=True))
    }
    tables = []
    for name, (_, half, columns) in formats.items():
        values: Columns = {}
        for letter, column in zip(half, columns.split(","), strict=True):
            text = letter in "nNZ"
            values[column] = np.array([b"abc", b"de"]) if text else rng.integers(0, 99, 2)
        tables.append((name, values))
    path = tmp_path / "letters.bin"
    path.write_bytes(dataflash(*tables, formats=formats))
    compare_with_pymavlink(path, tuple(formats))


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("ardusub/small.BIN", ("MAG", "ATT", "IMU", "BAT", "CTUN", "PARM", "MSG")),
        ("ardupilot/center_0003.bin", ("MAG", "ATT", "GPS", "POS", "PARM", "VER", "XKF1")),
    ],
)
def test_recordings_as_pymavlink_reads_them(
    recordings: Path, name: str, types: tuple[str, ...]
) -> None:
    compare_with_pymavlink(recordings / "vehicle" / name, types)


def compare_with_pymavlink(path: Path, types: tuple[str, ...]) -> None:
    tables = read_binary(path, types).tables
    seen: dict[str, list[dict[str, Any]]] = {name: [] for name in types}
    for message in pymavlink_messages(path):
        if message.get_type() in seen:
            seen[message.get_type()].append(message.to_dict())
    for name, rows in seen.items():
        assert len(tables[name]) == len(rows) > 0
        for column, values in tables[name].columns.items():
            theirs = [row[column] for row in rows]
            if values.dtype.kind == "S":
                assert [v.decode() for v in values.tolist()] == theirs
            else:
                np.testing.assert_allclose(values, theirs, rtol=1e-12, err_msg=f"{name}.{column}")


def pymavlink_messages(path: Path) -> Iterator[Any]:
    from pymavlink.DFReader import DFReader_binary

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = DFReader_binary(str(path), zero_time_base=True)
        while (message := reader.recv_msg()) is not None:
            yield message
        reader.close()


def test_text_logs_give_the_same(tmp_path: Path) -> None:
    tables = (
        parameters(named(OFFSET, SOFT_IRON, 1.25)),
        compass(sphere(), matrix=1.25 * SOFT_IRON),
        ("ATT", {"TimeUS": SECONDS * 1e6, "Roll": 2.5, "Pitch": -1.25, "Yaw": SECONDS}),
    )
    binary, text = tmp_path / "flight.bin", tmp_path / "flight.log"
    binary.write_bytes(dataflash(*tables))
    lines = []
    for message in pymavlink_messages(binary):
        values = message.to_dict()
        name = values.pop("mavpackettype")
        lines.append(", ".join([name, *map(str, values.values())]))
    text.write_text("\n".join([*lines, "MAG, 12", "ATT, x, y", ""]))
    assert is_dataflash(text.read_bytes()[:4096])
    for a, b in zip(load(binary).sensors, load(text).sensors, strict=True):
        assert a.columns().keys() == b.columns().keys()
        for column, values in a.columns().items():
            np.testing.assert_allclose(b.columns()[column], values, rtol=1e-6, atol=1e-6)


# --- damage ------------------------------------------------------------------------------------


def sound() -> bytes:
    return dataflash(
        parameters(named(OFFSET, SOFT_IRON)),
        compass(sphere()),
        ("ATT", {"TimeUS": SECONDS * 1e6 + 5, "Yaw": 77.0}),
    )


def times(log: Log) -> np.ndarray:
    (sensor,) = log.sensors
    assert sensor.time is not None
    return sensor.time


def test_lost_bytes_cost_the_messages_they_were_in_and_no_more(tmp_path: Path) -> None:
    data, path = sound(), tmp_path / "lost.bin"
    middle = len(data) // 2
    path.write_bytes(data[:middle] + data[middle + 40 :])
    log = load(path)
    lost = np.setdiff1d(SECONDS.round(6), times(log).round(6))
    assert 1 <= len(lost) <= 2
    assert any("skipped" in note for note in log.notes)


def test_noise_between_messages_costs_nothing(tmp_path: Path) -> None:
    data, path = sound(), tmp_path / "noise.bin"
    mark = data.index(b"\xa3\x95\x67", len(data) // 2)
    noise = np.random.default_rng(4).integers(0, 256, 20_000).astype(np.uint8).tobytes()
    path.write_bytes(noise + data[:mark] + noise + data[mark:] + bytes(500))
    log = load(path)
    np.testing.assert_allclose(times(log), SECONDS)
    assert any("40500 bytes" in note for note in log.notes)


def test_header_marks_inside_a_message_do_not_break_it(tmp_path: Path) -> None:
    """The z axis and its offset read like the header of an ATT message that fits the file."""
    name, columns = compass(sphere())
    marks = np.frombuffer(b"\xa3\x95\x44\x00", dtype="<i2")
    columns |= {"MagZ": np.full(N, marks[0]), "OfsX": np.full(N, marks[1])}
    path = tmp_path / "marks.bin"
    path.write_bytes(dataflash((name, columns), ("ATT", {"TimeUS": SECONDS * 1e6 + 5})))
    log = load(path)
    np.testing.assert_allclose(times(log), SECONDS)
    assert log.notes == ()


def test_one_damaged_time_costs_one_row(tmp_path: Path) -> None:
    data, path = bytearray(sound()), tmp_path / "time.bin"
    mark = data.index(b"\xa3\x95\x67", len(data) // 2)
    data[mark + 9] = 0x55  # microseconds of some centuries
    path.write_bytes(data)
    log = load(path)
    assert len(times(log)) == N - 1
    assert dict(log.sensors[0].rejected) == {"time out of sequence": 1}


def test_a_format_that_contradicts_its_length_is_named(tmp_path: Path) -> None:
    data = bytearray(sound())
    mark = data.index(b"\xa3\x95\x80\x44")  # the FMT message of ATT
    data[mark + 4] += 2
    path = tmp_path / "lie.bin"
    path.write_bytes(data)
    log = load(path)
    assert log.sensors[0].heading_deg is None
    assert len(log.sensors[0]) > 0.4 * N  # those not followed by an ATT cannot be trusted
    assert any("ATT contradicts itself" in note for note in log.notes)


@pytest.mark.slow
def test_every_cut_gives_a_log_or_one_clear_sentence(tmp_path: Path) -> None:
    data, path = sound()[:5000], tmp_path / "cut.bin"
    first = data.index(b"\xa3\x95\x67", 89 * 4) + len(data[:0])
    for end in range(0, len(data), 13):
        path.write_bytes(data[:end])
        if (log := read_or_refused(load, path)) is not None:
            assert end > first
            assert len(times(log)) <= N


def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(tmp_path: Path) -> None:
    data = np.frombuffer(sound(), dtype=np.uint8)
    path = tmp_path / "fuzz.bin"
    rng = np.random.default_rng(5)
    read_well = 0
    for _ in range(150):
        path.write_bytes(damaged(data, rng).tobytes())
        log = read_or_refused(load, path)
        if log is not None:
            read_well += 1
            assert all(np.isfinite(sensor.field).all() for sensor in log.sensors)
    assert read_well > 75


def test_a_log_without_compass_is_refused_with_the_next_move(tmp_path: Path) -> None:
    path = tmp_path / "none.bin"
    path.write_bytes(dataflash(("ATT", {"TimeUS": SECONDS * 1e6, "Yaw": 1.0})))
    with pytest.raises(LogError, match=r"no MAG messages.*LOG_BITMASK"):
        load(path)


def test_only_dataflash_logs_are_accepted() -> None:
    assert is_dataflash(sound()[:200])
    assert is_dataflash(b"junk" * 9 + sound()[:200])
    assert not is_dataflash(b"time_s,mag_x_nT\n0,1\n")
    assert not is_dataflash(b"ULog\x01\x12\x35\x01")
    assert not is_dataflash(b"")
    assert FORMATS["FMT"][0] == 128


# --- recordings --------------------------------------------------------------------------------


@pytest.mark.recordings
def test_corrected_readings_are_those_in_the_log(recordings: Path) -> None:
    """What comes out, corrected as `logged` says and with the motor part, is what the log holds."""
    path = recordings / "vehicle/ardupilot/log171.bin"
    tables = read_binary(path, ("MAG", "MAG2", "MAG3")).tables
    log = load(path)
    assert [s.name for s in log.sensors] == ["MAG", "MAG2", "MAG3"]
    for sensor in log.sensors:
        columns = tables[sensor.name].columns
        written = np.stack([columns[f"Mag{a}"] for a in "XYZ"], axis=1)
        motor = np.stack([columns[f"MOfs{a}"] for a in "XYZ"], axis=1)
        assert sensor.logged is not None
        again = correct(sensor.field, sensor.logged.bias, sensor.logged.matrix) / MG + motor
        assert np.abs(again - written).max() < 1.0


@pytest.mark.recordings
def test_scale_and_soft_iron_of_a_recording(recordings: Path) -> None:
    (sensor,) = load(recordings / "vehicle/ardupilot/center_0003.bin").sensors
    assert sensor.logged is not None
    scale = 1.128987193
    diagonal, off = (1.197061062, 1.108842254, 0.873660147), (0.0574493, 0.1935067, -0.1758379)
    np.testing.assert_allclose(np.diag(sensor.logged.matrix) / scale, diagonal, rtol=1e-7)
    rows, columns = np.triu_indices(3, 1)
    np.testing.assert_allclose(sensor.logged.matrix[rows, columns] / scale, off, rtol=1e-6)
    np.testing.assert_allclose(sensor.logged.bias, [47929.89, -35619.34, -39439.83], atol=0.01)
    assert np.linalg.eigvalsh(sensor.logged.matrix).min() > 0


@pytest.mark.recordings
def test_a_flight_agrees_with_its_own_attitude(recordings: Path) -> None:
    """The level heading of the corrected compass plus declination is the autopilot's yaw."""
    log = load(recordings / "vehicle/ardupilot/log171.bin")
    s = log.sensors[0].select((log.sensors[0].time > 84) & (log.sensors[0].time < 236))
    error = heading_error_deg(s, declination_deg=12.39)
    assert abs(np.median(error)) < 4.0
    assert np.std(error) < 5.0
    gravity = np.median(s.acceleration, axis=0)
    assert abs(gravity[2] + 9.81) < 0.3  # specific force: up, when z is down
    assert 10.0 < np.median(s.current_A) < 30.0
    assert 0.2 < np.median(s.throttle) < 0.8
    assert s.epoch is not None
    assert s.epoch.date().isoformat() == "2015-11-21"
    assert any(note.startswith("firmware Copter V3.3") for note in log.notes)
