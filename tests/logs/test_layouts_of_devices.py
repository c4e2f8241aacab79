"""Layouts that sketches, registers and apps write, each with a few rows of known readings."""

from pathlib import Path

import numpy as np
import pytest

import agonic as ag

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
    (samples,) = ag.logs.read.open_log(path).sensors
    assert samples.field == pytest.approx(10 * np.array(READINGS))
    assert samples.time is not None and np.diff(samples.time) == pytest.approx(0.02)


def test_hexadecimal_registers_around_the_middle_of_their_range_are_unsigned(
    tmp_path: Path,
) -> None:
    text = "mx,my,mz\n" + "".join(
        ",".join(f"0x{0x8000 + int(10 * v):04X}" for v in row) + "\n" for row in READINGS
    )
    assert read(tmp_path, text).field == pytest.approx(0x8000 + 10 * np.array(READINGS))
