"""What headers mean."""

import pytest

from agonic.errors import LogError
from agonic.logs.headers.columns import find_columns, find_quantities, identify_columns
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import CANONICAL, canonical_header

NAMES = {
    "time_s": ("time", "", "", "s"),
    "timestamp_us": ("time", "", "", "us"),
    "TimeUS": ("time", "", "", "us"),
    "Time (s)": ("time", "", "", "s"),
    "Time since start in ms ": ("time", "", "", "ms"),
    "Millis": ("time", "", "", "millis"),
    "t_unix_ns": ("time", "", "", "ns"),
    "Time (UTC)": ("time", "", "", None),
    "x-axis (T)": ("field", "x", "", "T"),
    "mag_x_nT": ("field", "x", "", "nT"),
    "MagY": ("field", "y", "", None),
    "mz": ("field", "z", "", None),
    "Bx": ("field", "x", "", None),
    "xmag": ("field", "x", "", None),
    "Magnetometer X (uT)": ("field", "x", "", "uT"),
    "Magnetic field x (µT)": ("field", "x", "", "uT"),
    "mag_z [μT]": ("field", "z", "", "uT"),
    "MagX_uT": ("field", "x", "", "uT"),
    "mag_x_mT": ("field", "x", "", "mT"),
    "mag_x_mG": ("field", "x", "", "mG"),
    "mag_x_mGs": ("field", "x", "", "mG"),
    "mag_x_0.1uT": ("field", "x", "", None),
    "mag_x (0.1 uT)": ("field", "x", "", None),
    "mag_x_10nT": ("field", "x", "", None),
    "mag_x_raw": ("field", "x", "", "raw"),
    "field.magnetic_field.x": ("field", "x", "", None),
    "magnetometer_ga[2]": ("field", "z", "", "G"),
    "mag x (body)": ("field", "x", "", None),
    "mag2_x": ("field", "x", "2", None),
    "mag_x_1": ("field", "x", "1", None),
    "B1x_nT": ("field", "x", "1", "nT"),
    "imu2.mag.x": ("field", "x", "2", None),
    "acc_x_m_s2": ("acceleration", "x", "", "ms2"),
    "ACCELEROMETER Z (m/s²)": ("acceleration", "z", "", "ms2"),
    "Accelerometer X (g)": ("acceleration", "x", "", "g"),
    "gyr_x_deg_s": ("rotation_rate", "x", "", "degs"),
    "Gyro X [°/s]": ("rotation_rate", "x", "", "degs"),
    "temp": ("temperature", "", "", None),
    "mag_temp": ("temperature", "", "", None),
    "Temperature (°F)": ("temperature", "", "", "degf"),
    "yaw_rad": ("heading_deg", "", "", "rad"),
    "throttle (%)": ("throttle", "", "", "percent"),
    "Lat_deg": ("latitude_deg", "", "", "deg"),
    "gps_alt_m": ("altitude_m", "", "", "m"),
    "current_mA": ("current_A", "", "", "ma"),
    "mag_nT[0]": ("field", "x", "", "nT"),
    "magn_y_uT": ("field", "y", "", "uT"),
    "scalar_nT": ("scalar", "", "", "nt"),
    "Scalar field (uT)": ("scalar", "", "", "ut"),
    "mmc_x_uT": ("field", "x", "mmc", "uT"),
    "lis3mdl_mag_x": ("field", "x", "lis3mdl", None),
    "T1_C": ("temperature", "", "1", "c"),
    "Bx, nT": ("field", "x", "", "nT"),
    "/front/imu/mag/magnetic_field/x": ("field", "x", "front", None),
    "/imu/mag/vector/x": ("field", "x", "", None),
    "header.stamp.nsecs": ("time", "", "", "nsecs"),
    "gyroADC[0] (deg/s)": ("rotation_rate", "x", "", "degs"),
    "quat_xyzw[3]": ("quaternion", "w", "", None),
    "torquers on": ("flagged", "", "", None),
}
OTHERS = (
    "index",
    "Hz",
    "max",
    "min",
    "m",
    "B_total",
    "accuracy",
    "mag_norm",
    "mag_heading",
    "cpu_temp",
    "T",
    "T2",
    "mag_x_int",
    "bias_x_uT",
    "expected_mag_x_nT",
    "pos_x",
    "azimuth",
    "mag_cal_x",
    "temperature_foo",
    "acc_x_furlongs",
    "",
    "µ",
    "x" * 10_000,
)


@pytest.mark.parametrize(("header", "meaning"), NAMES.items())
def test_aliases(header, meaning):
    column = identify_column(header)
    assert (column.quantity.column, column.axis, column.sensor, column.unit) == meaning


@pytest.mark.parametrize("header", ["mmc T, °C", "mmc T °C", "mmc T (°C)", "mmc T [degC]"])
def test_a_letter_behind_a_sensor_is_a_temperature_by_its_unit(header):
    field = [f"mmc {axis}, µT" for axis in "xyz"]
    assert find_quantities([*field, header])[header] == "temperature"
    assert find_quantities([*field, "mmc T"])["mmc T"] == ""
    assert find_quantities([*field, "mmc T, nT"])["mmc T, nT"] == ""


@pytest.mark.parametrize("header", OTHERS)
def test_other_names_are_not_mistaken(header):
    assert identify_column(header) is None


def test_canonical_names_are_understood_as_what_they_are():
    for column in (
        "time",
        "temperature",
        "heading_deg",
        "current_A",
        "throttle",
        "station",
        "scalar",
        "flagged",
    ):
        found = identify_column(canonical_header(column))
        assert (found.quantity.column, found.rank) == (column, CANONICAL)
    assert identify_column(canonical_header("field", "y", "nT")).rank == CANONICAL


def test_two_names_for_one_thing_are_refused_naming_both():
    with pytest.raises(LogError, match=r"'Bx' and 'magx' could both be the mag x column"):
        identify_columns(["Bx", "By", "Bz", "magx"])


def test_a_canonical_name_goes_before_an_alias_and_bare_axes_come_last():
    found = identify_columns(["timestamp_us", "time_s", "x", "y", "z", "mx", "my", "mz"])
    assert found["time"][""][""].header == "time_s"
    assert [c.header for c in found["field"][""].values()] == ["mx", "my", "mz"]


def test_a_column_that_is_there_twice_is_refused():
    with pytest.raises(LogError, match=r"'mx' is there 2 times"):
        find_columns(["t", "mx", "my", "mz", "mx"])


@pytest.mark.parametrize("header", ["mag_x_pT", "temp_0.1C", "current_10mA", "mag_x_uG"])
def test_a_unit_that_is_not_known_is_not_read_in_part(header):
    assert identify_column(header) is None
