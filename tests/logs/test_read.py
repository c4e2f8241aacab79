"""One door for all files: told by content, with clear words where it stays shut."""

import hashlib
import zipfile

import numpy as np
import pytest

from agonic.errors import LogError, UnitError
from agonic.files.names import file_stem
from agonic.logs.formats import READ
from agonic.logs.read import open_log, read, sensors
from agonic.logs.text import csv_text

TWO = "time_s,mag1_x_nT,mag1_y_nT,mag1_z_nT,mag2_x_nT,mag2_y_nT,mag2_z_nT\n0,1,2,3,4,5,6\n"


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.bin"  # the name says nothing
    path.write_text(TWO)
    return path


def test_a_sensor_is_chosen_by_name_or_position(two):
    assert sensors(two) == ("mag1", "mag2")
    assert read(two).name == "mag1"
    for choice in ("mag2", "1", 1):
        assert read(two, choice).field.tolist() == [[4, 5, 6]]
    assert read(two, 0).name == read(two, "0").name == "mag1"


@pytest.mark.parametrize("choice", ["mag3", 2, "2", -1, ""])
def test_an_unknown_sensor_lists_those_there_are(two, choice):
    with pytest.raises(LogError, match=r"there are mag1, mag2"):
        read(two, choice)


def test_a_name_goes_before_a_position(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("sensor,x_nT,y_nT,z_nT\n1,1,0,0\n0,2,0,0\n")
    assert read(path, "0").field[0, 0] == 2


def test_the_source_is_the_file_by_name_and_hash(two):
    source = read(two).source
    assert source.name == "two.bin"
    assert source.sha256 == hashlib.sha256(TWO.encode()).hexdigest()
    assert source.count == 1


def test_what_is_no_file(tmp_path):
    with pytest.raises(LogError, match="there are no files in it"):
        open_log(tmp_path)
    with pytest.raises(LogError, match="no such file"):
        open_log(tmp_path / "missing.csv")
    with pytest.raises(LogError, match="a device or a pipe"):
        open_log("/dev/null")
    (tmp_path / "empty.csv").touch()
    with pytest.raises(LogError, match="the file is empty") as caught:
        open_log(tmp_path / "empty.csv")
    assert caught.value.path == tmp_path / "empty.csv"


def test_a_file_that_may_not_be_read(two, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(two), "open", refuse)
    with pytest.raises(LogError, match="cannot be read: Permission denied"):
        open_log(two)


def test_well_known_files_are_named(tmp_path):
    path = tmp_path / "log.csv"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("log.csv", TWO)
    assert len(open_log(path).sensors[0]) == len(TWO.splitlines()) - 1
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
    with pytest.raises(LogError, match=r"workbook cannot be unpacked.*save the sheet as CSV"):
        open_log(path)
    path.write_text('{"mag": 1}')
    with pytest.raises(LogError, match="no magnetometer columns"):
        open_log(path)
    path.write_text("<!DOCTYPE html>\n<p>not found</p>")
    with pytest.raises(LogError, match="this is a web page"):
        open_log(path)
    path.write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(LogError, match="binary data") as caught:
        open_log(path)
    assert READ in str(caught.value)


def test_a_fault_of_a_parser_becomes_one_line(two, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("deep\n  inside")

    monkeypatch.setattr(csv_text, "read_tables", fail)
    with pytest.raises(LogError, match=r"damaged.*ZeroDivisionError: deep inside"):
        open_log(two)


def test_an_unknown_unit_is_refused_before_anything_else(two):
    with pytest.raises(UnitError, match="parsec"):
        open_log(two, unit="parsec")


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("file", "format"),
    [
        ("vehicle/ardupilot/log171.bin", "ArduPilot dataflash"),
        ("vehicle/px4/sample.ulg", "PX4 ULog"),
        ("vehicle/ardusub/small.tlog", "MAVLink telemetry"),
        ("vehicle/broad/12_undisturbed_slow_translation_C.mat", "MATLAB file"),
        ("vehicle/fusion/sensor_data.csv", "text table"),
        ("orbit/swarmA_MAGA_LR_1B_20160101_10s.cdf", "CDF"),
        ("orbit/swarmA_MAGA_LR_1B_20160101_10s.csv", "VirES text table"),
        ("observatory/LLO20200106vmin.min", "IAGA-2002"),
    ],
)
def test_recordings_are_told_apart_whatever_they_are_called(recordings, tmp_path, file, format):
    path = tmp_path / "recording"
    path.symlink_to(recordings / file)
    log = open_log(path)
    assert log.format == format
    assert log.path == path
    assert all(samples.unit == "nT" for samples in log.sensors)


@pytest.mark.recordings
def test_a_unit_given_for_a_format_that_fixes_it_is_mentioned(recordings):
    path = recordings / "vehicle/px4/sample.ulg"
    np.testing.assert_array_equal(read(path, unit="mG").field, read(path).field)
    assert "given unit mG is not used" in open_log(path, unit="mG").notes[-1]


def test_names_that_differ_in_case_alone_get_files_of_their_own(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{i},{name},{i},20,43" for i in range(30) for name in ("MAG", "mag", "Mag")]
    path.write_text("\n".join(["time_s,sensor,mag_x_uT,mag_y_uT,mag_z_uT", *rows]))
    names = [sensor.name for sensor in open_log(path).sensors]
    assert names == ["MAG", "mag #2", "Mag #3"]
    assert len({file_stem(name).lower() for name in names}) == 3
