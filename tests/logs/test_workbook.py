"""Workbooks: the sheet with the magnetometer, moments as they are shown, what is made to harm."""

from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged
from tests.logs.test_fuzz import assert_read_or_refused
from tests.logs.workbook_writer import (
    DATE,
    HEAD,
    MAIN,
    MOMENT,
    TIME_OF_DAY,
    write_ods,
    write_xlsx,
)

N = 50
TIME = np.arange(N) * 0.5
FIELD = np.random.default_rng(3).normal(0.0, 30.0, (N, 3)).round(3)
ACC = np.tile([0.1, -0.2, 9.8], (N, 1))
DAY = 46145.34375  # 2026-05-03 08:15
HEADER = ["time (s)", "Mag X\n(µT)", "Mag Y (µT)", "Mag Z (µT)"]
TITLE = [["Chamber, 20 °C"], [], ["Operator", "Ann"]]


def rows(*columns):
    return [list(row) for row in zip(*columns, strict=True)]


def mag(times=None):
    return rows(times or TIME.tolist(), *FIELD.T.tolist())


def check(samples):
    np.testing.assert_allclose(samples.field, FIELD * 1e3)
    np.testing.assert_allclose(samples.time - samples.time[0], TIME, atol=2e-6)


@pytest.mark.parametrize("write", [write_xlsx, write_ods])
def test_the_sheet_with_the_magnetometer_is_read(tmp_path, write):
    path = tmp_path / "book"
    write(path, {"Notes": TITLE, "Run 1": [*TITLE, HEADER, *mag()]})
    log = open_log(path)
    assert [sensor.name for sensor in log.sensors] == ["mag"]
    assert log.notes[0] == "of 2 sheets, 'Run 1' with a magnetometer"
    check(log.sensors[0])


def test_moments_as_they_are_shown(tmp_path):
    """A style makes a moment of a number: whole, or a date and a time of day beside each other."""
    path = tmp_path / "book.xlsx"
    moments = [(DAY + t / 86400, MOMENT) for t in TIME]
    write_xlsx(path, {"A": [["time", *HEADER[1:]], *mag(moments)]})
    samples = read(path)
    check(samples)
    assert samples.epoch.isoformat() == "2026-05-03T08:15:00+00:00"
    apart = [[(int(DAY), DATE), ((DAY + t / 86400) % 1, TIME_OF_DAY), *b] for t, b in zip(
        TIME, FIELD.tolist(), strict=True)]  # fmt: skip
    write_xlsx(path, {"A": [["date", "time", *HEADER[1:]], *apart]})
    check(read(path))
    assert read(path).epoch == samples.epoch
    moments = [(DAY - 1462 + t / 86400, MOMENT) for t in TIME]
    write_xlsx(path, {"A": [["time", *HEADER[1:]], *mag(moments)]}, date1904=True)
    assert read(path).epoch == samples.epoch
    spans = [f"PT08H15M{t:06.3f}S" for t in TIME]
    check(read(write_ods(tmp_path / "book.ods", {"A": [["time", *HEADER[1:]], *mag(spans)]})))


def test_a_sheet_for_each_sensor_and_for_each_run(tmp_path):
    """As phones export: other sensors stand beside; two with a magnetometer are two."""
    header = ["time_s", "x", "y", "z"]
    path = tmp_path / "phone.xlsx"
    acc = [header, *rows(TIME.tolist(), *ACC.T.tolist())]
    write_xlsx(path, {"Accelerometer": acc, "Magnetometer": [header, *mag()]})
    samples = read(path, unit="uT")
    check(samples)
    np.testing.assert_allclose(samples.acceleration, ACC)
    write_xlsx(path, {"left": [HEADER, *mag()], "right": [HEADER, *mag()[:20]]})
    log = open_log(path)
    assert [(s.name, len(s)) for s in log.sensors] == [("left", N), ("right", 20)]


def test_gaps_errors_and_texts_in_cells(tmp_path):
    table = mag()
    table[3][1], table[5][2] = None, "n/a"
    samples = read(write_xlsx(tmp_path / "book.xlsx", {"A": [HEADER, *table]}))
    assert len(samples) == N - 2


def replace_member(path, member, content):
    with ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()} | {member: content}
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)


@pytest.mark.slow
def test_what_is_made_to_harm_is_refused(tmp_path):
    path = write_xlsx(tmp_path / "book.xlsx", {"A": [HEADER, *mag()]})
    entities = '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    sheet = "xl/worksheets/sheet1.xml"
    replace_member(path, sheet, f"{HEAD}{entities}<worksheet>&x;</worksheet>")
    with pytest.raises(LogError, match="no sheet in it holds a table") as refused:
        read(path)
    assert "root:" not in str(refused.value)
    far = f'<worksheet xmlns="{MAIN}"><sheetData><row><c r="ZZZZZZ1"><v>1</v></c></row></sheetData>'
    replace_member(path, sheet, f"{far}</worksheet>")
    with pytest.raises(LogError, match="no sheet in it holds a table"):
        read(path)
    last = f'<worksheet xmlns="{MAIN}"><sheetData><row><c r="XFD1048576"><v>1</v></c></row>'
    replace_member(path, sheet, f"{last}</sheetData></worksheet>")
    with pytest.raises(LogError, match=r"memory|no sheet in it holds a table"):
        read(path)
    write_xlsx(path, {"Contents": TITLE})
    with pytest.raises(LogError, match=r"no (sheet|magnetometer)"):
        read(path)


def test_damage_is_one_line(tmp_path):
    path = write_xlsx(tmp_path / "book.xlsx", {"A": [HEADER, *mag()]})
    data, rng = np.frombuffer(path.read_bytes(), np.uint8), np.random.default_rng(1)
    for _ in range(60):
        path.write_bytes(damaged(data, rng).tobytes())
        assert_read_or_refused(path)
