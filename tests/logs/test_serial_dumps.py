"""What sketches print and terminals save: labels, units behind, stamps before, several lines."""

import numpy as np
import pytest

import agonic as ag

N = 200
TIME = np.arange(N) * 0.02
RNG = np.random.default_rng(5)
MAG = RNG.normal(0.0, 30.0, (N, 3)).round(2)
UP = RNG.normal(0.0, 1.0, (N, 3))
ACC_MG = (1000.0 * UP / np.linalg.norm(UP, axis=1)[:, None]).round(1)
GYRO = RNG.normal(0.0, 30.0, (N, 3)).round(2)


def read(tmp_path, lines, **given):
    path = tmp_path / "serial.txt"
    path.write_text("\n".join(lines) + "\n")
    return ag.read(path, **given)


def stamp(seconds: float) -> str:
    return f"08:15:{30 + int(seconds):02d}.{round(seconds % 1 * 1000):03d}"


@pytest.mark.parametrize("unit", ["uTesla", "uT", "µT"])
def test_a_unit_at_the_end_of_a_line(tmp_path, unit) -> None:
    lines = [f"X: {x}  Y: {y}  Z: {z}  {unit}" for x, y, z in MAG]
    np.testing.assert_allclose(read(tmp_path, ["LIS3MDL test!", *lines]).field, MAG * 1e3)


def test_a_record_of_several_lines_each_with_its_unit(tmp_path) -> None:
    lines = []
    for mag, acc, gyro in zip(MAG, ACC_MG, GYRO, strict=True):
        lines.append(" ".join(f"a{a} = {v}" for a, v in zip("xyz", acc, strict=True)) + " mg")
        lines.append(" ".join(f"g{a} = {v}" for a, v in zip("xyz", gyro, strict=True)) + " deg/s")
        lines.append(" ".join(f"m{a} = {v}" for a, v in zip("xyz", mag, strict=True)) + " mG")
    samples = read(tmp_path, lines)
    np.testing.assert_allclose(samples.field, MAG * 100.0)
    np.testing.assert_allclose(samples.acceleration, ACC_MG * 9.80665e-3)
    np.testing.assert_allclose(samples.rotation_rate, np.radians(GYRO))


def test_a_line_without_readings_between(tmp_path) -> None:
    lines = []
    for x, y, z in MAG:
        lines += [f"X: {x}  Y: {y}  Z: {z}  uT", f"Heading (degrees): {abs(x)}"]
    np.testing.assert_allclose(read(tmp_path, lines).field, MAG * 1e3)


def test_stamps_of_a_serial_monitor(tmp_path) -> None:
    lines = [f"{stamp(t)} -> mx={x},my={y},mz={z}" for t, (x, y, z) in zip(TIME, MAG, strict=True)]
    samples = read(tmp_path, lines, unit="uT")
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=1e-6)


@pytest.mark.parametrize(
    "write",
    [
        lambda t: f"2026-05-03 {stamp(t).replace('.', ',')} - INFO - ",
        lambda t: f"[INFO] [{1.7e9 + t:.3f}] [imu]: ",
        lambda t: f"[{100 + t:12.6f}] mag: ",
        lambda t: f"I ({1000 * t + 350:.0f}) QMC5883L: ",
    ],
    ids=["Python", "ROS", "kernel", "ESP-IDF"],
)
def test_stamps_of_loggers(tmp_path, write) -> None:
    lines = [
        f"{write(t)}X: {x} uT Y: {y} uT Z: {z} uT" for t, (x, y, z) in zip(TIME, MAG, strict=True)
    ]
    samples = read(tmp_path, ["boot", *lines])
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=1e-6)


def test_stamps_before_sentences(tmp_path) -> None:
    lines = [
        f"2026-05-03T{stamp(t)}Z $VNIMU,{x},{y},{z},0,0,9.8,0,0,0,25.0,101.3"
        for t, (x, y, z) in zip(TIME, MAG / 100, strict=True)
    ]
    samples = read(tmp_path, lines)
    np.testing.assert_allclose(samples.field, MAG * 1e3, atol=1e-6)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=1e-6)
    assert samples.epoch.isoformat() == "2026-05-03T08:15:30+00:00"


def test_a_rate_stands_for_an_empty_clock(tmp_path) -> None:
    lines = ["// Update Rate: 50.0Hz", "PacketCounter\tSampleTimeFine\tMag_X\tMag_Y\tMag_Z"]
    lines += [f"{k}\t\t{x}\t{y}\t{z}" for k, (x, y, z) in enumerate(MAG)]
    np.testing.assert_allclose(read(tmp_path, lines).time, TIME, atol=1e-9)


def test_what_shimmer_and_its_units_write(tmp_path) -> None:
    names = [f"Shimmer_5E4A_{n}_{a}_CAL" for n in ("Accel_LN", "Gyro", "Mag") for a in "XYZ"]
    lines = ["sep=\t", "\t".join(["Shimmer_5E4A_Timestamp_Unix_CAL", *names])]
    lines.append("\t".join(["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3, *["local_flux"] * 3]))
    for t, *rows in zip(TIME, ACC_MG * 9.80665e-3, GYRO, MAG, strict=True):
        cells = [f"{1_777_796_130_250 + t * 1000:.1f}", *(str(v) for row in rows for v in row)]
        lines.append("\t".join(cells))
    samples = read(tmp_path, lines)
    assert samples.unit == "raw"
    np.testing.assert_allclose(samples.rotation_rate, np.radians(GYRO))
    np.testing.assert_allclose(samples.acceleration, ACC_MG * 9.80665e-3)
    assert samples.epoch.year == 2026


def test_a_line_of_digits_ends(tmp_path) -> None:
    """An expression that goes back over them would take hours."""
    lines = [f"mx={x} my={y} mz={z} uT" for x, y, z in MAG]
    lines[50] = "mx=" + "9" * 900_000 + "x"
    lines[60] = "mx: " + "9." * 450_000
    samples = read(tmp_path, lines)
    assert len(samples) >= N - 4


def test_colours_of_a_terminal(tmp_path):
    """ESP-IDF writes them around each line, with milliseconds since boot."""
    path = tmp_path / "monitor.txt"
    path.write_text(
        "".join(f"\x1b[0;32mI ({20 * k}) MAG: 3{k}.5, -6.8, 64.9\x1b[0m\n" for k in range(6))
    )
    samples = ag.read(path, unit="uT")
    assert samples.field[0] == pytest.approx([30500, -6800, 64900])
    assert samples.time.tolist() == [0, 0.02, 0.04, 0.06, 0.08, 0.1]
