"""Layouts that sketches, registers and apps write, each with a few rows of known readings."""

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError
from agonic.logs.read import open_log
from agonic.logs.text.sentences import compute_checksum

READINGS = [(20.0, -3.0, 43.0), (19.0, 4.0, 42.0), (17.0, 11.0, 41.0), (-2.0, 21.0, 40.0)]


def read(folder: Path, text: str, name: str = "log.txt") -> ag.Samples:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return ag.read(path)


def test_counts_beside_the_same_reading_in_a_unit_are_no_readings_of_their_own(
    tmp_path: Path,
) -> None:
    """Sketches print the registers in one line and the field in the next."""
    text = "".join(
        f"X:  {68 * x:.0f}  \tY:  {68 * y:.0f}  \tZ:  {68 * z:.0f}\n"
        f"\tX: {x:.2f} \tY: {y:.2f} \tZ: {z:.2f} uTesla\n"
        for x, y, z in READINGS
    )
    samples = read(tmp_path, text)
    assert samples.unit == "nT"
    assert samples.field == pytest.approx(1e3 * np.array(READINGS))


def test_a_unit_in_the_title_of_a_line_is_that_of_its_numbers(tmp_path: Path) -> None:
    text = "".join(
        f"Data in counts:  X:{75 * x:.0f}  Y:{75 * y:.0f}  Z:{75 * z:.0f}\n"
        f"Data in microTesla(uT):  X:{x:.3f}  Y:{y:.3f}  Z:{z:.3f}\n"
        for x, y, z in READINGS
    )
    assert read(tmp_path, text).field == pytest.approx(1e3 * np.array(READINGS))


def test_angles_below_the_field_are_not_taken_for_it(tmp_path: Path) -> None:
    """The axes below a title belong to it, also where it names no sensor that is known."""
    text = "".join(
        f"Orient:\tx= 1{k} |\ty= -2{k} |\tz= 3{k}\nMag:\tx= {x} |\ty= {y} |\tz= {z}\n"
        for k, (x, y, z) in enumerate(READINGS)
    )
    assert read(tmp_path, text).field == pytest.approx(np.array(READINGS))


def write_code(value: float) -> str:
    return f"{int(value) & 0xFFFF:04X}"


@pytest.mark.parametrize("mark", ["0x", ""])
def test_hexadecimal_registers_are_signed_where_that_is_steadier(tmp_path: Path, mark: str) -> None:
    rows = (",".join(mark + write_code(10 * v) for v in row) for row in READINGS)
    text = "time_ms,mx,my,mz\n" + "".join(f"{1000 + 20 * k},{r}\n" for k, r in enumerate(rows))
    path = tmp_path / "registers.csv"
    path.write_text(text)
    (samples,) = open_log(path).sensors
    assert samples.field == pytest.approx(10 * np.array(READINGS))
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)


def test_hexadecimal_registers_around_the_middle_of_their_range_are_unsigned(
    tmp_path: Path,
) -> None:
    text = "mx,my,mz\n" + "".join(
        ",".join(f"0x{0x8000 + int(10 * v):04X}" for v in row) + "\n" for row in READINGS
    )
    assert read(tmp_path, text).field == pytest.approx(0x8000 + 10 * np.array(READINGS))


def write_rows(header: str, before: list[str] | None = None, behind: str = "") -> str:
    lines = [
        ",".join([*(before[k : k + 1] if before else []), *map(str, row)]) + behind
        for k, row in enumerate(READINGS)
    ]
    return "\n".join([header, *lines]) + "\n"


def test_the_factors_of_gyroflow_are_applied(tmp_path: Path) -> None:
    above = "GYROFLOW IMU LOG\nversion,1.3\norientation,YxZ\ntimestamp,1718010000\ntscale,0.001\n"
    above += "gscale,0.002\nascale,0.0005\nmscale,0.01\n"
    rows = "".join(
        f"{20 * k},100,0,0,0,0,2000,{x:.0f},{y:.0f},{z:.0f}\n"
        for k, (x, y, z) in enumerate(4 * READINGS)
    )
    samples = read(tmp_path, above + "t,gx,gy,gz,ax,ay,az,mx,my,mz\n" + rows, "log.gcsv")
    assert samples.unit == "nT"
    assert samples.field == pytest.approx(1e3 * np.array(4 * READINGS))
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)
    assert samples.epoch is not None
    assert samples.epoch.timestamp() == 1718010000
    assert samples.rotation_rate is not None
    assert samples.rotation_rate[0, 0] == pytest.approx(0.2)
    assert samples.acceleration is not None
    assert samples.acceleration[0, 2] == pytest.approx(9.80665)


