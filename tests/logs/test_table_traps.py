"""Tables that look like others: read right, or refused in a line that says what to give."""

import json

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read

N = 40
FIELD = np.random.default_rng(4).normal(0.0, 30.0, (N, 3)).round(2)
TIME = np.arange(N) * 0.02
HEADER = "time_s,mag_x_uT,mag_y_uT,mag_z_uT"
PAIRS = list(zip(TIME, FIELD, strict=True))
ROWS = [f"{t:.2f},{x},{y},{z}" for t, (x, y, z) in zip(TIME, FIELD, strict=True)]


def write(tmp_path, text, encoding="utf-8", name="log.csv"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return path


def check(samples, rows=N):
    np.testing.assert_allclose(samples.field, FIELD[:rows] * 1e3)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME[:rows], atol=1e-6)


@pytest.mark.parametrize("unit", ["m/s^2", "m/s²", "g", "mg", "deg/s", "m", "mm", "px", "V"])
def test_x_y_z_alone_with_the_unit_of_something_else_are_no_field(tmp_path, unit):
    text = "\n".join([f"t (s),x ({unit}),y ({unit}),z ({unit})", *ROWS])
    with pytest.raises(LogError, match="no magnetometer columns found"):
        read(write(tmp_path, text))


@pytest.mark.parametrize("unit", ["G", "mG", "uT", "counts", ""])
def test_x_y_z_alone_may_be_a_field(tmp_path, unit):
    text = "\n".join([f"t (s),x ({unit}),y ({unit}),z ({unit})", *ROWS])
    assert len(read(write(tmp_path, text))) == N


@pytest.mark.parametrize(
    "other",
    [
        "time_s,mag_z_uT,mag_y_uT,mag_x_uT",
        "time_s,mag_x_mG,mag_y_mG,mag_z_mG",
        "time_s,acc_x_g,acc_y_g,acc_z_g",
        "time_s,temperature_C,mag_x_uT,mag_y_uT,mag_z_uT",
    ],
)
def test_rows_under_another_header_are_not_of_the_first(tmp_path, other):
    text = "\n".join([HEADER, *ROWS[:25], other, *ROWS[25:]])
    log = open_log(write(tmp_path, text))
    check(log.sensors[0], 25)
    assert any("another header follows after row 25: the 15 rows" in note for note in log.notes)


def test_a_repeated_header_is_left_out(tmp_path):
    text = "\n".join([HEADER, *ROWS[:25], HEADER, *ROWS[25:]])
    check(read(write(tmp_path, text)))


@pytest.mark.parametrize("title", ["Name:,Accelerometer Sensor", "# gyroscope, rad/s"])
def test_x_y_z_below_the_name_of_another_sensor_are_no_field(tmp_path, title):
    text = "\n".join([title, "", "time,X_value,Y_value,Z_value", *ROWS])
    with pytest.raises(LogError, match="of no magnetometer, by the line"):
        read(write(tmp_path, text))
    text = text.replace("Accelerometer", "Magnetometer").replace("gyroscope", "magnetometer")
    check(read(write(tmp_path, text), unit="uT"))


def decimal_comma(row: str) -> list[str]:
    return [cell.replace(".", ",") for cell in row.split(",")]


@pytest.mark.parametrize(("between", "quote"), [(";", ""), ("\t", ""), (",", '"'), ("  ", "")])
def test_decimal_commas(tmp_path, between, quote):
    lines = [HEADER.split(","), *map(decimal_comma, ROWS)]
    text = "\n".join(between.join(f"{quote}{cell}{quote}" for cell in line) for line in lines)
    check(read(write(tmp_path, text)))


def test_what_cannot_be_a_number_is_shown(tmp_path):
    words = [f"{t},{x} bits,{y} bits,{z} bits" for t, (x, y, z) in zip(TIME, FIELD, strict=True)]
    text = "\n".join(["time_s,mag_x,mag_y,mag_z", *words])
    said = f"'mag_x' hold no number .* '{FIELD[0, 0]} bits'; write 12.5"
    with pytest.raises(LogError, match=said):
        read(write(tmp_path, text))
    plain = [",".join(decimal_comma(row)) for row in ROWS]
    with pytest.raises(LogError, match="4 names and the rows have 8 cells: with decimal commas"):
        read(write(tmp_path, "\n".join([HEADER, *plain])))


