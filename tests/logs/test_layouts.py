"""Layouts of devices and apps as they are met: clocks in parts, units beside, a field twice."""

import json

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read

N = 40
TIME = np.arange(N) * 0.5
FIELD = np.random.default_rng(4).normal(0.0, 30.0, (N, 3)).round(3)
SECONDS = [f"{10 + t:06.3f}" for t in TIME]
ZERO = [0] * N
UNIX = 1_777_796_110  # 2026-05-03T08:15:10Z


def write(tmp_path, header, *columns, separator=",", before="", name="log.csv"):
    cells = [
        column.T.tolist() if isinstance(column, np.ndarray) else [column] for column in columns
    ]
    flat = [
        one for column in cells for one in (column if isinstance(column[0], list) else [column])
    ]
    lines = [separator.join(map(str, row)) for row in zip(*flat, strict=True)]
    path = tmp_path / name
    path.write_text(before + "\n".join([*([header] if header else []), *lines]) + "\n", "utf-8")
    return path


def check(samples, *, scale=1e3, epoch="2026-05-03T08:15:10+00:00"):
    np.testing.assert_allclose(samples.field, FIELD * scale)
    assert samples.unit == ("nT" if scale != 1 else "raw")
    assert samples.time is not None, samples.notes
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=2e-6)
    assert (samples.epoch and samples.epoch.isoformat()) == epoch


MAG = "Bx (uT),By (uT),Bz (uT)"
CLOCKS = {
    "a letter for the zone": ("time", [f"2026-05-03T08:15:{s}Z" for s in SECONDS]),
    "an offset": ("time", [f"2026-05-03 11:15:{s} +03:00" for s in SECONDS]),
    "an offset without a colon": ("time", [f"2026-05-03T11:15:{s}+0300" for s in SECONDS]),
    "a name of a zone": ("time", [f"2026-05-03 03:15:{s} EST" for s in SECONDS]),
    "a zone in the header": ("Date Time GMT+03:00", [f"2026-05-03 11:15:{s}" for s in SECONDS]),
    "HOBO, two digits of the year": (
        '"Date Time, GMT+03:00"', [f"05/13/26 11:15:{s} AM" for s in SECONDS],
    ),
    "date and time": ("Date,Time", ["3.05.2026"] * N, [f"08:15:{s}" for s in SECONDS]),
    "year to second": (
        "Year,Month,Day,Hour,Minute,Second", [2026] * N, [5] * N, [3] * N, [8] * N, [15] * N,
        SECONDS,
    ),
    "LEMI and its kin": (
        "YYYY,MM,DD,hh,mm,ss", [2026] * N, ["05"] * N, ["03"] * N, ["08"] * N, [15] * N, SECONDS,
    ),
    "day of the year": (
        "year,doy,hour,min,sec", [2026] * N, [123] * N, [8] * N, [15] * N, SECONDS,
    ),
    "year, month, day and a time": (
        "year,month,day,time", [2026] * N, [5] * N, [3] * N, [f"8:15:{s}" for s in SECONDS],
    ),
    "hour to millisecond": (
        "hour,min,sec,ms", [8] * N, [15] * N, [s[:2] for s in SECONDS], [s[3:] for s in SECONDS],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOCKS)
def test_clocks(tmp_path, name):
    header, *columns = CLOCKS[name]
    epoch = {"HOBO, two digits of the year": "2026-05-13T08:15:10+00:00"}.get(name)
    epoch = None if name.startswith("hour") else epoch or "2026-05-03T08:15:10+00:00"
    check(read(write(tmp_path, f"{header},{MAG}", *columns, FIELD)), epoch=epoch)


def test_ticks_that_a_header_does_not_make_seconds(tmp_path):
    """A factor before the unit: no clock rather than a wrong one; ticks of DOT are not of MT."""
    ticks = np.round(TIME * 100)[:, None]
    samples = read(write(tmp_path, f"Time (x10 ms),{MAG}", ticks / 1, FIELD))
    assert samples.time is None
    assert "the unit in 'Time (x10 ms)' is not known" in " ".join(samples.notes)
    header = "PacketCounter,SampleTimeFine,Mag_X,Mag_Y,Mag_Z"
    check(read(write(tmp_path, header, ticks, ticks * 1e4, FIELD)), scale=1, epoch=None)
    check(read(write(tmp_path, header, ticks, ticks * 1e2, FIELD)), scale=1, epoch=None)
    samples = read(write(tmp_path, f"index,{MAG}", ticks, FIELD))
    assert "no column is known for a time (index): --columns time=… names it" in samples.notes


def test_days_of_astronomers(tmp_path):
    days = [f"{61163.34387731481 + t / 86400:.11f}" for t in TIME]
    samples = read(write(tmp_path, f"MJD,{MAG}", days, FIELD))
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=1e-3)
    assert samples.epoch.isoformat() == "2026-05-03T08:15:11+00:00"


