"""The record of a swing: what is understood, what is refused, and the form."""

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.headings.files.swing import make_form, read_swing

ROSE = np.arange(0, 360, 45.0)


def written(folder: Path, text: str) -> Path:
    path = folder / "swing.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_handwritten_swing_with_points_and_sides(tmp_path) -> None:
    text = (
        "# power state: engine on, radar on\n# Current_A: 12 A\n\n"
        "Compass, Deviation\nN,10.5 E\nnne,W 1.2°\n180°,-3\n270.5,2\n"
    )
    swing = read_swing(written(tmp_path, text))
    assert swing.compass_deg.tolist() == [0.0, 22.5, 180.0, 270.5]
    assert (swing.reference_deg - swing.compass_deg) == pytest.approx([10.5, -1.2, -3.0, 2.0])
    assert swing.reference == "magnetic"
    assert swing.remarks["power_state"] == "engine on, radar on"
    assert swing.number("current_A") == 12.0
    assert swing.source.count == 4


@pytest.mark.parametrize(
    ("remark", "degrees"),
    [("declination: 4W", -4.0), ("Declination_deg: 2,5° E", 2.5), ("declination_deg: -3.1", -3.1)],
)
def test_a_declination_has_a_side_or_a_sign(tmp_path, remark, degrees) -> None:
    swing = read_swing(written(tmp_path, f"# {remark}\ncompass,true\n1,2\n"))
    assert swing.number("declination_deg") == degrees


def test_a_declination_that_is_no_angle(tmp_path) -> None:
    swing = read_swing(written(tmp_path, "# declination: west\ncompass,true\n1,2\n"))
    with pytest.raises(LogError, match=r"'west'; write a number, or 4\.5E"):
        swing.number("declination_deg")


@pytest.mark.parametrize(
    ("header", "reference"),
    [
        ("compass_deg,magnetic_deg", "magnetic"),
        ("Compass heading (deg),Reference", "magnetic"),
        ("compass,true_deg", "true"),
        ("COMPASS,heading_deg", "true"),
    ],
)
def test_names_of_columns(tmp_path, header, reference) -> None:
    assert read_swing(written(tmp_path, f"{header}\n10,12\n")).reference == reference


def test_semicolons_and_decimal_commas(tmp_path) -> None:
    swing = read_swing(written(tmp_path, "compass;magnetic;heel\n10,5;12,25;P 5\n20;21;5\n"))
    assert swing.reference_deg.tolist() == [12.25, 21.0]
    assert swing.heel.tolist() == [-5.0, 5.0]


def test_roll_and_pitch_are_heel(tmp_path) -> None:
    swing = read_swing(written(tmp_path, "compass,magnetic,roll,pitch\n1,2,3,4\n5,6,7,8\n"))
    assert swing.heel.tolist() == [[3.0, 4.0], [7.0, 8.0]]


def test_a_form_is_read_back_as_it_was_filled_in(tmp_path) -> None:
    path = written(tmp_path, make_form(ROSE))
    with pytest.raises(LogError, match="fill in the form"):
        read_swing(path)
    lines = path.read_text().splitlines()
    filled = [
        line + f"{k}" if line in ("0,", "45,", "90,") else line for k, line in enumerate(lines)
    ]
    path.write_text("\n".join(filled).replace("(what is switched on)", "motors at hover"))
    swing = read_swing(path)
    assert swing.compass_deg.tolist() == [0.0, 45.0, 90.0]
    assert swing.blank == 5
    assert dict(swing.remarks) == {"power_state": "motors at hover"}


def test_a_form_with_heel_keeps_the_tilt(tmp_path) -> None:
    path = written(tmp_path, make_form([0.0, 0.0], roll_deg=[-10.0, 10.0]))
    path.write_text(path.read_text().replace("0,-10,", "0,-10,3").replace("0,10,", "0,10,4"))
    assert read_swing(path).heel.tolist() == [-10.0, 10.0]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a header and a row"),
        ("compass,magnetic\n", "a header and a row"),
        ("a,b\n1,2\n", "needs compass_deg and one of"),
        ("compass,roll\n1,2\n", "needs compass_deg and one of"),
        ("compass,magnetic,reference\n1,2,3\n", "two columns could be the magnetic"),
        (
            "compass,magnetic,deviation\n1,2,1\n",
            "magnetic and deviation hold the same quantity twice",
        ),
        ("compass,true,magnetic\n1,2,1\n", "magnetic and true hold the same quantity twice"),
        ("compass,magnetic\n1,2\n2O,3\n", "row 3: '2O' is not a compass in degrees"),
        ("compass,deviation\n1,2X\n", "row 2: '2X' is not a deviation"),
        ("compass,deviation\n1,-2W\n", "row 2: '-2W' is not a deviation"),
        ("# current_A: some\ncompass,magnetic\n1,2\n", "current_A is 'some'"),
    ],
)
def test_what_cannot_be_understood_is_told_with_its_row(tmp_path, text, says) -> None:
    with pytest.raises(LogError, match=says):
        read_swing(written(tmp_path, text)).number("current_A")


def test_a_file_that_is_missing_or_no_text(tmp_path) -> None:
    with pytest.raises(LogError, match="there is no such file"):
        read_swing(tmp_path / "no.csv")
    path = tmp_path / "log.bin"
    path.write_bytes(b"\xa3\x95\x80\xff" * 20)
    with pytest.raises(LogError, match="this is not text"):
        read_swing(path)


def test_an_open_quote_and_ragged_rows_are_one_line(tmp_path) -> None:
    with pytest.raises(LogError, match="row 2") as told:
        read_swing(written(tmp_path, 'compass,deviation\nN,"10.5E and\n135,1.2 W\n'))
    assert "\n" not in str(told.value)
