"""Each row of the table of dialects reads a sample of a few lines as its writer meant them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import agonic as ag
from agonic.logs.headers.columns import list_conventions
from agonic.logs.read import open_log
from agonic.logs.text.dialects import list_dialects

G = 9.80665


class Sample(NamedTuple):
    """Lines of a dialect, and what their first row holds in our units."""

    text: str
    field: tuple[float, float, float]
    unit: str
    acceleration: tuple[float, float, float] | None = None
    rotation_rate: tuple[float, float, float] | None = None
    corrected: bool = False


SAMPLES = {
    "MotionCal text": Sample(
        "Uni:0,0,9.8\n"
        "Raw:0,0,8192,160,-32,0,339,-68,649\n"
        "Ori:12,3,4\n"
        "Raw:4096,0,8192,160,-32,0,350,-82,643\n"
        "Raw:0,4096,8192,160,-32,0,365,-94,634\n",
        (33900, -6800, 64900),
        "nT",
        (0, 0, G),
        (np.deg2rad(10), np.deg2rad(-2), 0),
    ),
    "MotionCal text in units": Sample(
        "Uni:0.00,0.00,9.80,0.5,-0.25,0,33.90,-6.80,64.90\n"
        "Uni:4.90,0.00,9.80,0.5,-0.25,0,35.00,-8.20,64.30\n"
        "Uni:0.00,4.90,9.80,0.5,-0.25,0,36.50,-9.40,63.40\n",
        (33900, -6800, 64900),
        "nT",
        (0, 0, 9.8),
        (0.5, -0.25, 0),
    ),
    "Razor AHRS": Sample(
        "".join(
            f"#A-R=1.00,-5.00,25{k}.00\n#M-R={339 + k}.00,-68.00,649.00\n#G-R=1.00,2.00,3.00\n"
            for k in range(5)
        ),
        (339, -68, 649),
        "raw",
    ),
    "Sensorstream": Sample(
        "".join(
            f"6890.0{k}, 3,  0.100,-0.200, 9.700, 4,  0.010,-0.020, 0.030, 5, 33.{k}00,-6.800,"
            "64.900, 85, 1013.2\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.1, -0.2, 9.7),
        (0.01, -0.02, 0.03),
    ),
    "Android measurements of the Smartphone Decimeter Challenge": Sample(
        "MessageType,utcTimeMillis,elapsedRealtimeNanos,MeasurementX,MeasurementY,MeasurementZ,"
        "BiasX,BiasY,BiasZ\n"
        + "".join(
            f"UncalAccel,16070000{k}0,{k}000000,0.1,-0.2,9.7,0,0,0\n"
            f"UncalGyro,16070000{k}1,{k}100000,0.01,-0.02,0.03,0,0,0\n"
            f"UncalMag,16070000{k}2,{k}200000,33.{k},-6.8,64.9,1,2,3\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.1, -0.2, 9.7),
        (0.01, -0.02, 0.03),
    ),
    "MAVLink as text": Sample(
        "".join(
            f"2025-06-01 10:00:00.{k}0: RAW_IMU {{time_usec : 1000{k}0000, xacc : -13, yacc : -5, "
            f"zacc : -999, xgyro : -998, ygyro : -1611, zgyro : 937, xmag : {339 + k}, "
            "ymag : -68, zmag : 649, id : 0, temperature : 0}\n"
            f"2025-06-01 10:00:00.{k}1: SCALED_IMU2 {{time_boot_ms : 1000{k}1, xacc : 1, yacc : 2, "
            "zacc : -998, xgyro : 1, ygyro : 2, zgyro : 3, xmag : 111, ymag : 222, zmag : 333}\n"
            for k in range(5)
        ),
        (33900, -6800, 64900),
        "nT",
        (-0.013 * G, -0.005 * G, -0.999 * G),
        (-0.998, -1.611, 0.937),
        corrected=True,
    ),
    "MAVLink telemetry of Mission Planner": Sample(
        "".join(
            f"2025-06-01T10:00:00.0{k}0,FE,1A,{k},1,1,1B,mavlink_raw_imu_t,time_usec,1000{k}0000,"
            f"xacc,-13,yacc,-5,zacc,-999,xgyro,-998,ygyro,-1611,zgyro,937,xmag,{339 + k},ymag,-68,"
            "zmag,649,sysid,1,compid,1\n"
            for k in range(5)
        ),
        (33900, -6800, 64900),
        "nT",
        (-0.013 * G, -0.005 * G, -0.999 * G),
        (-0.998, -1.611, 0.937),
        corrected=True,
    ),
    "Paparazzi messages": Sample(
        "".join(
            f"0.0{k}0 1 IMU_MAG_RAW 0 {678 + k} -138 1299\n"
            f"0.0{k}1 1 IMU_ACCEL_SCALED 0 1024 0 -10240\n"
            f"0.0{k}1 1 IMU_GYRO_SCALED 0 2048 0 -4096\n"
            for k in range(5)
        ),
        (678, -138, 1299),
        "raw",
        (1, 0, -10),
        (0.5, 0, -1),
    ),
    "TopoDroid calibration": Sample(
        "# 2025.06.01 created by TopoDroid v 6.2.0\n"
        "# index G1x G1y G1z M1x M1y M1z group azimuth clino roll error status\n"
        "1, 240, 0, 24000, 4946, 8555, 22431, -1, 289.67, -0.02, 1.26, 0.3000, 0\n"
        "2, 296, 23560, 872, 4926, 20846, -7824, 1, 289.91, 0.01, 88.34, 0.3000, 0\n"
        "3, 273, -2194, -24002, 4835, -11728, -20361, -1, 289.72, 0.07, 184.90, 0.3000, 0\n"
        "4, 387, -288, 24376, 11482, 582, 22663, -2, 350.73, -0.17, 359.75, 0.3000, 0\n"
        "5, 344, 23559, 792, 11436, 20633, -351, 2, 350.59, -0.06, 88.54, 0.3000, 0\n",
        (4946, 8555, 22431),
        "raw",
        (-0.01 * G, 0, -G),
    ),
    "MicroStrain": Sample(
        "SESSION_INFO\nSession Name,run\nFormat Version,1.0.0.0\n\nDATA_START\n"
        + "GPS TFlags,GPS Week,GPS TOW,"
        + ",".join(
            f"{axis} {what}"
            for what in ("Accel [x8004]", "Gyro [x8005]", "Mag [x8006]")
            for axis in "XYZ"
        )
        + "\n"
        + "".join(
            f"7,2369,36000.{k}00,0.5,0,1,-0.998576,-1.611378,0.937377,0.33{k},-0.068,0.649\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.5 * G, 0, G),
        (-0.998576, -1.611378, 0.937377),
    ),
    "Technosmart": Sample(
        "TagID,Timestamp,X,Y,Z,compX,compY,compZ,Pressure,Temp. (C)\n"
        + "".join(
            f"A01,2025-06-01 10:00:00.{k}00,0.5,0,1,{339 + k},-68.8,649.6,1013.2,20.1\n"
            for k in range(5)
        ),
        (339, -68.8, 649.6),
        "raw",
        (0.5 * G, 0, G),
    ),
    "MAVLink as JSON": Sample(
        "".join(
            f'{{"meta": {{"type": "RAW_IMU", "timestamp": 178000000{k}.5}}, "data": {{"time_usec": '
            f'1{k}00000, "xacc": 0, "yacc": -5, "zacc": -999, "xgyro": -998, "ygyro": -1611, '
            f'"zgyro": 937, "xmag": {339 + k}, "ymag": -68, "zmag": 649}}}}\n'
            f'{{"meta": {{"type": "HEARTBEAT", "timestamp": 178000000{k}.7}}, '
            '"data": {"type": 2}}\n'
            for k in range(5)
        ),
        (33900, -6800, 64900),
        "nT",
        (0, -0.005 * G, -0.999 * G),
        (-0.998, -1.611, 0.937),
        corrected=True,
    ),
    "MAVLink": Sample(
        "timestamp,"
        + ",".join(f"RAW_IMU.{a}{n}" for n in ("acc", "gyro", "mag") for a in "xyz")
        + "\n"
        + "".join(f"178000000{k}.5,0,-5,-999,-998,-1611,937,{339 + k},-68,649\n" for k in range(5)),
        (33900, -6800, 64900),
        "nT",
        (0, -0.005 * G, -0.999 * G),
        (-0.998, -1.611, 0.937),
        corrected=True,
    ),
    "ActiGraph": Sample(
        "------- Data File Created By ActiGraph Link ActiLife v6.13.3 Firmware v1.7.2 -------\n"
        "Serial Number: TAS1H30182785\nStart Time 15:00:00\nStart Date 3/5/2026\n"
        "--------------------------------------------------\n"
        "Timestamp,Accelerometer X,Accelerometer Y,Accelerometer Z,Temperature,Gyroscope X,"
        "Gyroscope Y,Gyroscope Z,Magnetometer X,Magnetometer Y,Magnetometer Z\n"
        + "".join(
            f"2026-03-05T15:00:0{k}.0,0.5,0,1,20.1,90,-45,0,33.{k},-6.8,64.9\n" for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.5 * G, 0, G),
        (np.pi / 2, -np.pi / 4, 0),
    ),
    "OpenLog Artemis": Sample(
        "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz,\n"
        + "".join(
            f"03/15/2026,08:15:00.{k}0,500.0,0.0,1000.0,90.0,-45.0,0.0,33.{k},-6.8,64.9,25.1,10.0,\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.5 * G, 0, G),
        (np.pi / 2, -np.pi / 4, 0),
    ),
    "MagArrow": Sample(
        "Counter,Date,Time,Latitude,Longitude,Mag,MagValid,CompassX,CompassY,CompassZ\n"
        + "".join(
            f"{k},2026/03/05,08:15:00.{k}00,52.0,5.0,49000.1,1,3300{k},-6800,64900\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
    ),
    "DatCon": Sample(
        "Tick#,offsetTime,IMU_ATTI(0):gyro:X,IMU_ATTI(0):gyro:Y,IMU_ATTI(0):gyro:Z,"
        "IMU_ATTI(0):mag:X,IMU_ATTI(0):mag:Y,IMU_ATTI(0):mag:Z\n"
        + "".join(f"{900 * k},0.{k},90,-45,0,{339 + k},-68,649\n" for k in range(5)),
        (339, -68, 649),
        "raw",
        None,
        (np.pi / 2, -np.pi / 4, 0),
    ),
    "InfluxDB line protocol": Sample(
        "# DML\n"
        + "".join(
            f"magnetometer,host=a x=33.{k},y=-6.8,z=64.9 14340555620{k}0000000\n"
            f"accelerometer,host=a x=0.1,y=-0.2,z=9.7 14340555620{k}0000000\n"
            f'cpu,host=a usage=12i,name="x y" 14340555620{k}0000000\n'
            for k in range(5)
        ),
        (33, -6.8, 64.9),
        "raw",
        (0.1, -0.2, 9.7),
    ),
    "Teleplot": Sample(
        "".join(
            f">mag_{axis}:1627551892{k}37:{value}§uT|g\n>state:{k}|t\n"
            for k in range(5)
            for axis, value in (("x", f"33.{k}"), ("y", "-6.8"), ("z", "64.9"))
        ),
        (33000, -6800, 64900),
        "nT",
    ),
    "ESPHome log": Sample(
        "".join(
            f"[08:15:0{k}][D][sensor:094]: 'HMC5883L Field Strength {axis}': Sending state {value}"
            " µT with 1 decimals of accuracy\n"
            for k in range(5)
            for axis, value in (("X", f"33.{k}0000"), ("Y", "-6.80000"), ("Z", "64.90000"))
        ),
        (33000, -6800, 64900),
        "nT",
    ),
    "JSON in lines": Sample(
        "".join(
            f'2026-03-05T08:15:0{k}Z boat/mag {{"mag_x_uT": 33.{k}, "mag_y_uT": -6.8, '
            '"mag_z_uT": 64.9, "acc_m_s2": [0.1, -0.2, 9.7]}\n'
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
        (0.1, -0.2, 9.7),
    ),
    "LEMI-424": Sample(
        "".join(
            f"2020 09 20 00 00 0{k} 3300{k}.000 -6800.000 64900.000 20.36 25.03 106.980 96.331 "
            "182.000 224.213 12.91 2199.0 3404.83911 N 10712.84475 W 12 2 0\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
    ),
    "LEMI-025": Sample(
        "".join(
            f"2020 09 20 00 00 00.{k} 3300{k}.000 -6800.000 64900.000 20.36 25.03 12.1 {k}\n"
            for k in range(5)
        ),
        (33000, -6800, 64900),
        "nT",
    ),
}


READ = [one for one in list_dialects() if not one.refused]


def write(folder: Path, text: str) -> Path:
    path = folder / "log.txt"
    path.write_text(text)
    return path


def test_every_dialect_has_a_sample_and_a_source() -> None:
    renaming = [convention for convention in list_conventions() if convention.columns]
    assert {one.name for one in (*READ, *renaming)} <= SAMPLES.keys()
    assert all(one.source for one in (*list_dialects(), *list_conventions()))


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_read_in_the_documented_units(tmp_path: Path, name: str) -> None:
    sample = SAMPLES[name]
    samples = ag.read(write(tmp_path, sample.text))
    assert samples.unit == sample.unit
    assert samples.field[0] == pytest.approx(sample.field)
    assert samples.corrected is sample.corrected
    for column in ("acceleration", "rotation_rate"):
        values, wanted = getattr(samples, column), getattr(sample, column)
        assert (values is None) == (wanted is None), column
        if wanted is not None:
            assert values[0] == pytest.approx(wanted, abs=1e-6), column


@pytest.mark.parametrize("name", [one.name for one in READ])
def test_a_unit_that_is_given_fills_in_none_that_is_documented(tmp_path: Path, name: str) -> None:
    sample = SAMPLES[name]
    samples = ag.read(write(tmp_path, sample.text), unit="mG")
    scale = 100.0 if sample.unit == "raw" else 1.0
    assert samples.field[0] == pytest.approx(scale * np.array(sample.field))


def test_messages_of_two_compasses_are_two_sensors(tmp_path: Path) -> None:
    log = open_log(write(tmp_path, SAMPLES["MAVLink as text"].text))
    assert [one.name for one in log.sensors] == ["RAW_IMU", "SCALED_IMU2"]
    assert log.sensors[1].field[0] == pytest.approx([11100, 22200, 33300])
    assert all("autopilot had corrected" in one.notes[-1] for one in log.sensors)


def test_shots_of_a_group_of_topodroid_are_along_one_line(tmp_path: Path) -> None:
    samples = ag.read(write(tmp_path, SAMPLES["TopoDroid calibration"].text))
    assert samples.target is not None
    assert samples.target.tolist() == [1, 1, 1, 2, 2]


def test_messages_of_paparazzi_before_6_have_no_number_of_the_sensor(tmp_path: Path) -> None:
    text = "".join(f"0.0{k}0 1 IMU_MAG_RAW {678 + k} -138 1299\n" for k in range(5))
    assert ag.read(write(tmp_path, text)).field[0] == pytest.approx([678, -138, 1299])


def test_units_and_clocks_as_short_as_they_are_written(tmp_path: Path) -> None:
    """`radps` is rad/s; of the two clocks of DroneCAN the one with a date is taken."""
    axes = ",".join(f"{n}_{a}_{u}" for n, u in (("mag", "uT"), ("gyro", "radps")) for a in "xyz")
    text = f"ts_mono,ts_real,{axes}\n" + "".join(
        f"{7 + k},{1_780_000_000 + k},33,-7,4{k},1,2,3\n" for k in range(5)
    )
    samples = ag.read(write(tmp_path, text))
    assert samples.rotation_rate[0] == pytest.approx([1, 2, 3])
    assert samples.epoch.year == 2026
    alone = ag.read(write(tmp_path, text.replace("ts_real", "note")))
    assert (alone.time[0], alone.epoch) == (7, None)


@pytest.mark.parametrize(
    ("cells", "targets"),
    [(["A", "", "B", "A", ""], [1, 0, 2, 1, 0]), (["7", "", "8", "7", ""], [7, 0, 8, 7, 0])],
)
def test_a_sight_without_a_target_is_on_none(tmp_path: Path, cells, targets) -> None:
    text = "target,mag_x_uT,mag_y_uT,mag_z_uT\n" + "".join(f"{c},33,-7,40\n" for c in cells)
    assert ag.read(write(tmp_path, text)).target.tolist() == targets


def test_a_file_without_a_name() -> None:
    with pytest.raises(ag.LogError, match="no file was named"):
        open_log("")


ROWS = [(f"0.{k}", {"mag_x": 30 + k, "mag_y": -7, "mag_z": 40, "acc_z": 9.8}) for k in range(5)]


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("header", ["time,channel,value,unit", "Time;Parameter;Reading;Units"])
def test_a_row_for_each_channel_and_time(tmp_path: Path, header: str, together: bool) -> None:
    """Also where all rows of a channel come before those of the next."""
    between = ";" if ";" in header else ","
    rows = [(t, n, v) for t, values in ROWS for n, v in values.items()]
    units = {"mag_x": "uT", "mag_y": "uT", "mag_z": "uT", "acc_z": ""}
    lines = [between.join((t, n, str(v), units[n])) for t, n, v in rows]
    ordered = lines if together else sorted(lines, key=lambda line: line.split(between)[1])
    samples = ag.read(write(tmp_path, "\n".join([header, *ordered, ""])))
    assert samples.time == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert samples.field[:, 0] == pytest.approx([30e3, 31e3, 32e3, 33e3, 34e3])
    assert samples.field[0] == pytest.approx([30e3, -7e3, 40e3])


def test_a_row_for_each_channel_without_times(tmp_path: Path) -> None:
    text = "channel,value\n" + "".join(
        f"{name},{value}\n" for _, values in ROWS for name, value in values.items()
    )
    samples = ag.read(write(tmp_path, text), unit="uT")
    assert samples.field[:, 0] == pytest.approx([30e3, 31e3, 32e3, 33e3, 34e3])


def test_a_name_of_many_letters_is_refused_at_once(tmp_path: Path) -> None:
    path = write(tmp_path, "x" * 300_000 + ",b,c,d\n1,2,3,4\n2,3,4,5\n")
    with pytest.raises(ag.LogError, match="no magnetometer columns found"):
        open_log(path)


def test_times_in_rows_that_name_their_cells(tmp_path: Path) -> None:
    """Nanoseconds of InfluxDB, milliseconds of Teleplot, the moment before JSON."""
    read = {name: ag.read(write(tmp_path, SAMPLES[name].text)) for name in SAMPLES}
    assert read["InfluxDB line protocol"].epoch.year == 2015
    assert np.diff(read["InfluxDB line protocol"].time) == pytest.approx([0.01] * 4, abs=1e-6)
    assert np.diff(read["Teleplot"].time) == pytest.approx([0.1] * 4, abs=1e-6)
    assert read["JSON in lines"].time.tolist() == [0, 1, 2, 3, 4]
    assert read["LEMI-424"].temperature[0] == 25.03
    assert read["LEMI-025"].temperature[0] == 20.36
    assert np.diff(read["LEMI-025"].time) == pytest.approx([0.1] * 4, abs=1e-6)


def test_series_of_two_hosts_are_two_sensors(tmp_path: Path) -> None:
    text = "".join(
        f"mag,host={host} x={x},y=2,z=3{k} 143405556200000000{k}\n"
        for k in range(5)
        for host, x in (("a", 1), ("b", 7))
    )
    log = open_log(write(tmp_path, text))
    assert [(one.name, one.field[0, 0]) for one in log.sensors] == [
        ("mag,host=a", 1),
        ("mag,host=b", 7),
    ]


def test_channels_of_teleplot_without_times_or_with_several(tmp_path: Path) -> None:
    axes = [("x", 33), ("y", -7), ("z", 65)]
    plain = "".join(f">mag_{a}:{v + k}\n" for k in range(5) for a, v in axes)
    samples = ag.read(write(tmp_path, plain))
    assert samples.time is None
    assert samples.field[1].tolist() == [34, -6, 66]
    packed = "".join(f">mag_{a}:1000:{v};1010:{v + 1};1020:{v + 2}\n" for a, v in axes)
    samples = ag.read(write(tmp_path, packed))
    assert samples.time == pytest.approx([1.0, 1.01, 1.02])
    assert samples.field[2].tolist() == [35, -5, 67]


def test_a_log_of_a_can_bus_is_refused_by_its_name(tmp_path: Path) -> None:
    text = "".join(f"(1436509052.{k}49713) can0 1F5#00C8FFEC01AE0000\n" for k in range(5))
    with pytest.raises(ag.LogError, match=r"a log of a CAN bus.*DBC file"):
        open_log(write(tmp_path, text))


def test_what_influxdb_exports_holds_a_channel_a_row(tmp_path: Path) -> None:
    text = "#datatype,string,long,dateTime:RFC3339,double,string,string\n#default,_result,,,,,\n"
    text += ",result,table,_time,_value,_field,_measurement\n"
    for number, axis in enumerate("xyz"):
        text += "".join(
            f",,{number},2024-05-01T00:00:0{k}Z,{30 + number + k},mag_{axis}_uT,imu\n"
            for k in range(5)
        )
    samples = ag.read(write(tmp_path, text))
    assert samples.field[1].tolist() == [31e3, 32e3, 33e3]
    assert samples.time.tolist() == [0, 1, 2, 3, 4]


LABVIEW = """LabVIEW Measurement\t
X_Columns\t{columns}
***End_of_Header***\t
\t
Channels\t3
Y_Unit_Label\tuT\tuT\tuT
X_Dimension\tTime\tTime\tTime
Delta_X\t0.010000\t0.010000\t0.010000
***End_of_Header***\t\t\t
X_Value\tBx\tBy\tBz\tComment
"""


@pytest.mark.parametrize("columns", ["One", "No"])
def test_labview_tells_units_and_times_in_its_header(tmp_path: Path, columns: str) -> None:
    rows = "".join(
        f"{f'{0.01 * k:.2f}' if columns == 'One' else ''}\t33.{k}\t-6.8\t64.9\n" for k in range(5)
    )
    samples = ag.read(write(tmp_path, LABVIEW.format(columns=columns) + rows))
    assert samples.unit == "nT"
    assert samples.field[0] == pytest.approx([33000, -6800, 64900])
    assert samples.time == pytest.approx([0, 0.01, 0.02, 0.03, 0.04])


def test_toa5_of_campbell(tmp_path: Path) -> None:
    """Its fourth line says how the logger took each column, and counts as no row."""
    text = (
        '"TOA5","CR1000","CR1000","12345","CR1000.Std.32","CPU:mag.CR1","4321","Mag"\n'
        '"TIMESTAMP","RECORD","Bx","By","Bz","PTemp"\n"TS","RN","nT","nT","nT","Deg C"\n'
        '"","","Smp","Smp","Smp","Smp"\n'
    ) + "".join(f'"2024-05-01 00:00:0{k}",{k},3300{k},-6800,64900,21.{k}\n' for k in range(5))
    samples = ag.read(write(tmp_path, text))
    assert (len(samples), sum(samples.rejected.values())) == (5, 0)
    assert samples.unit == "nT"
    assert samples.temperature.tolist() == [21, 21.1, 21.2, 21.3, 21.4]


def test_frames_of_serial_studio(tmp_path: Path) -> None:
    text = "".join(f"/*{0.5 * k},33.{k},-6.8,64.9*/\n" for k in range(30))
    samples = ag.read(write(tmp_path, text))
    assert samples.field[0].tolist() == [33, -6.8, 64.9]
    assert np.diff(samples.time).tolist() == [0.5] * 29


TIMES = [f"{k // 60:02d}:{k % 60:02d}" for k in range(40)]
CUBE = [[10_000.0 + 700 * k, -20_000.0 + 900 * k, 45_000.0 - 800 * k] for k in range(40)]


@pytest.mark.parametrize(
    ("line", "unit"),
    [
        (lambda k, x, y, z: f"2024 01 02 03 {k // 60:02d} {k % 60:02d} {x} {y} {z} 1 2 3 20", "nT"),
        (lambda k, x, y, z: f">mx: {x} my: {y} mz: {z}", "raw"),
        (lambda k, x, y, z: f"> mag: {x}, {y}, {z}", "raw"),
        (
            lambda k, x, y, z: f'12:{TIMES[k]}.123 -> {{"mag_x": {x}, "mag_y": {y}, "mag_z": {z}}}',
            "raw",
        ),
        (lambda k, x, y, z: f'{k};{{"mag_x": {x}, "mag_y": {y}, "mag_z": {z}}}', "raw"),
    ],
    ids=["calendar with a header", "prompts", "prompts and commas", "stamped JSON", "counted JSON"],
)
def test_what_looks_like_a_dialect_is_read_as_what_it_is(line, unit: str, tmp_path: Path) -> None:
    names = "year month day hour minute second mag_x_nT mag_y_nT mag_z_nT acc_x acc_y acc_z warmth"
    rows = [line(k, *each) for k, each in enumerate(CUBE)]
    head = [names] if rows[0].startswith("2024") else []
    file = tmp_path / "log.txt"
    file.write_text("\n".join([*head, *rows]) + "\n")
    (samples,) = ag.open_log(file).sensors
    assert samples.unit == unit
    assert samples.field == pytest.approx(np.array(CUBE))


def test_axes_that_come_one_after_another_make_one_reading(tmp_path: Path) -> None:
    """Channels with times of their own, some milliseconds apart."""
    file = tmp_path / "log.txt"
    file.write_text(
        "".join(
            f">mag_{axis}:{1000 + 20 * k + late}:{value}\n"
            for k, each in enumerate(CUBE)
            for late, (axis, value) in enumerate(zip("xyz", each, strict=True))
        )
    )
    (samples,) = ag.open_log(file).sensors
    assert samples.field == pytest.approx(np.array(CUBE))
    assert np.diff(samples.time) == pytest.approx(np.full(39, 0.02))