def test_a_wrong_checksum_of_numbers_alone_is_named(tmp_path: Path) -> None:
    def write(body: str, wrong: bool = False) -> str:
        return f"${body}*{compute_checksum(body) ^ wrong:02X}\n"

    bodies = [",".join(map(str, row)) for row in READINGS]
    path = tmp_path / "log.txt"
    path.write_text("".join(write(body, k == 2) for k, body in enumerate(bodies)))
    log = open_log(path)
    assert len(log.sensors[0]) == 3
    stated = compute_checksum(bodies[2])
    assert f"the first in line 3: *{stated ^ 1:02X} is not *{stated:02X}" in log.notes[0]
    path.write_text("".join(write(body, True) for body in bodies))
    with pytest.raises(LogError, match=r"the first in line 1: \*"):
        open_log(path)


def test_packets_of_several_readings_are_taken_apart(tmp_path: Path) -> None:
    packets = [
        {
            "imu9": {
                "Timestamp": 1e12 + 100 * k,
                "ArrayMagn": [dict(zip("xyz", r, strict=True)) for r in pair],
            }
        }
        for k, pair in enumerate([READINGS[:2], READINGS[2:]])
    ]
    samples = read(tmp_path, json.dumps({"Meas": packets}), "log.json")
    assert samples.field == pytest.approx(np.array(READINGS))


def test_two_headings_cost_the_heading_and_not_the_log(tmp_path: Path) -> None:
    samples = read(tmp_path, write_rows("mx_uT,my_uT,mz_uT,yaw (rad),heading (deg)", behind=",1,2"))
    assert samples.heading_deg is None
    assert any("yaw (rad) and heading (deg) left out" in note for note in samples.notes)


@pytest.mark.parametrize(
    ("header", "before"),
    [
        ("T (nT),X (nT),Y (nT),Z (nT)", ["48000", "48001", "48002", "48003"]),
        ("note,X axis field (nT),Y axis field (nT),Z axis field (nT)", ["a", "b", "c", "d"]),
    ],
)
def test_a_unit_of_a_field_says_what_a_column_is(
    tmp_path: Path, header: str, before: list[str]
) -> None:
    samples = read(tmp_path, write_rows(header, before))
    assert samples.unit == "nT"
    assert samples.time is None
    assert samples.field == pytest.approx(np.array(READINGS))


def test_a_first_row_of_remarks_is_no_row_of_units(tmp_path: Path) -> None:
    header = "t_unix_ns,t_rel_s,bx,by,bz,units,note\n"
    rows = "".join(f"{1e18 + 2e7 * k:.0f},{k},{x},{y},{z},gauss,\n" for k, (x, y, z) in
                   enumerate(READINGS))  # fmt: skip
    samples = read(tmp_path, f"{header}{1e18:.0f},0.0,,,,gauss,start\n{rows}")
    assert samples.field == pytest.approx(1e5 * np.array(READINGS))


def test_large_whole_steps_are_nanoseconds(tmp_path: Path) -> None:
    stamps = [str(83123340000000 + 20000000 * k) for k in range(4)]
    samples = read(tmp_path, write_rows("timestamp,mx,my,mz", stamps))
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)
    assert any("taken as nanoseconds" in note for note in samples.notes)


def test_a_date_column_stands_in_for_a_clock_of_unknown_unit(tmp_path: Path) -> None:
    stamps = [f"2024-06-10 09:00:00.{2 * k:02},{5000 + 20 * k}" for k in range(4)]
    samples = read(tmp_path, write_rows("Date,HostTimestamp,mx,my,mz", stamps))
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)


def test_a_zone_in_the_name_of_a_date_is_none_of_its_matter(tmp_path: Path) -> None:
    stamps = [f"10.06.2024,09:00:00.{2 * k:02}" for k in range(4)]
    samples = read(tmp_path, write_rows("Date (UTC),Time (UTC),mx,my,mz", stamps))
    assert samples.epoch is not None
    assert samples.epoch.timestamp() == 1718010000


def test_raw_in_capitals_goes_before_cal(tmp_path: Path) -> None:
    header = "MAG_X_RAW,MAG_Y_RAW,MAG_Z_RAW,MAG_X_CAL,MAG_Y_CAL,MAG_Z_CAL"
    samples = read(tmp_path, write_rows(header, behind=",1,2,3"))
    assert samples.field == pytest.approx(np.array(READINGS))
    assert not samples.corrected


