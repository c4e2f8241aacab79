"""What the sketches of sensor libraries print: axes under one name, vectors, brackets, units."""

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError

N = 60
RNG = np.random.default_rng(8)
MAG = RNG.normal(0.0, 30.0, (N, 3)).round(2)
UP = RNG.normal(0.0, 1.0, (N, 3))
ACC = (9.81 * UP / np.linalg.norm(UP, axis=1)[:, None]).round(3)
GYRO = RNG.normal(0.0, 0.5, (N, 3)).round(4)


def read(tmp_path, line, *columns, **given):
    path = tmp_path / "serial.txt"
    rows = np.column_stack(columns)
    path.write_text("".join(line.format(*row.tolist()) + "\n" for row in rows))
    return ag.read(path, **given)


XYZ = "X: {} Y: {} Z: {}"
PRINTED = {  # the line, whose columns go into it, nT of its unit
    "one name for three axes": (f"Mag {XYZ}", "m", 0),
    "a unit behind": ("Mag X: {} \tY: {} \tZ: {} uT", "m", 1e3),
    "Adafruit, unified sensors": (
        "\t\tMagnetic X: {} \tY: {} \tZ: {} uTesla \n\t\tAccel X: {} \tY: {} \tZ: {} m/s^2 \n"
        "\t\tGyro X: {} \tY: {} \tZ: {} radians/s ", "mag", 1e3,
    ),
    "acceleration first": (f"Accel {XYZ} m/s^2\nMag {XYZ} uT", "am", 1e3),
    "two units under the same names": (f"{XYZ} uT\n{XYZ} m/s^2", "ma", 1e3),
    "a title in each line": (f"Acc: {XYZ}\nGyr: {XYZ}\nMag: {XYZ} uT", "agm", 1e3),
    "SparkFun ICM-20948": (
        "Scaled. Acc (m/s2) [ {:9.3f}, {:9.3f}, {:9.3f} ], Gyr (rad/s) [ {}, {}, {} ], "
        "Mag (uT) [ {:9.2f}, {:9.2f}, {:9.2f} ], Tmp (C) [ 24.00 ]", "agm", 1e3,
    ),
    "Pololu LSM303": ("A: {:6} {:6} {:6}    M: {:6} {:6} {:6}", "am", 0),
    "SparkFun 9DoF": (
        "A: {}, {}, {}\nG: {}, {}, {}\nM: {}, {}, {}\nPitch, Roll: 1.0, 2.0", "agm", 0,
    ),
    "CircuitPython": ("Magnetometer (microteslas): X={} Y={} Z={}", "m", 1e3),
    "CircuitPython, a tuple": ("Magnetometer (gauss): ({},{},{})", "m", 1e5),
    "a tuple": ("({}, {}, {})", "m", 0),
    "a list of NumPy": ("[{} {} {}]", "m", 0),
    "a dictionary": ("{{'x': {}, 'y': {}, 'z': {}}}", "m", 0),
    "an axis a line": ("mx: {}\nmy: {}\nmz: {}", "m", 0),
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTED)
def test_what_libraries_print(tmp_path, name):
    line, order, scale = PRINTED[name]
    samples = read(tmp_path, line, *({"m": MAG, "a": ACC, "g": GYRO}[one] for one in order))
    assert samples.unit == ("nT" if scale else "raw")
    np.testing.assert_allclose(samples.field, MAG * (scale or 1.0), rtol=1e-9)
    if "a" in order and "two units" not in name:
        np.testing.assert_allclose(samples.acceleration, ACC, rtol=2e-3)
    assert samples.roll_deg is None  # "Pitch, Roll: 1.0, 2.0" does not say which is which


def test_numbers_with_blanks_within_tabs_have_nine_columns(tmp_path):
    columns = "acc_x_m_s2=1,acc_y_m_s2=2,acc_z_m_s2=3,x=7,y=8,z=9"
    line = "{} {} {}\t{} {} {}\t{} {} {}"
    samples = read(tmp_path, line, ACC, GYRO, MAG, columns=columns, unit="uT")
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.acceleration, ACC)


def test_labelled_acceleration_is_no_field(tmp_path):
    with pytest.raises(LogError, match="no magnetometer columns found among 'X \\(m/s\\^2\\)'"):
        read(tmp_path, f"{XYZ} m/s^2", ACC)


def test_decimal_commas_behind_labels_are_not_cut_off(tmp_path):
    with pytest.raises(LogError):
        read(tmp_path, "mx: {:.0f},5 my: {:.0f},25 mz: {:.0f},75", MAG)
