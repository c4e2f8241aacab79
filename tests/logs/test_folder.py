"""One recording in several files, in one long table, or in JSON: what belongs together meets."""

import json
from zipfile import ZipFile

import numpy as np
import pytest

import agonic as ag

N = 300
UNIX = 1_777_796_130.25 + np.arange(N) * 0.02
RNG = np.random.default_rng(8)
MAG = RNG.normal(0.0, 30.0, (N, 3)).round(3)
UP = RNG.normal(0.0, 1.0, (N, 3))
ACC = (9.81 * UP / np.linalg.norm(UP, axis=1)[:, None]).round(4)
GYRO = RNG.normal(0.0, 1.0, (N, 3)).round(4)


def write(path, values, header="time,seconds_elapsed,z,y,x"):
    lines = [header]
    for unix, row in zip(UNIX, values[:, ::-1], strict=True):
        lines.append(f"{round(unix * 1e9)},{unix - UNIX[0]:.4f},{','.join(map(str, row))}")
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def phone(tmp_path):
    """What Sensor Logger exports: an accelerometer without gravity, and one with it."""
    folder = tmp_path / "phone"
    folder.mkdir()
    write(folder / "Magnetometer.csv", MAG)
    write(folder / "Accelerometer.csv", ACC * 0.02)
    write(folder / "TotalAcceleration.csv", ACC)
    write(folder / "Gravity.csv", ACC)
    write(folder / "Gyroscope.csv", GYRO)
    (folder / "Metadata.csv").write_text("version,device name\n4,Phone\n")
    return folder


def check(samples) -> None:
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.acceleration, ACC, atol=1e-3)
    np.testing.assert_allclose(samples.rotation_rate, GYRO, atol=1e-3)
    assert samples.epoch.year == 2026


def test_a_folder_with_a_file_for_each_sensor(phone) -> None:
    assert ag.sensors(phone) == ("Magnetometer",)
    check(ag.read(phone))


def test_the_same_in_an_archive(phone, tmp_path) -> None:
    path = tmp_path / "phone.zip"
    with ZipFile(path, "w") as archive:
        for file in phone.iterdir():
            archive.write(file, f"2026-05-03/{file.name}")
    check(ag.read(path))


def test_a_folder_of_recordings_is_none(phone, tmp_path) -> None:
    table = "time_s,mag_x_nT,mag_y_nT,mag_z_nT\n0,1,2,3\n1,2,3,4\n"
    for name in ("monday.csv", "tuesday.csv"):
        (tmp_path / name).write_text(table)
    with pytest.raises(ag.LogError, match="agonic fleet"):
        ag.read(tmp_path)


@pytest.mark.parametrize("name", ["Gravity", "Gyroscope", "Orientation"])
def test_the_file_of_another_sensor_alone_is_no_magnetometer(phone, name) -> None:
    write(phone / f"{name}.csv", ACC)
    with pytest.raises(ag.LogError, match="magnetometer"):
        ag.read(phone / f"{name}.csv")


def test_an_archive_that_declares_too_much_is_refused(tmp_path) -> None:
    path = tmp_path / "bomb.zip"
    with ZipFile(path, "w", compression=8) as archive:
        archive.writestr("Magnetometer.csv", b"0," * 300_000)
    declared, said = bytearray(path.read_bytes()), (600_000).to_bytes(4, "little")
    assert declared.count(said) == 2  # beside the file and in the directory at the end
    path.write_bytes(declared.replace(said, (600_000_000).to_bytes(4, "little")))
    with pytest.raises(ag.LogError, match="declares"):
        ag.read(path)


def test_a_long_table_gives_what_its_rows_are_named_for(tmp_path) -> None:
    path = tmp_path / "long.csv"
    lines = ["time_s,sensor,x,y,z"]
    named = (("accelerometer", ACC), ("gravity", ACC), ("magnetometer", MAG), ("light", ACC))
    for row, unix in enumerate(UNIX):
        for name, values in named:
            lines.append(f"{unix:.3f},{name},{','.join(map(str, values[row]))}")
    path.write_text("\n".join(lines) + "\n")
    assert ag.sensors(path) == ("magnetometer",)
    samples = ag.read(path, unit="uT")
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.acceleration, ACC, atol=1e-3)


def records():
    for unix, mag, acc in zip(UNIX, MAG, ACC, strict=True):
        yield {"time": unix, "mag_uT": dict(zip("xyz", mag, strict=True)), "acc": acc.tolist()}


@pytest.mark.parametrize("form", ["lines", "list", "inside", "by name"])
def test_json_in_the_forms_that_are_met(tmp_path, form) -> None:
    path = tmp_path / "log.json"
    whole = list(records())
    if form == "lines":
        path.write_text("\n".join(map(json.dumps, whole)) + "\n{broken\n")
    elif form == "by name":
        columns = {"time": UNIX.tolist()} | {
            f"mag_{a}_uT": MAG[:, k].tolist() for k, a in enumerate("xyz")
        }
        path.write_text(json.dumps({"device": "phone", "data": columns}))
    else:
        path.write_text(json.dumps({"data": whole} if form == "inside" else whole))
    samples = ag.read(path)
    np.testing.assert_allclose(samples.field, MAG * 1e3)
    np.testing.assert_allclose(samples.time, UNIX - np.floor(UNIX[0]), atol=1e-6)
    if form != "by name":
        np.testing.assert_allclose(samples.acceleration, ACC, atol=1e-9)


@pytest.mark.parametrize(
    "text", ["{", "[{}]", '{"a": 1}', "[" * 5000 + "{", '{"mag_x": [1,2,3,4]}']
)
def test_json_without_readings_is_refused_in_one_sentence(tmp_path, text) -> None:
    path = tmp_path / "log.json"
    path.write_text(text)
    with pytest.raises(ag.LogError):
        ag.read(path)


def test_an_accelerometer_alone_is_told_as_that(tmp_path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time_s,acc_x_g,acc_y_g,acc_z_g\n0,0,0,1\n1,0,0,1\n")
    with pytest.raises(ag.LogError, match=r"of an accelerometer only.*name the folder"):
        ag.read(path)


def test_a_sheet_of_absolute_measurements_is_told_where_to_go(tmp_path) -> None:
    path = tmp_path / "sheet.txt"
    path.write_text("# MagPy Absolutes\n# Abs-Observer: x\nMiren:\n86.95 286.95 86.95 286.95\n")
    with pytest.raises(ag.LogError, match="agonic fit north"):
        ag.read(path)


@pytest.mark.parametrize("at", [0.3, 0.6, 0.9])
def test_a_damaged_archive_is_one_sentence(phone, tmp_path, at) -> None:
    path = tmp_path / "phone.zip"
    with ZipFile(path, "w", compression=8) as archive:
        for file in phone.iterdir():
            archive.write(file, file.name)
    data = bytearray(path.read_bytes())
    path.write_bytes(data[: int(at * len(data))] + b"x" * 40 + data[int(at * len(data)) + 40 :])
    with pytest.raises(ag.LogError) as caught:
        ag.read(path)
    assert "\n" not in str(caught.value)


def test_a_member_without_a_name_is_passed_over(phone, tmp_path):
    path = tmp_path / "phone.zip"
    with ZipFile(path, "w") as archive:
        for file in phone.iterdir():
            archive.write(file, file.name)
        archive.writestr("x", "no name")
    with ZipFile(path, "a") as archive:
        archive.infolist()[-1].filename = ""
        archive._didModify = True  # so that the directory is written again
    assert len(ag.read(path)) == N