def test_dates_of_two_digits_that_may_begin_with_the_year_are_left_out(tmp_path):
    times = [f"13/05/03 08:15:{s}" for s in SECONDS]
    samples = read(write(tmp_path, f"time,{MAG}", times, FIELD))
    check(samples, epoch=None)
    assert "may be day/month or month/day" in " ".join(samples.notes)


DAYS = [f"2026-5-3 8:15:{s}" for s in SECONDS]
ACC = ["0.01", "0.02", "1.0"]
LAYOUTS = {  # header, columns before and behind the field, nT of its unit
    "WitMotion, English": (
        "Time\tDevice name\tChip Time()\tAcceleration X(g)\tAcceleration Y(g)\tAcceleration Z(g)\t"
        "Magnetic field X(ʯt)\tMagnetic field Y(ʯt)\tMagnetic field Z(ʯt)\tTemperature(℃)\t"
        "Quaternions 0()",
        [DAYS, ["WT901"] * N, DAYS, *([a] * N for a in ACC)], [[25.0] * N, ZERO], 1e3,
    ),
    "WitMotion, new": (
        "time\tDeviceName\tAccX(g)\tAccY(g)\tAccZ(g)\tHX(uT)\tHY(uT)\tHZ(uT)\tQ0()",
        [DAYS, ["WT901"] * N, *([a] * N for a in ACC)], [ZERO], 1e3,
    ),
    "WitMotion, its script": (
        "Chiptime\tax(g)\tay(g)\taz(g)\tT(°)\tmagx\tmagy\tmagz\tlon\tlat\tYaw\tq1",
        [DAYS, *([a] * N for a in ACC), [25.0] * N], [ZERO, ZERO, ZERO, ZERO], 1,
    ),
    "DatCon": (
        "Clock:Tick#\tUTC\tIMU_ATTI(0):accelX[G]\tIMU_ATTI(0):accelY[G]\tIMU_ATTI(0):accelZ[G]\t"
        "IMU_ATTI(0):magX[a/d]\tIMU_ATTI(0):magY[a/d]\tIMU_ATTI(0):magZ[a/d]\t"
        "IMU_ATTI(0):magMod[a/d]",
        [ZERO, DAYS, *([a] * N for a in ACC)], [ZERO], 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts(tmp_path, name):
    header, before, behind, scale = LAYOUTS[name]
    samples = read(write(tmp_path, header, *before, FIELD, *behind, separator="\t"))
    check(samples, scale=scale)
    np.testing.assert_allclose(samples.acceleration[0] / 9.80665, [0.01, 0.02, 1.0])


def test_the_strength_of_a_field_alone_is_a_frequency(tmp_path):
    """Where a column is named for a magnetometer, hx is not one; Hz never is."""
    header = "time_s,hx,hy,hz,mx_uT,my_uT,mz_uT"
    check(read(write(tmp_path, header, TIME[:, None], FIELD * 0, FIELD)), epoch=None)


def test_a_field_twice_is_told_and_the_raw_one_taken(tmp_path):
    for raw, other in (("mag_{}_raw", "mag_{}_cal"), ("rawMag{}", "Mag{}"), ("m{}_uncal", "m{}")):
        names = [raw.format(a) for a in "XYZ"], [other.format(a) for a in "XYZ"]
        header = ",".join(["time_s", *names[1], *names[0]])
        path = write(tmp_path, header, TIME[:, None], FIELD * 0.9, FIELD)
        samples = read(path)
        check(samples, scale=1, epoch=None)
        given = ",".join(f"{a}={name}" for a, name in zip("xyz", names[1], strict=True))
        assert f"--columns {given}" in " ".join(samples.notes)
        again = read(path, columns=f"time_s=time_s,{given}")
        np.testing.assert_allclose(again.field, FIELD * 0.9)


def test_units_that_stand_beside_or_are_not_known(tmp_path):
    header = "time_s,bx,by,bz,b_total,units,note"
    path = write(tmp_path, header, TIME[:, None], FIELD, ZERO, ["uT"] * N, ["a"] * N)
    check(read(path), epoch=None)
    samples = read(write(tmp_path, "time_s,Bx [pT],By [pT],Bz [pT]", TIME[:, None], FIELD))
    check(samples, scale=1, epoch=None)
    assert "the unit of 'Bx [pT]' is not known: the field is left in raw units" in samples.notes
    records = [
        {"t_s": t, "imu": {"magnetometer": dict(zip("xyz", b, strict=True), unit="µT")}}
        for t, b in zip(TIME.tolist(), FIELD.tolist(), strict=True)
    ]
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, records)))
    check(read(tmp_path / "log.jsonl"), epoch=None)


