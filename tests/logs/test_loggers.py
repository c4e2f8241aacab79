"""Files as loggers, converters and phone apps write them: found, in the right units, or said not.

Each case is the header of a real program with readings of one true field: 20, −10, 40 µT while a
sensor lies face up, turned about its own z.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.errors import LogError
from agonic.logs.read import open_log, read

N = 40
G = 9.80665
TIME = np.arange(N) / 50
UNIX = 1.7e9
HEADING = np.linspace(0, 300, N)
FIELD = Rotation.from_euler("z", -HEADING[:, None], degrees=True).apply([20.0, 5.0, -40.0])  # µT
ACC = np.tile([0.0, 0.0, G], (N, 1))
GYRO = np.tile([0.1, -0.2, 0.3], (N, 1))


def write(path, header, columns, *, separator=",", before="", encoding="utf-8"):
    """A text table of columns (n,) or (n, k) under a header."""
    rows = np.column_stack(columns)
    lines = [separator.join(repr(float(value)) for value in row) for row in rows]
    path.write_bytes((before + "\n".join([header, *lines]) + "\n").encode(encoding))
    return path


def axes(stem, names="xyz", separator=","):
    return separator.join(stem.format(name) for name in names)


def check(samples, *, scale=1e3, acceleration=True, gyro=True):
    """The field in nT, or in raw units where `scale` is 1; the clock; the inertial sensors."""
    assert samples.unit == ("raw" if scale == 1 else "nT")
    np.testing.assert_allclose(samples.field, FIELD * scale, rtol=1e-6, atol=1e-3 * scale)
    assert samples.time is not None, samples.notes
    np.testing.assert_allclose(np.diff(samples.time), 0.02, atol=2e-6)
    if acceleration:
        assert samples.acceleration is not None, samples.notes
        np.testing.assert_allclose(samples.acceleration, ACC, atol=1e-4)
    if gyro:
        assert samples.rotation_rate is not None, samples.notes
        np.testing.assert_allclose(samples.rotation_rate, GYRO, rtol=1e-4)


ROS_QUAT = Rotation.from_euler("z", 90 - HEADING[:, None], degrees=True).as_quat()
TESLA = FIELD * 1e-6
DEG = np.degrees(GYRO)
GA = FIELD / 100

TABLES = {
    "PlotJuggler": (
        "__time," + axes("/imu/mag/magnetic_field/{}") + ","
        + axes("/imu/data/linear_acceleration/{}") + "," + axes("/imu/data/angular_velocity/{}"),
        [UNIX + TIME, TESLA, ACC, GYRO],
        1e3,
    ),
    "PlotJuggler, another namespace": (
        "__time," + axes("/sub/imu/mag/magnetic_field/{}") + ","
        + axes("/sub/imu/data/linear_acceleration/{}") + ","
        + axes("/sub/imu/data/angular_velocity/{}"),
        [UNIX + TIME, TESLA, ACC, GYRO],
        1e3,
    ),
    "flat ROS": (
        "timestamp_sec_imu,timestamp_nanosec_imu," + axes("linear_acceleration_{}") + ","
        + axes("angular_velocity_{}") + "," + axes("magnetic_field_{}"),
        [np.floor(UNIX + TIME), np.round((TIME % 1) * 1e9), ACC, GYRO, TESLA],
        1e3,
    ),
    "bagpy": (
        "Time,header.seq,header.stamp.secs,header.stamp.nsecs," + axes("magnetic_field.{}"),
        [UNIX + TIME + 0.3, TIME * 50, np.floor(UNIX + TIME), np.round((TIME % 1) * 1e9), TESLA],
        1e3,
    ),
    "blackbox_decode": (
        "loopIteration, time (us), " + axes("gyroADC[{}] (deg/s)", "012", ", ") + ", "
        + axes("accSmooth[{}] (g)", "012", ", ") + ", " + axes("magADC[{}]", "012", ", "),
        [TIME * 50, TIME * 1e6, DEG, ACC / G, FIELD],
        1,
    ),
    "GnssLogger, one kind": (
        "utcTimeMillis,elapsedRealtimeNanos," + axes("UncalMag{}MicroT", "XYZ") + ","
        + axes("Bias{}MicroT", "XYZ"),
        [(UNIX + TIME) * 1e3, TIME * 1e9, FIELD, FIELD * 0],
        1e3,
    ),
    "GnssLogger, old": (
        "utcTimeMillis," + axes("UncalMag_{}", "XYZ"), [(UNIX + TIME) * 1e3, FIELD], 1e3,
    ),
    "VectorNav": (
        "TimeStartup," + axes("UncompMag{}", "XYZ") + "," + axes("UncompAccel{}", "XYZ") + ","
        + axes("UncompGyro{}", "XYZ") + ",Temperature",
        [TIME * 1e9 + 5e9, GA, ACC, GYRO, 25 + TIME],
        1e3,
    ),
    "VectorNav, corrected beside": (
        "TimeStartup [ns]," + axes("UnCompMag{} [Gauss]", "XYZ") + ","
        + axes("Mag{} [Gauss]", "XYZ") + "," + axes("UnCompAcc{} [m/s^2]", "XYZ") + ","
        + axes("UnCompGyro{} [rad/s]", "XYZ"),
        [TIME * 1e9, GA, GA * 1.1, ACC, GYRO],
        1e3,
    ),
    "Xsens MT": (
        "PacketCounter,SampleTimeFine," + axes("Acc_{}", "XYZ") + "," + axes("Gyr_{}", "XYZ") + ","
        + axes("Mag_{}", "XYZ"),
        [TIME * 50, TIME * 1e4 + 7e6, ACC, GYRO, FIELD],
        1,
    ),
    "Xsens DOT": (
        "PacketCounter,SampleTimeFine," + axes("Euler_{}", "XYZ") + ","
        + axes("Acc_{}", "XYZ") + "," + axes("Gyr_{}", "XYZ") + "," + axes("Mag_{}", "XYZ"),
        [TIME * 50, TIME * 1e6, FIELD, ACC, DEG, FIELD],
        1,
    ),
    "x-IMU3": (
        "Timestamp (us)," + axes("Gyroscope {} (deg/s)", "XYZ") + ","
        + axes("Accelerometer {} (g)", "XYZ") + "," + axes("Magnetometer {} (a.u.)", "XYZ"),
        [TIME * 1e6, DEG, ACC / G, FIELD],
        1,
    ),
    "NGIMU": (
        "Time (s)," + axes("Gyroscope {} (deg/s)", "XYZ") + ","
        + axes("Accelerometer {} (g)", "XYZ") + ","
        + axes("Magnetometer {} (uT)", "XYZ") + ",Barometer (hPa)",
        [TIME, DEG, ACC / G, FIELD, 1000 + TIME],
        1e3,
    ),
    "SensorLog": (
        "loggingTime(txt),motionYaw(rad)," + axes("accelerometerAcceleration{}(G)", "XYZ") + ","
        + axes("gyroRotation{}(rad/s)", "XYZ") + "," + axes("magnetometer{}(µT)", "XYZ"),
        [UNIX + TIME, TIME, ACC / G, GYRO, FIELD],
        1e3,
    ),
    "WitMotion": (
        "时间(s)," + axes("加速度{}(g)", "XYZ") + "," + axes("角速度{}(°/s)", "XYZ") + ","
        + axes("磁场{}(uT)", "XYZ") + ",温度(°C)",
        [TIME, ACC / G, DEG, FIELD, 20 + TIME],
        1e3,
    ),
    "x, z, y of PX4 in PlotJuggler": (
        "__time," + axes("/vehicle_magnetometer/magnetometer_ga.0{}", "012"), [TIME, GA], 1e3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_tables_of_loggers(tmp_path, name):
    header, columns, scale = TABLES[name]
    samples = read(write(tmp_path / "log.csv", header, columns))
    inertial = "cc" in header or "加" in header
    check(samples, scale=scale, acceleration=inertial, gyro=inertial)


@pytest.mark.parametrize("encoding", ["utf-8", "cp1251", "utf-16"])
def test_russian(tmp_path, encoding):
    header = "Время, с;Вх, мкТл;Ву, мкТл;Вz, мкТл;T, °C;Ускорение X, м/с2;Ускорение Y, м/с2;"
    header += "Ускорение Z, м/с2"
    path = tmp_path / "log.csv"
    write(path, header, [TIME, FIELD, 20 + TIME, ACC], separator=";", encoding=encoding)
    samples = read(path)
    check(samples, gyro=False)
    np.testing.assert_allclose(samples.temperature, 20 + TIME)


def test_chinese_in_the_encoding_of_windows(tmp_path):
    header = "时间(s),磁场X(微特),磁场Y(微特),磁场Z(微特)"
    path = write(tmp_path / "log.csv", header, [TIME, FIELD], encoding="gb18030")
    check(read(path), acceleration=False, gyro=False)
    assert "GB 18030" in " ".join(open_log(path).notes)


def test_a_foreign_word_that_is_not_known_is_no_reading(tmp_path):
    header = "Время, с;Смещение X, мкТл;Смещение Y, мкТл;Смещение Z, мкТл"
    with pytest.raises(LogError, match="no magnetometer"):
        read(write(tmp_path / "log.csv", header, [TIME, FIELD], separator=";"))


def test_sensors_by_their_names(tmp_path):
    """Chips by name before the axes; temperatures numbered or named."""
    header = "t_s," + axes("mmc_{}_uT") + "," + axes("rm3100_{}_uT") + ",mmc_T_C,rm3100_T_C"
    columns = [TIME, FIELD, FIELD[:, ::-1], 20 + TIME, 30 + TIME]
    first, second = open_log(write(tmp_path / "log.csv", header, columns)).sensors
    assert (first.name, second.name) == ("mmc", "rm3100")
    check(first, acceleration=False, gyro=False)
    np.testing.assert_allclose(second.field, FIELD[:, ::-1] * 1e3, atol=1e-3)
    assert (first.temperature[0], second.temperature[0]) == (20, 30)
    path = write(
        tmp_path / "one.csv", "t_s," + axes("mmc_{}_uT") + ",T1_C", [TIME, FIELD, 20 + TIME]
    )
    np.testing.assert_allclose(read(path).temperature, 20 + TIME)


def test_a_clock_of_its_own_for_each_topic(tmp_path):
    """PlotJuggler lists the times of all topics: a row has the values of one."""
    late = TIME + 0.007
    header = (
        "__time,"
        + axes("/imu/mag/magnetic_field/{}")
        + ","
        + axes("/imu/data/linear_acceleration/{}")
    )
    header += (
        "," + axes("/imu/data/angular_velocity/{}") + "," + axes("/imu/data/orientation/{}", "xyzw")
    )
    empty = np.full((N, 1), np.nan)
    mag = np.column_stack([UNIX + TIME, TESLA, *[empty] * 10])
    imu = np.column_stack([UNIX + late, *[empty] * 3, ACC, GYRO, ROS_QUAT])
    rows = np.concatenate([mag, imu])
    path = write(tmp_path / "log.csv", header, [rows[np.argsort(rows[:, 0], kind="stable")]])
    path.write_text(path.read_text().replace("nan", ""))
    samples = read(path)
    check(samples)
    assert dict(samples.rejected) == {}
    np.testing.assert_allclose(np.abs(samples.roll_deg), 180, atol=1e-6)
    turned = (samples.heading_deg[1:-1] - HEADING[1:-1] + 180) % 360 - 180
    np.testing.assert_allclose(turned, -0.007 * HEADING[1] * 50, atol=0.2)


@pytest.mark.parametrize("down", [False, True], ids=["z up", "z down"])
@pytest.mark.parametrize("inverse", [False, True], ids=["to world", "to sensor"])
def test_a_quaternion_of_stated_order_becomes_roll_and_pitch(tmp_path, down, inverse):
    """Gravity says which of the four conventions it is; heading stays unknown."""
    rng = np.random.default_rng(3)
    rotation = Rotation.from_rotvec(rng.normal(0, 1, (N, 3)))
    up = np.array([0, 0, -1.0 if down else 1.0])
    acc = rotation.apply(up, inverse=True) * G
    quat = (rotation.inv() if inverse else rotation).as_quat(scalar_first=True)
    header = "time_s," + axes("mag_{}_uT") + "," + axes("acc_{}_m_s2") + "," + axes("q{}", "wxyz")
    samples = read(write(tmp_path / "log.csv", header, [TIME, FIELD, acc, quat]))
    assert samples.heading_deg is None
    down_seen = -acc / G
    np.testing.assert_allclose(
        samples.pitch_deg, -np.degrees(np.arcsin(down_seen[:, 0])), atol=1e-5
    )
    roll = np.degrees(np.arctan2(down_seen[:, 1], down_seen[:, 2]))
    np.testing.assert_allclose((samples.roll_deg - roll + 180) % 360, 180, atol=1e-4)


def test_a_quaternion_that_gravity_contradicts_is_left_out(tmp_path):
    rng = np.random.default_rng(4)
    quat = Rotation.random(N, random_state=5).as_quat(scalar_first=True)
    header = "time_s," + axes("mag_{}_uT") + "," + axes("acc_{}_m_s2") + "," + axes("q{}", "wxyz")
    samples = read(write(tmp_path / "a.csv", header, [TIME, FIELD, rng.normal(0, 6, (N, 3)), quat]))
    assert samples.roll_deg is None
    assert "orientation left out" in " ".join(samples.notes)
    unordered = header.replace("qw,qx,qy,qz", "q[0],q[1],q[2],q[3]")
    assert read(write(tmp_path / "b.csv", unordered, [TIME, FIELD, ACC, quat])).roll_deg is None


def test_a_documented_unit_gives_way_to_the_given_one_and_to_reason(tmp_path):
    header = "__time," + axes("/imu/mag/magnetic_field/{}")
    path = write(tmp_path / "log.csv", header, [UNIX + TIME, FIELD])  # a driver that publishes µT
    samples = read(path)
    assert samples.unit == "raw"
    assert "cannot be" in " ".join(samples.notes)
    check(read(path, unit="uT"), acceleration=False, gyro=False)


def test_files_of_ulog2csv(tmp_path):
    header = "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count"
    columns = [TIME * 1e6, TIME * 1e6, TIME * 0 + 396825, GA, 30 + TIME, TIME * 0]
    samples = read(write(tmp_path / "flight_sensor_mag_0.csv", header, columns))
    check(samples, acceleration=False, gyro=False)
    assert read(write(tmp_path / "renamed.csv", header, columns)).unit == "raw"
    with pytest.raises(LogError, match="of the acc that the file is named for"):
        read(write(tmp_path / "flight_sensor_accel_0.csv", header, columns))


def test_sensor_logger_writes_one_file_a_sensor(tmp_path):
    header, columns = "time,seconds_elapsed,z,y,x", [(UNIX + TIME) * 1e9, TIME, FIELD[:, ::-1]]
    check(
        read(write(tmp_path / "Magnetometer.csv", header, columns)), acceleration=False, gyro=False
    )
    with pytest.raises(LogError, match="name the file of the magnetometer"):
        read(write(tmp_path / "Gyroscope.csv", header, columns))


def test_gnss_logger(tmp_path):
    """Rows of several kinds, each with its header in a comment, at rates of their own."""
    lines = [
        "# ", "# Version: v3.1.0.4", "# Raw,utcTimeMillis,TimeNanos,LeapSecond",
        "# UncalAccel,utcTimeMillis,elapsedRealtimeNanos,UncalAccelXMps2,UncalAccelYMps2,"
        "UncalAccelZMps2,BiasXMps2,BiasYMps2,BiasZMps2",
        "# UncalMag,utcTimeMillis,elapsedRealtimeNanos,UncalMagXMicroT,UncalMagYMicroT,"
        "UncalMagZMicroT,BiasXMicroT,BiasYMicroT,BiasZMicroT", "# ",
    ]  # fmt: skip
    for t, b, a in zip(TIME, FIELD, ACC, strict=True):
        ms = 1.7e12 + t * 1e3
        lines.append(f"UncalMag,{ms:.0f},{t * 1e9:.0f},{b[0]},{b[1]},{b[2]},0,0,0")
        lines += [f"UncalAccel,{ms + k:.0f},{k},{a[0]},{a[1]},{a[2]},0,0,0" for k in (3, 13)]
        lines.append(f"Raw,{ms:.0f},1,18")
    path = tmp_path / "gnss_log.txt"
    path.write_text("\n".join(lines))
    log = open_log(path)
    assert [samples.name for samples in log.sensors] == ["UncalMag"]
    check(log.sensors[0], gyro=False)
    assert {"UncalAccel", "Raw"} <= {stream.name for stream in log.streams}


def test_rate_and_empty_lines_before_the_table(tmp_path):
    before = "Logger,7\nFs,50\n,,,\n\n"
    path = write(tmp_path / "log.csv", axes("mag_{}_uT"), [FIELD], before=before)
    check(read(path), acceleration=False, gyro=False)
    xsens = "// Start Time: Unknown\n// Update Rate: 50.0Hz\n"
    header = "PacketCounter\t" + axes("Mag_{}", "XYZ", "\t")
    path = write(tmp_path / "mt.txt", header, [TIME * 50, FIELD], separator="\t", before=xsens)
    check(read(path), scale=1, acceleration=False, gyro=False)


def test_units_in_a_line_of_their_own(tmp_path):
    header = "Time,MagX,MagY,MagZ,Temp\nms,uT,uT,uT,°C"
    path = write(tmp_path / "log.csv", header, [TIME * 1e3, FIELD, 20 + TIME])
    check(read(path), acceleration=False, gyro=False)


@pytest.mark.parametrize(
    "cell", ['"x: {}, y: {}, z: {}"', '"({}, {}, {})"', "{} {} {}", '"[{};{};{}]"']
)
def test_three_numbers_in_a_cell(tmp_path, cell):
    path = tmp_path / "log.csv"
    rows = [f"{t}," + cell.format(*b) for t, b in zip(TIME, FIELD.tolist(), strict=True)]
    path.write_text("\n".join(["time_s,mag_uT", *rows]))
    check(read(path), acceleration=False, gyro=False)


def test_numbers_that_name_themselves(tmp_path):
    path = tmp_path / "serial.txt"
    rows = [
        f"t_ms:{t * 1e3} mx={x}, my: {y},mz:{z}"
        for t, (x, y, z) in zip(TIME, FIELD.tolist(), strict=True)
    ]
    path.write_text("\n".join(rows))
    check(read(path, unit="uT"), acceleration=False, gyro=False)


def sentence(body):
    total = 0
    for letter in body.encode():
        total ^= letter
    return f"${body}*{total:02X}\r\n"


def test_sentences(tmp_path):
    """VectorNav: an uncorrected field is found, a corrected one says so, others are named."""
    path = tmp_path / "log.nmea"
    body = [
        ",".join(f"{v:+09.4f}" for v in (*b, *a, *w)) for b, a, w in zip(GA, ACC, GYRO, strict=True)
    ]
    good = [
        f"{t:.3f} " + sentence(f"VNIMU,{text},+22.1,+101.3")
        for t, text in zip(TIME, body, strict=True)
    ]
    bad = good[3].replace("VNIMU,+", "VNIMU,-")
    path.write_bytes("".join([*good[:4], bad, *good[4:], "\x02$GPGGA,1,2\x03\r\n"]).encode())
    log = open_log(path)
    np.testing.assert_allclose(log.sensors[0].field, GA * 1e5, atol=5.1)
    np.testing.assert_allclose(log.sensors[0].temperature, 22.1)
    np.testing.assert_allclose(log.sensors[0].time, TIME, atol=1e-9)
    assert "1 sentences with a wrong checksum" in " ".join(log.notes)
    path.write_text("".join(sentence(f"VNMAR,{text}") for text in body))
    assert read(path).corrected
    path.write_text(sentence("GPGGA,123519,4807.038,N") * 9 + sentence("HCHDM,12.5,M"))
    with pytest.raises(LogError, match=r"\$GPGGA \(9\), \$HCHDM \(1\) hold no magnetometer; have"):
        read(path)


@pytest.mark.recordings
def test_recorded_car(recordings):
    """Flat CSV of a VN-100 in a car: clock in two columns, SI units of ROS, gravity along −z."""
    samples = read(recordings / "ros/data_going_in_circles.csv")
    assert (len(samples), dict(samples.rejected)) == (3987, {})
    assert samples.latitude_deg is not None  # of rows with another clock
    assert np.median(np.diff(samples.time)) == pytest.approx(0.025, abs=0.001)
    assert samples.epoch.isoformat() == "2024-10-21T14:46:28+00:00"
    np.testing.assert_allclose(samples.field[0], [-23230, -8610, 29020])
    np.testing.assert_allclose(samples.acceleration[0], [0.09, 0.137, -10.19])
    np.testing.assert_allclose(samples.rotation_rate[0], [-0.000985, -0.000687, -0.000277])
    assert np.abs(samples.roll_deg).max() < 15  # a car; its axes are forward, right, down
    assert samples.heading_deg is None


ODD = "clock,S0,S1,S2,mx,my,mz"
NAMES = "time_s=clock,x=S0,y=S1,z=S2"


def test_columns_that_are_named_by_hand(tmp_path):
    """In the call, or in a file beside the log; they go before what headers say."""
    path = write(tmp_path / "log.csv", ODD, [TIME, FIELD, FIELD * 0])
    check(read(path, columns=NAMES, unit="uT"), acceleration=False, gyro=False)
    pairs = dict(pair.split("=") for pair in NAMES.split(","))
    check(read(path, columns=pairs, unit="uT"), acceleration=False, gyro=False)
    lines = [f'{name} = "{header}"' for name, header in pairs.items()]
    (tmp_path / "log.csv.toml").write_text("\n".join(['unit = "uT"', "[columns]", *lines]))
    check(read(path), acceleration=False, gyro=False)
    bare = write(tmp_path / "bare.csv", "", [TIME, FIELD])
    check(read(bare, columns="time_s=1,x=2,y=3,z=4", unit="uT"), acceleration=False, gyro=False)
    arrays = tmp_path / "log.npz"
    np.savez(arrays, clock=TIME, S=FIELD)
    names = "time_s=clock,x=S[0],y=S[1],z=S[2]"
    check(read(arrays, columns=names, unit="uT"), acceleration=False, gyro=False)


def test_the_error_shows_the_line_to_type(tmp_path):
    path = write(tmp_path / "log.csv", "clock,S0,S1,S2", [TIME, FIELD])
    with pytest.raises(LogError, match="--columns time=clock,x=S0,y=S1,z=S2 --unit uT"):
        read(path)
    with pytest.raises(LogError, match=r"4 columns and no header.*--columns time=1,x=2,y=3,z=4"):
        read(write(tmp_path / "bare.csv", "", [TIME[::-1], FIELD]))
    with pytest.raises(LogError, match="columns names 'S9'; the columns are 'clock', 'S0'"):
        read(path, columns="x=S9,y=S1,z=S2")
    with pytest.raises(LogError, match="'depth' is not a column; use time, x, y, z"):
        read(path, columns="depth=S0")
    with pytest.raises(LogError, match="it needs NAME=HEADER"):
        read(path, columns="S0,S1,S2")


def test_a_command_takes_the_names_too(tmp_path, capsys):
    from agonic.cli import run

    path = write(tmp_path / "log.csv", "clock,S0,S1,S2", [TIME, FIELD])
    assert run(["info", str(path)]) == 2
    assert "--columns time=clock,x=S0,y=S1,z=S2" in capsys.readouterr().err
    assert run(["info", str(path), "--columns", NAMES, "--unit", "uT"]) == 0
    assert "40" in capsys.readouterr().out
    assert run(["info", str(path)]) == 2  # nothing is left behind


def test_what_could_not_be_read_is_said_before_a_verdict(tmp_path):
    """A gyroscope without a unit, a clock of unknown ticks: causes are named without them."""
    from agonic.health.readings import inspect

    header = "ticks,t," + axes("mag_{}_uT") + "," + axes("acc_{}_m_s2") + "," + axes("gyro_{}")
    path = write(tmp_path / "log.csv", header, [TIME, np.round(TIME * 5e4), FIELD, ACC, GYRO])
    samples = read(path)
    (finding,) = [found for found in inspect(samples) if found.name == "not read"]
    assert "times left out" in finding.what
    assert "gyro left out: its header names neither degrees nor radians" in finding.what
    from agonic.ellipsoid.fit import fit_ellipsoid

    assert fit_ellipsoid(samples).status.startswith("Not all of the log could be read: times left")
    good = read(write(tmp_path / "good.csv", "t_s," + axes("mag_{}_uT"), [TIME, FIELD]))
    assert not [found for found in inspect(good) if found.name == "not read"]


def test_columns_that_are_something_else_are_not_suggested(tmp_path):
    path = write(tmp_path / "log.csv", "t_s," + axes("acc_{}_g"), [TIME, ACC / G])
    with pytest.raises(LogError, match="--columns time=t_s,x=…,y=…,z=… --unit uT"):
        read(path)