@pytest.mark.parametrize("between", [" ", ""])
@pytest.mark.parametrize("unit", ["uT", "µT"])
def test_units_in_the_cells_are_those_of_their_columns(tmp_path, between, unit):
    cells = ([f"{t:.2f}{between}s", *[f"{v}{between}{unit}" for v in b]] for t, b in PAIRS)
    text = "\n".join(["time,mag_x,mag_y,mag_z", *map(",".join, cells)])
    check(read(write(tmp_path, text)))


def test_a_cell_with_another_unit_than_its_column_is_no_reading(tmp_path):
    cells = [[f"{t:.2f}", *[f"{v} uT" for v in b]] for t, b in PAIRS]
    cells[30][1] = "20.0 nT"
    text = "\n".join(["time_s,mag_x,mag_y,mag_z", *map(",".join, cells)])
    assert len(read(write(tmp_path, text))) == N - 1
    with pytest.raises(LogError, match="hold no number"):
        read(write(tmp_path, text.replace("mag_x,mag_y,mag_z", "mag_x_nT,mag_y_nT,mag_z_nT")))


@pytest.mark.parametrize("comma", [True, False])
@pytest.mark.parametrize("apart", [" ", "\u00a0", "\u202f", "'", "."])
def test_thousands_apart_as_spreadsheets_write_them(tmp_path, apart, comma):
    """52 714,5 of French, Russian and German spreadsheets, 52,714.5 of English ones."""

    point, between = (",", apart) if comma else (".", apart.replace(".", ","))
    marks = {ord(","): between, ord("."): point}
    rows = (";".join(f"{v:,.2f}".translate(marks) for v in (t, *1e3 * b)) for t, b in PAIRS)
    check(read(write(tmp_path, "\n".join(["time_s;mag_x_nT;mag_y_nT;mag_z_nT", *rows]))))


@pytest.mark.parametrize(
    "line",
    [
        "{{'t': {0}, 'mag': ({1}, {2}, {3}), 'temp': None}}",
        "{{'t': {0}, 'mag': {{'x': {1}, 'y': {2}, 'z': {3}}}}}",
        "{{'t': np.float64({0}), 'mag': array([{1}, {2}, {3}])}}",
    ],
)
def test_objects_as_python_prints_them(tmp_path, line):
    text = "\n".join(line.format(f"{t:.2f}", *b) for t, b in PAIRS)
    samples = read(write(tmp_path, text), unit="uT")
    check(samples)


def test_exponents_of_fortran(tmp_path):
    rows = (",".join([f"{t:.2f}", *[f"{v:.8E}".replace("E", "D") for v in b]]) for t, b in PAIRS)
    check(read(write(tmp_path, "\n".join([HEADER, *rows]))))


@pytest.mark.parametrize(
    "header",
    [
        "Time,Magnetometer,,\n(s),X (uT),Y (uT),Z (uT)",
        "Time (s),Magnetometer (uT),,\n,X,Y,Z",
        "Time,Mag,Mag,Mag\n,X,Y,Z\ns,uT,uT,uT",
    ],
)
def test_a_header_over_groups_of_columns(tmp_path, header):
    check(read(write(tmp_path, "\n".join([header, *ROWS]))))


@pytest.mark.parametrize(
    ("header", "encoding"),
    [
        ("時刻(s),磁気センサX(uT),磁気センサY(uT),磁気センサZ(uT)", "shift_jis"),
        ("시간(s),자기장 X(uT),자기장 Y(uT),자기장 Z(uT)", "cp949"),
        ("Uhrzeit (s),Magnetfeld X (µT),Magnetfeld Y (µT),Magnetfeld Z (µT)", "latin-1"),
    ],
)
def test_headers_in_the_language_of_the_user(tmp_path, header, encoding):
    check(read(write(tmp_path, "\n".join([header, *ROWS]), encoding)))