def test_messages_of_a_phone_with_several_readings_each(tmp_path):
    """Sensor Logger's HTTP push: a list of readings in each message."""
    lines = []
    for k, (t, b) in enumerate(zip(TIME, FIELD.tolist(), strict=True)):
        at = int((UNIX + t) * 1e9)
        readings = [
            {"name": "magnetometer", "time": at, "values": dict(zip("xyz", b, strict=True))},
            {"name": "accelerometer", "time": at, "values": {"x": 0.1, "y": 0.2, "z": 9.8}},
        ]
        lines.append(json.dumps({"messageId": k, "deviceId": "a", "payload": readings}))
    (tmp_path / "log.jsonl").write_text("\n".join(lines))
    samples = read(tmp_path / "log.jsonl", unit="uT")
    check(samples)
    np.testing.assert_allclose(samples.acceleration[0], [0.1, 0.2, 9.8], rtol=1e-3)


@pytest.mark.parametrize(("second", "part"), [("secs", "nsecs"), ("sec", "nanosec")])
def test_messages_that_ros_prints(tmp_path, second, part):
    text = ""
    for t, (x, y, z) in zip(TIME, (FIELD * 1e-6).tolist(), strict=True):
        text += (
            f"header: \n  stamp: \n    {second}: {UNIX + int(t)}\n    {part}: "
            f'{round(t % 1 * 1e9)}\n  frame_id: "imu"\nmagnetic_field: \n  x: {x}\n  y: {y}\n'
            f"  z: {z}\nmagnetic_field_covariance: [0.0, 0.0, 0.0]\n---\n"
        )
    (tmp_path / "mag.yaml").write_text(text)
    check(read(tmp_path / "mag.yaml"))


def test_what_is_missing_is_said_with_what_to_type(tmp_path):
    parts = ([2026] * N, ["05"] * N, ["03"] * N, ["08"] * N, [15] * N, SECONDS)
    path = write(tmp_path, "", *parts, FIELD, ZERO, separator=" ", name="lemi.t00")
    names = "year=1,month=2,day=3,hour=4,minute=5,second=6,x=7,y=8,z=9"
    with pytest.raises(LogError, match=f"--columns {names} --unit uT"):
        read(path)
    check(read(path, columns=names, unit="uT"))
    path = write(tmp_path, "", *parts, FIELD, separator=" ", name="lemi.t00")
    check(read(path, unit="uT"))
    path = write(tmp_path, "Date,Time,Lat,Lon,Mag", ["2026-05-03"] * N, SECONDS, ZERO, ZERO, ZERO)
    with pytest.raises(LogError, match="'Mag' is a magnitude alone, as a scalar magnetometer"):
        open_log(path)


def test_a_clock_beside_one_that_is_wrong_or_of_the_device(tmp_path):
    """MetaWear: the zone in the header is not that of the times; Unix time is right."""
    header = "epoch (ms),time (-13:00),elapsed (s),x-axis (T),y-axis (T),z-axis (T)"
    columns = (UNIX + TIME) * 1e3, [f"2026-05-03T09:15:{s}" for s in SECONDS], TIME, FIELD * 1e-6
    check(read(write(tmp_path, header, *columns, name="Magnetometer.csv")))
    header = "timestamp,RAW_IMU.time_usec," + ",".join(f"RAW_IMU.{a}mag" for a in "xyz")
    samples = read(write(tmp_path, header, UNIX + TIME, TIME * 1e6 + 5e6, FIELD * 10), unit="mG")
    check(samples)
    assert samples.corrected