def test_a_code_of_the_maker_is_no_unit(tmp_path: Path) -> None:
    header = ",".join(f"{a} {what}" for what in ("Mag [x8006]", "Accel [x8004]") for a in "XYZ")
    samples = read(tmp_path, write_rows(header, behind=",0,0,-1"))
    assert samples.acceleration is not None
    assert samples.acceleration[0] == pytest.approx([0, 0, -9.80665])


def test_the_unit_behind_a_number_is_not_that_of_every_number_before_it(tmp_path: Path) -> None:
    text = "[0.1] debug: Resetting ICM-20948\n" + "".join(
        f"[{0.5 + 0.1 * k:.1f}] info: accel: x 0.04 y -0.26 z -9.85 (m/s²) temp: 26.65°C "
        f"mag: x {x} y {y} z {z} (µT)\n"
        for k, (x, y, z) in enumerate(READINGS)
    )
    samples = read(tmp_path, text)
    assert samples.field == pytest.approx(1e3 * np.array(READINGS))
    assert samples.acceleration is not None
    assert samples.temperature is not None
    assert samples.time == pytest.approx([0.5, 0.6, 0.7, 0.8])


def test_titles_on_lines_of_their_own_name_the_axes_below_them(tmp_path: Path) -> None:
    text = "".join(
        f"Accelerometer:\n X1 = 0.01\n Y1 = 0.02\n Z1 = 0.99\n\nMagnetometer:\n"
        f" X = {x}\n Y = {y}\n Z = {z}\n"
        for x, y, z in READINGS
    )
    samples = read(tmp_path, text)
    assert samples.field == pytest.approx(np.array(READINGS))
    assert samples.acceleration is not None


def test_rows_in_groups_between_dashes_are_not_taken_for_one_sensor(tmp_path: Path) -> None:
    groups = (f"0.1 0.2 9.8\n{x} {y} {z}\n------\n" for x, y, z in READINGS)
    with pytest.raises(LogError, match="groups of 2"):
        read(tmp_path, "".join(groups))


def test_a_unit_above_the_table_and_milliseconds_behind_a_colon(tmp_path: Path) -> None:
    """As an app writes them: a count named "#", and 17:16:1:35 for 35 ms."""
    stamps = ["17:16:0:980", "17:16:1:0", "17:16:1:20", "17:16:1:40"]
    rows = "".join(
        f"{k + 1} 99.5 {x} {y} {z} {stamp}\n"
        for k, ((x, y, z), stamp) in enumerate(zip(READINGS, stamps, strict=True))
    )
    samples = read(tmp_path, f"Unit is microtesla\n# Value X Y Z Time\n{rows}")
    assert samples.field == pytest.approx(1e3 * np.array(READINGS))
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)


def test_a_time_that_holds_its_date_needs_no_date_beside_it(tmp_path: Path) -> None:
    stamps = [f"2024-06-10,2024-06-10 09:00:{k:02}" for k in range(4)]
    samples = read(tmp_path, write_rows("date,time,mx,my,mz", stamps))
    assert samples.epoch is not None
    assert samples.epoch.timestamp() == 1718010000


def test_decimal_commas_without_a_header_are_a_point_cloud(tmp_path: Path) -> None:
    text = "".join(";".join(map(str, row)).replace(".", ",") + "\n" for row in READINGS)
    assert read(tmp_path, text).field == pytest.approx(np.array(READINGS))


def test_one_kind_of_tagged_rows_takes_the_header_of_its_comment(tmp_path: Path) -> None:
    rows = "".join(
        f"Mag,{1718010000000 + 20 * k},{5_000_000_000 + 20_000_000 * k},{x},{y},{z}\n"
        for k, (x, y, z) in enumerate(READINGS)
    )
    above = "# Mag,utcTimeMillis,elapsedRealtimeNanos,MagXMicroT,MagYMicroT,MagZMicroT\n"
    assert read(tmp_path, above + rows).field == pytest.approx(1e3 * np.array(READINGS))


def test_the_sensors_of_one_sentence_are_told_by_its_first_cell(tmp_path: Path) -> None:
    bodies = (
        f"PCHRS,{kind},{101.6 + 0.02 * k:.2f},{x},{y},{z},"
        for k, (x, y, z) in enumerate(READINGS)
        for kind in (0, 1, 2)
    )
    samples = read(tmp_path, "".join(f"${b}*{compute_checksum(b):02X}\n" for b in bodies))
    assert len(samples) == len(READINGS)
    assert samples.time is not None
    assert np.diff(samples.time) == pytest.approx(0.02)