def test_minutes_and_seconds_of_a_spreadsheet(tmp_path):
    stamps = [f"{int(t // 60) % 60:02}:{t % 60:05.2f}" for t in TIME + 3599.7]  # over the hour
    rows = [f"{stamp},{x},{y},{z}" for stamp, (x, y, z) in zip(stamps, FIELD, strict=True)]
    check(read(write(tmp_path, "\n".join([HEADER.replace("time_s", "time"), *rows]))))


def test_utf_16_without_a_mark_and_a_sign_for_minus(tmp_path):
    text = "\n".join([HEADER, *ROWS])
    check(read(write(tmp_path, text, "utf-16-le")))
    check(read(write(tmp_path, text.replace("-", "\u2212"))))


def test_a_measurement_of_labview(tmp_path):
    head = "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\nSamples\t40\t40\t40\n"
    head += "X_Dimension\tTime\tTime\tTime\n***End_of_Header***\t\t\t\t\n"
    text = f"{head}X_Value\tBx\tBy\tBz\tComment\n" + "\n".join(ROWS).replace(",", "\t")
    check(read(write(tmp_path, text), unit="uT"))


def test_g_force_goes_before_acceleration_without_gravity(tmp_path):
    header = "time,gFx,gFy,gFz,ax (m/s^2),ay (m/s^2),az (m/s^2),Bx (µT),By (µT),Bz (µT)"
    rows = [f"{r.split(',')[0]},0,0,1,0.1,0.1,0.1,{','.join(r.split(',')[1:])}" for r in ROWS]
    samples = read(write(tmp_path, "\n".join([header, *rows])))
    check(samples)
    np.testing.assert_allclose(samples.acceleration[0], [0, 0, 9.80665], rtol=1e-3)


COLUMNS = {"time_s": TIME, **{f"mag_{a}_uT": FIELD[:, k] for k, a in enumerate("xyz")}}


def test_json_of_other_programs(tmp_path):
    orient = {name: {str(k): v for k, v in enumerate(c.tolist())} for name, c in COLUMNS.items()}
    split = {"columns": list(COLUMNS), "data": np.column_stack(list(COLUMNS.values())).tolist()}
    for whole in (orient, split):  # pandas: to_json(orient="columns"), orient="split"
        check(read(write(tmp_path, json.dumps(whole), name="log.json")))
    records = [dict(zip(COLUMNS, row, strict=True)) for row in split["data"]]
    records[7]["mag_x_uT"] = float("nan")
    samples = read(write(tmp_path, json.dumps(records), name="log.json"))
    assert len(samples) == N - 1
    lines = "\n".join(map(repr, records[:7] + records[8:]))
    assert len(read(write(tmp_path, lines, name="log.json"))) == N - 1
    listed = read(write(tmp_path, json.dumps(FIELD.tolist()), name="log.json"), unit="uT")
    np.testing.assert_allclose(listed.field, FIELD * 1e3)


def test_the_nameless_index_of_moments_that_pandas_writes(tmp_path):
    pandas = pytest.importorskip("pandas")
    moments = pandas.to_datetime(1.7e9 + TIME, unit="s", utc=True)
    columns = {name: values for name, values in COLUMNS.items() if name != "time_s"}
    frame = pandas.DataFrame(columns, index=moments)
    frame.to_csv(tmp_path / "log.csv")
    frame.to_parquet(tmp_path / "log.parquet")
    for name in ("log.csv", "log.parquet"):
        samples = read(tmp_path / name)
        check(samples)
        assert samples.epoch.timestamp() == 1.7e9


