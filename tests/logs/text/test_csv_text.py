"""Text tables in the forms that loggers, phones and spreadsheets write."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.errors import LogError, UnitError
from agonic.logs.read import open_log, read, sensors

G = 9.80665
FIELD = np.array(
    [[20.5, -1.25, 43.0], [19.75, 3.5, 42.5], [18.0, 7.25, -42.125], [16.5, 9.0, 41.0]]
)
TIME = np.array([0.0, 0.02, 0.04, 0.06])
ROWS = np.column_stack([TIME, FIELD])
HEADER = "time_s,mag_x_uT,mag_y_uT,mag_z_uT"


@pytest.fixture
def table(tmp_path):
    """Writes a table to a file, from text or bytes."""

    def write(content, name="log.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def text(header=HEADER, rows=ROWS, separator=",", end="\n"):
    lines = [separator.join(header.split(","))] if header else []
    lines += [separator.join(repr(float(value)) for value in row) for row in rows]
    return end.join(lines) + end


def assert_is_the_table(samples):
    np.testing.assert_array_equal(samples.field, FIELD * 1000)
    np.testing.assert_array_equal(samples.time, TIME)
    assert samples.unit == "nT"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", ", "   "])
def test_separators_and_line_ends(table, separator, end):
    assert_is_the_table(read(table(text(separator=separator, end=end))))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_encodings(table, encoding):
    header = "time [s],mag_x [µT],mag_y [µT],mag_z [µT]"
    assert_is_the_table(read(table(text(header).encode(encoding))))


def test_decimal_comma(table):
    assert_is_the_table(read(table(text(separator=";").replace(".", ","))))


def test_comments_preamble_blank_lines_and_trailing_zeros(table):
    lines = text().splitlines()
    content = "\n".join(
        ["# logger 3", "Device: X", "", "% more", *lines[:3], "# pause", "  ", *lines[3:], "\0\0\0"]
    )
    log = open_log(table(content))
    assert_is_the_table(log.sensors[0])
    assert log.notes == ("1 lines before the table skipped",)


def test_header_in_a_comment(table):
    assert_is_the_table(read(table("# made by numpy\n# " + text(separator=" "))))
    rostopic = "%time,field.header.frame_id,field.magnetic_field.x,field.magnetic_field.y,"
    rostopic += "field.magnetic_field.z\n"
    rows = [f"{int(1.6e18 + t * 1e9)},imu_link,{x},{y},{z}\n" for t, x, y, z in ROWS]
    samples = read(table(rostopic + "".join(rows)), unit="uT")
    np.testing.assert_array_equal(samples.field, FIELD * 1000)
    np.testing.assert_allclose(samples.time, TIME, atol=3e-7)
    assert samples.epoch == datetime.fromtimestamp(1.6e9, UTC)


def test_quoted_cells_and_a_trailing_separator(table):
    quoted = '"Time (s)","Magnetometer X (uT)","Magnetometer Y (uT)","Magnetometer Z (uT)","note"\n'
    quoted += "".join(f'"{t}","{x}","{y}",{z},"warm, dry",\n' for t, x, y, z in ROWS)
    assert_is_the_table(read(table(quoted)))


def test_unit_is_read_or_given_but_never_guessed(table):
    bare = table(text("t,mx,my,mz"))
    assert read(bare).unit == "raw"
    np.testing.assert_array_equal(read(bare).field, FIELD)
    assert "no unit" in " ".join(read(bare).notes)
    np.testing.assert_array_equal(read(bare, unit="G").field, FIELD * 1e5)
    contradicted = read(table(text()), unit="G")
    assert_is_the_table(contradicted)
    assert "given unit G is not used" in " ".join(contradicted.notes)
    np.testing.assert_array_equal(
        read(table(text("t,mag_x_counts,mag_y_counts,mag_z_counts")), unit="mG").field, FIELD * 100
    )
    with pytest.raises(UnitError, match="furlong"):
        read(bare, unit="furlong")
    with pytest.raises(LogError, match="different units"):
        read(table(text("t,mag_x_uT,mag_y_nT,mag_z_uT")))


def test_point_cloud_without_header(table):
    for separator in " ,\t":
        samples = read(table(text("", FIELD, separator)))
        np.testing.assert_array_equal(samples.field, FIELD)
        assert (samples.unit, samples.time) == ("raw", None)
    with pytest.raises(LogError, match="4 columns and no header; name them"):
        read(table(text("")))
    with pytest.raises(LogError, match="2 columns and no header"):
        read(table("1 2\n3 4\n"))


def test_four_columns_without_header_of_which_the_first_is_a_clock(table):
    """As phones and the tools of many papers write a sensor: time, x, y, z."""
    rng = np.random.default_rng(0)
    field, time = rng.normal(size=(60, 3)).round(3), 1.7e12 + np.arange(60) * 20.0
    rows = [f"{t:.0f} {x} {y} {z}" for t, (x, y, z) in zip(time, field, strict=True)]
    samples = read(table("\n".join(rows)))
    np.testing.assert_array_equal(samples.field, field)
    np.testing.assert_allclose(np.diff(samples.time), 0.02, atol=1e-6)
    counted = read(table("\n".join(f"{k} {row[14:]}" for k, row in enumerate(rows))))
    np.testing.assert_array_equal(counted.field, field)
    assert counted.time is None
    with pytest.raises(LogError, match="4 columns and no header"):
        read(table("\n".join(f"{row[14:]} 25.0" for row in rows)))


def test_bad_cells_and_short_rows_are_counted(table):
    content = text() + "0.08,oops,1,2\n0.10,1,,2\n0.12,1,2\n0.14,1,2,3,4\n"
    samples = read(table(content))
    assert dict(samples.rejected) == {"NaN or infinite field": 3}
    np.testing.assert_array_equal(samples.field[-1], [1000, 2000, 3000])
    assert len(samples) == 5


def test_a_bad_cell_does_not_change_how_the_others_are_read(table):
    rng = np.random.default_rng(5)
    rows = np.column_stack([np.arange(2000.0), rng.normal(0, 1e4, (2000, 3))])
    fast, slow = read(table(text(rows=rows))), read(table(text(rows=rows) + "x,1,2,3\n"))
    np.testing.assert_array_equal(fast.field, slow.field)
    np.testing.assert_array_equal(fast.field, rows[:, 1:] * 1e3)


def test_units_of_the_other_columns(table):
    header = (
        "time_ms,mag_x_mG,mag_y_mG,mag_z_mG,acc_x_g,acc_y_g,acc_z_g,gyr_x_deg_s,gyr_y_deg_s,"
        "gyr_z_deg_s,temp_F,roll_deg,pitch_rad,yaw (°),current_mA,throttle_percent,lat_e7,lon,"
        "alt_ft,station"
    )
    row = [
        20,
        200,
        10,
        430,
        0,
        0.6,
        -0.8,
        180,
        0,
        -90,
        212,
        3,
        np.pi / 6,
        271,
        1500,
        25,
        4.75e8,
        -107.5,
        100,
        2,
    ]
    samples = read(table(text(header, [row])))
    assert samples.time.tolist() == [0.02]
    np.testing.assert_allclose(samples.field, [[20000, 1000, 43000]])
    np.testing.assert_allclose(samples.acceleration, [[0, 0.6 * G, -0.8 * G]])
    np.testing.assert_allclose(samples.rotation_rate, [[np.pi, 0, -np.pi / 2]])
    np.testing.assert_allclose(samples.temperature, [100.0])
    assert samples.roll_deg == 3
    np.testing.assert_allclose(samples.pitch_deg, [30.0])
    assert samples.heading_deg == 271
    assert (samples.current_A, samples.throttle, samples.station) == (1.5, 0.25, 2)
    np.testing.assert_allclose([samples.latitude_deg, samples.longitude_deg], [[47.5], [-107.5]])
    np.testing.assert_allclose(samples.altitude_m, [30.48])


def test_whatever_may_disturb_is_kept_by_name_and_unit(table):
    named = "heater_mA,torquer_x_Am2,motor1_pwm_us,rw3_duty,panel_W,speed_m,Heater"
    beside = np.column_stack([1e3 * np.arange(4), np.arange(4) - 2, [1000, 1500, 2000, 1250]])
    rows = np.column_stack([ROWS, beside, [0.1, 0.2, 0.3, 0.4], [5, 6, 7, 8], np.ones((4, 2))])
    samples = read(table(text(f"t,mx,my,mz,{named}", rows)))
    expected = {
        "heater_A": [0, 1, 2, 3],
        "torquer_x_Am2": [-2, -1, 0, 1],
        "motor1_duty": [0, 0.5, 1, 0.25],
        "rw3_duty": [0.1, 0.2, 0.3, 0.4],
        "panel_W": [5, 6, 7, 8],
    }
    assert {n: v.tolist() for n, v in samples.disturbers.items()} == expected
    mapped = read(table(text(f"t,mx,my,mz,{named}", rows)), columns="time_s=t,htr_A=Heater")
    assert set(mapped.disturbers) == {*expected, "htr_A"}


def test_a_scalar_instrument_and_rows_to_leave_out(table):
    header = "time_s,mag_x_uT,mag_y_uT,mag_z_uT,scalar_uT,torquers"
    samples = read(table(text(header, [[0, 20, 1, 43, 47.5, 0], [1, 21, 1, 43, 47.6, 1]])))
    np.testing.assert_allclose(samples.scalar, [47_500, 47_600])
    assert samples.flagged.tolist() == [0, 1]
    unnamed = read(table(text(header.replace("scalar_uT", "scalar"), [[0, 20, 1, 43, 47.5, 0]])))
    assert unnamed.scalar is None
    assert any("scalar left out: its header names no unit" in note for note in unnamed.notes)


def test_without_a_unit_gravity_tells_and_nothing_else_does(table):
    acc, gyro = np.tile([0.1, 0.0, 1.0], (4, 1)), np.full((4, 3), 0.5)
    header = "t,mx,my,mz,ax,ay,az,gx,gy,gz,roll"
    rows = np.column_stack([ROWS, acc, gyro, np.full(4, 1.5)])
    samples = read(table(text(header, rows)))
    np.testing.assert_allclose(samples.acceleration, acc * G)
    assert (samples.rotation_rate, samples.roll_deg) == (None, None)
    assert "gyro left out" in " ".join(samples.notes)
    rows[:, 4:7] *= 16384  # counts
    assert read(table(text(header, rows))).acceleration is None
    turned = np.column_stack([rows, np.linspace(0, 340, 4)])  # a heading that can only be degrees
    assert read(table(text(header + ",yaw", turned))).roll_deg.tolist() == [1.5] * 4


@pytest.mark.parametrize(
    "header",
    [
        "time_s,mag1_x_uT,mag1_y_uT,mag1_z_uT,mag2_x_uT,mag2_y_uT,mag2_z_uT",
        "time_s,mag_x_1_uT,mag_y_1_uT,mag_z_1_uT,mag_x_2_uT,mag_y_2_uT,mag_z_2_uT",
        "Timestamp_s,B1x_uT,B1y_uT,B1z_uT,B2x_uT,B2y_uT,B2z_uT",
    ],
)
def test_several_sensors_in_columns(table, header):
    path = table(text(header, np.column_stack([ROWS, FIELD[:, ::-1]])))
    assert sensors(path) == ("mag1", "mag2")
    assert_is_the_table(read(path))
    np.testing.assert_array_equal(read(path, "mag2").field, FIELD[:, ::-1] * 1000)
    np.testing.assert_array_equal(read(path, "mag2").time, TIME)


def test_each_sensor_takes_its_own_temperature(table):
    header = "time_s,mag1_x,mag1_y,mag1_z,mag2_x,mag2_y,mag2_z,temp1,temp2,acc_x_g,acc_y_g,acc_z_g"
    rows = np.column_stack([ROWS, FIELD, np.tile([21.0, 35.0, 0, 0, 1], (4, 1))])
    first, second = open_log(table(text(header, rows))).sensors
    assert (first.temperature[0], second.temperature[0]) == (21, 35)
    np.testing.assert_allclose(second.acceleration[0], [0, 0, G])


def test_several_sensors_in_rows(table):
    rows = "".join(
        f"{t},{name},{x},{y},{z}\n"
        for t, *v in ROWS.tolist()
        for name, (x, y, z) in (("left", v), ("right", v[::-1]), ("accelerometer", (0, 0, 1)))
    )
    path = table("time_s,sensor,x_uT,y_uT,z_uT\n" + rows)
    assert sensors(path) == ("left", "right")
    assert_is_the_table(read(path, "left"))
    np.testing.assert_array_equal(read(path, "right").field, FIELD[:, ::-1] * 1000)


def test_one_sensor_without_readings_does_not_cost_the_other(table):
    header = "time_s,mag1_x,mag1_y,mag1_z,mag2_x,mag2_y,mag2_z"
    log = open_log(table(text(header, np.column_stack([ROWS, FIELD * np.nan]))))
    assert [s.name for s in log.sensors] == ["mag1"]
    assert "mag2: no usable readings" in log.notes[0]


def test_ambiguous_and_missing_columns_are_named(table):
    with pytest.raises(LogError, match="'mx' and 'magX' could both be the mag x column"):
        read(table(text("t,mx,my,mz,magX", np.column_stack([ROWS, TIME]))))
    with pytest.raises(LogError, match="'time' and 'timestamp' could both be the time"):
        read(table(text("time,timestamp,mx,my,mz", np.column_stack([TIME, ROWS]))))
    with pytest.raises(LogError, match="'mx' is there 2 times"):
        read(table(text("t,mx,my,mz,mx", np.column_stack([ROWS, TIME]))))
    with pytest.raises(LogError, match="only mx, my of x, y and z"):
        read(table(text("t,mx,my,speed")))
    with pytest.raises(LogError, match="no magnetometer columns found among 't', 'a', 'b', 'c'"):
        read(table(text("t,a,b,c")))
    with pytest.raises(LogError, match="a header but no row"):
        read(table(HEADER + "\n"))


def test_slow_columns_do_not_cost_readings(table):
    """Temperature at 1 Hz, heading with a short gap across north, pitch only at the start."""
    n = 200
    t = np.arange(n) / 50
    temperature = np.where(np.arange(n) % 50 == 0, 20 + t, np.nan)
    heading = (350 + 10 * t) % 360
    heading[45:55] = np.nan
    pitch = np.where(t < 1, 5.0, np.nan)
    rows = np.column_stack([t, np.tile(FIELD, (50, 1)), temperature, heading, pitch])
    header = HEADER + ",temperature_C,heading_deg,pitch_deg"
    samples = read(table(text(header, rows).replace("nan", "")))
    assert len(samples) == n
    np.testing.assert_allclose(samples.temperature[:151], 20 + t[:151], atol=1e-9)
    np.testing.assert_allclose(samples.heading_deg, (350 + 10 * t) % 360, atol=1e-9)
    assert samples.pitch_deg is None
    assert "pitch left out: missing in 150 of 200 rows" in samples.notes


def test_values_that_cannot_be_are_not_taken(table):
    rows = np.column_stack([ROWS, [21340.0] * 4, [1500.0] * 4, [4830.2] * 4])
    samples = read(table(text("t,mx,my,mz,temp,throttle,lat", rows)))
    assert (samples.temperature, samples.throttle, samples.latitude_deg) == (None, None, None)
    assert len(samples) == 4


def test_coarse_clock_is_spread_and_a_backward_clock_counted(table):
    rng = np.random.default_rng(2)
    true = np.arange(300) / 50
    rows = np.column_stack([np.floor(true), rng.normal(40, 5, (300, 3))])
    samples = read(table(text(rows=rows)))
    np.testing.assert_allclose(samples.time, true, atol=1e-9)
    assert "the clock stands still for up to 50 rows" in " ".join(samples.notes)
    back = np.vstack([ROWS, ROWS])
    back[4:, 0] = 0.01, 0.03, 0.08, 0.1
    samples = read(table(text(rows=back)))
    assert dict(samples.rejected) == {"time does not increase": 2}
    assert samples.time[-2:].tolist() == [0.08, 0.1]


def test_one_wrong_time_costs_one_row(table):
    rows = np.column_stack([np.arange(100.0), np.tile(FIELD, (25, 1))])
    rows[40, 0] = 1e6
    assert len(read(table(text(rows=rows)))) == 99


def test_a_clock_that_stands_still_is_left_out(table):
    samples = read(table(text(rows=ROWS * [0, 1, 1, 1])))
    assert samples.time is None
    np.testing.assert_array_equal(samples.field, FIELD * 1000)


def test_date_and_time_in_two_columns(table):
    content = "Date,Time,mx,my,mz\n2026-03-01,23:59:59.5,1,2,3\n2026-03-02,00:00:00.5,4,5,6\n"
    samples = read(table(content))
    assert samples.epoch == datetime(2026, 3, 1, 23, 59, 59, tzinfo=UTC)
    assert samples.time.tolist() == [0.5, 1.5]


def test_motioncal_text(table):
    lines = ["Uni:0.1,0.2\r", "Raw:0,4096,-8192,16,-32,0,205,-13,430\r", "Cal1:1,2\r"] * 3
    lines += ["Raw:8192,0,0,0,0,0,1,2,3", "Raw:8192,0,0,0"]
    log = open_log(table("\n".join(lines), "motioncal.txt"))
    samples = log.sensors[0]
    assert (log.format, samples.unit) == ("MotionCal text", "nT")
    np.testing.assert_allclose(samples.field[0], [20500, -1300, 43000])
    np.testing.assert_allclose(samples.acceleration[0], [0, G / 2, -G])
    np.testing.assert_allclose(samples.rotation_rate[0], np.radians([1, -2, 0]))
    assert len(samples) == 4
    assert "the last line ends in the middle" in log.notes


@pytest.mark.parametrize(
    "content",
    [
        ",".join(map("mag_x_{}".format, range(10**6))) + "\n",
        " ".join(["1"] * 10**6) + "\n",
        "1;" * 300_000 + "\n",
        "a" * 10**7,
    ],
)
def test_far_too_many_columns_are_refused(table, content):
    """Looking at each beside each other would take hours."""
    with pytest.raises(LogError, match=r"this is no table|are no log"):
        open_log(table(content))


def test_everything_else_is_named_as_a_stream(table):
    rows = np.column_stack([ROWS, TIME, TIME])
    log = open_log(table(text(HEADER + ",note,cpu_load", rows)))
    assert [(s.name, s.rows) for s in log.streams] == [("note", 4), ("cpu_load", 4)]
    assert log.streams[0].rate_Hz == pytest.approx(50)


@pytest.mark.recordings
def test_recorded_handheld_imu(recordings):
    path = recordings / "vehicle/fusion/sensor_data.csv"
    samples, truth = read(path), np.genfromtxt(path, delimiter=",", skip_header=1)
    np.testing.assert_array_equal(samples.time, truth[:, 0])
    np.testing.assert_array_equal(samples.field, truth[:, 7:] * 1e3)
    np.testing.assert_allclose(samples.acceleration, truth[:, 4:7] * G)
    np.testing.assert_allclose(samples.rotation_rate, np.radians(truth[:, 1:4]))


@pytest.mark.recordings
def test_recorded_point_cloud(recordings):
    path = recordings / "pointclouds/aleksandrbazhin_mag_out.txt"
    samples = read(path)
    np.testing.assert_array_equal(samples.field, np.loadtxt(path))
    assert samples.unit == "raw"


@pytest.mark.recordings
def test_recorded_space_station(recordings):
    samples = read(recordings / "orbit/iss_2021-04-16_all_photos_classified.csv", unit="uT")
    assert len(samples) == 1306
    assert samples.epoch == datetime(2021, 4, 16, 22, 46, 30, tzinfo=UTC)
    assert np.median(np.diff(samples.time)) == pytest.approx(7.9, abs=0.1)
    np.testing.assert_allclose(
        samples.field[0], [178.826957941055, -2260.56790351868, 11203.2423], rtol=1e-6
    )
    assert samples.latitude_deg[0] == pytest.approx(28 + 48 / 60 + 17.8 / 3600)
    assert samples.longitude_deg[0] == pytest.approx(-(107 + 7 / 60 + 22.5 / 3600))
    assert samples.latitude_deg[73] == pytest.approx(-(21 / 60 + 57.8 / 3600))
    # the inclination of the orbit, 51.6°, bounds the latitude
    assert np.abs(samples.latitude_deg).max() == pytest.approx(51.6, abs=0.3)


def test_commas_between_thousands(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text('time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0,"20,100.5","-3,000",43\n1,1,2,"1,043"\n')
    assert read(path).field.tolist() == [[20100.5, -3000.0, 43.0], [1.0, 2.0, 1043.0]]


def test_long_tables_with_labels_are_read_as_short_ones_are(table) -> None:
    rows = [f'{k / 50:.2f},MMC{k % 3}, {k % 7}.5,2,"{k % 11}",20.1' for k in range(120_000)]
    head = "time_s,sensor,mag_x_uT,mag_y_uT,mag_z_uT,temperature_C"
    long = open_log(table("\n".join([head, *rows])))
    short = open_log(table("\n".join([head, *rows[:3_000]])))
    assert [one.name for one in long.sensors] == [one.name for one in short.sensors]
    for whole, part in zip(long.sensors, short.sensors, strict=True):
        assert len(whole) == 40_000
        np.testing.assert_array_equal(whole.field[: len(part)], part.field)
        np.testing.assert_array_equal(whole.time[: len(part)], part.time)