def test_what_a_device_has_corrected_is_told_and_comes_last(tmp_path):
    names = (
        f"Shimmer_FC32_{name}_CAL" for name in ("Timestamp_Unix", *(f"Mag_{a}" for a in "XYZ"))
    )
    header = "\t".join(names) + "\t\nms\tlocal_flux\tlocal_flux\tlocal_flux\t"
    columns = (UNIX + TIME) * 1e3, FIELD, [""] * N
    samples = read(write(tmp_path, header, *columns, separator="\t", before="sep=\t\n"))
    check(samples, scale=1)
    assert samples.corrected
    assert "Shimmer_FC32_Mag_X_CAL" in " ".join(samples.notes)
    names = ("locationHeading", "magnetometer", "motionMagneticField")
    header = "loggingTime(txt)," + ",".join(f"{name}{a}(µT)" for name in names for a in "XYZ")
    times = [f"2026-05-03 10:15:{s} +0200" for s in SECONDS]
    first, *others = open_log(
        write(tmp_path, header, times, FIELD * 0.9, FIELD, FIELD * 0.8)
    ).sensors
    check(first)
    assert [first.corrected, *(other.corrected for other in others)] == [False, True, True]


def test_sentences_that_state_their_columns(tmp_path):
    """FlySight 2: the time stands first, and is not x."""
    lines = [
        "$FLYS,1", "$VAR,FIRMWARE_VER,v2023.09.22", "$COL,IMU,time,wx,wy,wz,ax,ay,az,temperature",
        "$UNIT,IMU,s,deg/s,deg/s,deg/s,g,g,g,deg C", "$COL,MAG,time,x,y,z,temperature",
        "$UNIT,MAG,s,gauss,gauss,gauss,deg C", "$DATA",
    ]  # fmt: skip
    for t, (x, y, z) in zip(TIME, FIELD / 100, strict=True):
        lines.append(f"$IMU,{t:.6f},0.1,0.2,0.3,0.0,0.0,1.0,25.5")
        lines.append(f"$MAG,{t:.6f},{x:.7f},{y:.7f},{z:.7f},24")
    path = tmp_path / "SENSOR.CSV"
    path.write_text("\n".join(lines) + "\n")
    samples = read(path)
    check(samples, epoch=None)
    assert samples.acceleration is not None
    np.testing.assert_allclose(samples.acceleration[:, 2], 9.80665)
    np.testing.assert_allclose(samples.rotation_rate[5], np.deg2rad([0.1, 0.2, 0.3]))


@pytest.mark.parametrize(
    ("begin", "said"),
    [
        (b"H Product:Blackbox flight data recorder\nH Data version:2\n\x05\x81", "blackbox_decode"),
        (b"\x80\x04\x95\x20\0\0\0\0\0\0\0\x8c\x08builtins", "pickle of Python"),
    ],
)
def test_what_must_be_written_anew_is_said(tmp_path, begin, said):
    (tmp_path / "log").write_bytes(begin)
    with pytest.raises(LogError, match=said):
        open_log(tmp_path / "log")


def test_that_there_is_no_field_is_said_before_all_else(tmp_path):
    """AirData: which of two columns is the time matters to nobody without a magnetometer."""
    header = "time(millisecond),datetime(utc),compass_heading(degrees),pitch(degrees)"
    path = write(
        tmp_path, header, TIME * 1e3, [f"2026-05-03 08:15:{s}" for s in SECONDS], TIME, ZERO
    )
    with pytest.raises(LogError, match="no magnetometer columns"):
        open_log(path)


def test_units_are_read_in_words(tmp_path):
    header = "timestamp;x (in microteslas);y (in microteslas);z (in microteslas)"
    check(read(write(tmp_path, header, TIME + UNIX, FIELD, separator=";")))


def test_an_id_that_alternates_names_sensors(tmp_path):
    """As boards that poll several sensors write them, one object a line."""
    objects = [
        {"id": (13, 9)[k % 2], "counter": k, "mag_x": x + 9 * (k % 2), "mag_y": y, "mag_z": z}
        for k, (x, y, z) in enumerate(np.repeat(FIELD, 2, axis=0).tolist())
    ]
    path = tmp_path / "imu.txt"
    path.write_text("\n".join(map(json.dumps, objects)))
    first, second = open_log(path).sensors
    assert (first.name, second.name) == ("13", "9")
    np.testing.assert_allclose(first.field, FIELD)
    np.testing.assert_allclose(second.field - FIELD, np.tile([9.0, 0.0, 0.0], (N, 1)))


@pytest.mark.parametrize("ids", [np.arange(N), np.arange(N) // 20, ZERO])
def test_an_id_of_rows_or_of_recordings_names_no_sensors(tmp_path, ids):
    path = write(tmp_path, f"id,time_s,{MAG}", list(ids), TIME, FIELD)
    (samples,) = open_log(path).sensors
    np.testing.assert_allclose(samples.field, FIELD * 1e3)