def test_rows_of_two_devices_are_two_sensors(tmp_path):
    rows = [f"{row},{'AB'[k % 2]}" for k, row in enumerate(ROWS)]
    log = open_log(write(tmp_path, "\n".join([f"{HEADER},device", *rows])))
    assert [(s.name, len(s)) for s in log.sensors] == [("A", N // 2), ("B", N // 2)]
    np.testing.assert_allclose(log.sensors[1].field, FIELD[1::2] * 1e3)
    alone = [f"{row},WT901" for row in ROWS]
    check(read(write(tmp_path, "\n".join([f"{HEADER},Device name", *alone]))))


def test_messages_of_ardupilot_as_a_table_are_corrected_readings_in_milligauss(tmp_path):
    header = "timestamp,TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ"
    rows = [
        f"{1.7e9 + t:.2f},{t * 1e6:.0f},0,{x},{y},{z},10,20,30,0,0,0"
        for t, (x, y, z) in zip(TIME, FIELD * 10, strict=True)
    ]
    samples = read(write(tmp_path, "\n".join([header, *rows]), name="MAG_0.csv"))
    check(samples)
    assert samples.corrected
    assert samples.epoch.timestamp() == 1.7e9


@pytest.mark.parametrize("stamp", ["[2023-11-14 22:13:{:06.3f}] ", "22:13:{:06.3f} -> "])
def test_stamps_of_terminals_before_three_numbers(tmp_path, stamp):
    rows = [
        f"{stamp.format(20 + t)}{row.partition(',')[2]}" for t, row in zip(TIME, ROWS, strict=True)
    ]
    check(read(write(tmp_path, "\n".join(rows)), unit="uT"))


def test_other_marks_between_cells(tmp_path):
    lines = [HEADER, *ROWS]
    check(read(write(tmp_path, "\n".join(line.replace(",", "|") for line in lines))))
    quoted = "\n".join(f'"{line}"'.replace(",", ";") for line in lines)
    check(read(write(tmp_path, quoted)))
    tex = HEADER.replace("time_s", "t [s]").replace("mag_x_uT", r"$B_x$ [$\mu$T]")
    tex = tex.replace("mag_y_uT", r"$B_y$ [$\mu$T]").replace("mag_z_uT", r"$B_z$ [$\mu$T]")
    check(read(write(tmp_path, "\n".join([tex, *ROWS]))))


@pytest.mark.parametrize("broken", ["ÂµT", "Î¼T", "\ufffdT", "\ufffd\ufffdT", "?T", "¬µT"])
def test_a_letter_lost_from_microtesla_makes_no_tesla(tmp_path, broken):
    header = f"Time (s),Magnetic Field x ({broken}),Magnetic Field y ({broken})"
    check(read(write(tmp_path, "\n".join([f"{header},Magnetic Field z ({broken})", *ROWS]))))


@pytest.mark.parametrize("name", ["type", "sensor_type", "Channel"])
def test_rows_of_several_sensors_by_a_column_of_any_name(tmp_path, name):
    rows = [
        f"{stamp},{sensor},{values}"
        for stamp, _, reading in (row.partition(",") for row in ROWS)
        for sensor, values in (
            ("Accelerometer", "0.1,0.2,9.81"),
            ("Gyroscope", "0.1,0.2,0.3"),
            ("Magnetometer", reading),
        )
    ]
    text = "\n".join([f"time_s,{name},x,y,z", *rows])
    records = [dict(zip(("time_s", name, *"xyz"), row.split(","), strict=True)) for row in rows]
    paths = write(tmp_path, text), write(tmp_path, json.dumps(records), name="log.json")
    for path in paths:
        samples = read(path, unit="uT")
        check(samples)
        np.testing.assert_allclose(samples.acceleration, np.tile([0.1, 0.2, 9.81], (N, 1)))


def test_spans_of_time_that_pandas_writes(tmp_path):
    rows = [
        f"0 days 00:00:{t:09.6f},{row.partition(',')[2]}" for t, row in zip(TIME, ROWS, strict=True)
    ]
    for first in ("time", ""):
        header = HEADER.replace("time_s", first)
        check(read(write(tmp_path, "\n".join([header, *rows]))))


@pytest.mark.parametrize(("stem", "unit"), [("gyro_rad[{}]", 1.0), ("As{}(°/s)", np.pi / 180)])
def test_gyros_as_px4_and_witmotion_name_them(tmp_path, stem, unit):
    axes = "012" if "[" in stem else "XYZ"
    header = ",".join([HEADER, *(stem.format(axis) for axis in axes)])
    samples = read(write(tmp_path, "\n".join([header, *(f"{row},1,-2,3" for row in ROWS)])))
    np.testing.assert_allclose(samples.rotation_rate, unit * np.tile([1.0, -2.0, 3.0], (N, 1)))
