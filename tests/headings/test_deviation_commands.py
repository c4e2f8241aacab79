"""`agonic plan swing` and `agonic fit deviation` as a person or a script would run them."""

import math
from pathlib import Path

import pytest

import agonic as ag
from agonic.cli import run
from tests.command_line import answer, complaint

HANDBOOK = """# power state: engine on, radar on
# current_A: 12
# compass: steering compass
# date: 2026-05-01
compass,deviation
N,10.5E
NE,20.0E
E,11.5E
SE,1.2W
S,5.5W
SW,8.0W
W,12.5W
NW,6.8W
"""


@pytest.fixture(autouse=True)
def swing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("swing.csv").write_text(HANDBOOK)
    return "swing.csv"


def test_the_handbook_from_a_file_to_a_card(capsys) -> None:
    status, said = answer(
        capsys, "fit", "deviation", "swing.csv", "-o", "cal.json", "--card", "card.html"
    )
    assert status == 0
    assert said["schema"] == "agonic/fit-deviation@1"
    assert said["verdict"] == "good"
    expected = {"A": 1.0, "B": 11.9397, "C": 7.9598, "D": 5.0, "E": 1.5}
    assert said["coefficients"] == pytest.approx(expected, abs=1e-4)
    assert said["classical"] == pytest.approx({"A": 1, "B": 12, "C": 8, "D": 5, "E": 1.5})
    assert said["residual_rms_deg"] == pytest.approx(0.051, abs=5e-4)
    assert said["files"] == ["card.html", "cal.json"]
    card = ag.load("cal.json")
    assert (card.power_state, card.current_A, card.sensor) == (
        "engine on, radar on",
        12.0,
        "steering compass",
    )
    page = Path("card.html").read_text()
    assert "engine on, radar on, 12 A" in page
    assert "352.5°" in page


def test_the_text_is_the_card(capsys) -> None:
    assert run(["fit", "deviation", "swing.csv", "--step", "45"]) == 0
    said = capsys.readouterr().out
    assert "Valid only with  engine on, radar on, 12 A" in said
    assert "20.1° E" in said
    assert "beyond 5°, the limit of a compass in service" in " ".join(said.split())
    assert max(map(len, said.splitlines())) <= 76


@pytest.mark.parametrize("name", ["card.txt", "card.svg"])
def test_the_name_of_the_card_chooses_its_form(name) -> None:
    assert run(["fit", "deviation", "swing.csv", "--card", name]) == 0
    start = {"card.txt": "DEVIATION CARD", "card.svg": "<svg xmlns="}[name]
    assert Path(name).read_text().startswith(start)


def test_three_headings_are_refused_and_nothing_is_written(capsys) -> None:
    Path("three.csv").write_text("\n".join(HANDBOOK.splitlines()[:8]))
    status, said = answer(capsys, "fit", "deviation", "three.csv", "-o", "cal.json")
    assert status == 1
    assert said["verdict"] == "refused"
    assert "steer also 135° SE, 180° S" in said["status"]
    assert said["files"] == []
    assert not Path("cal.json").exists()


def test_true_headings(capsys) -> None:
    Path("true.csv").write_text(
        "compass,true\n" + "".join(f"{h},{h + 5}\n" for h in range(0, 360, 30))
    )
    assert "give --declination" in complaint(capsys, "fit", "deviation", "true.csv")
    _, said = answer(capsys, "fit", "deviation", "true.csv", "--declination", "-2.5")
    assert said["coefficients"]["A"] == pytest.approx(7.5, abs=1e-6)
    assert said["power_state"] == ""
    text = complaint(capsys, "fit", "deviation", "swing.csv", "--declination", "1")
    assert "magnetic heading already" in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["swing.csv", "--card", "card.pdf"], "name it .html, .svg or .txt"),
        (["swing.csv", "--terms", "AXE"], "use some of ABCDE"),
        (["swing.csv", "--step", "7"], "steps of 7°"),
        (["swing.csv", "--heel"], "no column roll_deg"),
        (["swing.csv", "--card", "card.html", "--paper", "A3"], "A4, A5"),
        (["swing.csv", "--noise-deg", "0"], "> 0"),
        (["none.csv"], "there is no such file"),
    ],
)
def test_bad_input_is_one_line(capsys, arguments, says) -> None:
    assert says in complaint(capsys, "fit", "deviation", *arguments)


def test_a_planned_swing_is_filled_in_and_fitted(capsys) -> None:
    status, plan = answer(
        capsys, "plan", "swing", "--heel", "10", "--noise-deg", "0.5", "-o", "form.csv"
    )
    assert status == 0
    assert plan["schema"] == "agonic/plan-swing@1"
    assert len(plan["compass_deg"]) == len(plan["roll_deg"]) == 16
    assert plan["sd"]["A"] == pytest.approx(0.5 / 4)
    filled, lines = [], Path("form.csv").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line[0].isdigit())
    assert lines[first:][16:] == lines[first:][:2]  # the first heading, to either side
    for line in lines:
        if line[0].isdigit() and len(filled) < first + 16:  # not the return at the end
            compass, roll = (float(cell) for cell in line.split(",")[:2])
            line += str(compass + 2 - 0.07 * roll * math.cos(math.radians(compass)))
        filled.append(line)
    Path("form.csv").write_text("\n".join(filled))
    stated = ("--noise-deg", "0.5", "--drift-deg", "0")
    _, said = answer(capsys, "fit", "deviation", "form.csv", *stated)
    assert said["coefficients"]["A"] == pytest.approx(2.0, abs=1e-3)
    assert said["coefficients"]["roll_cos"] == pytest.approx(-0.07, abs=1e-4)
    assert said["sd"] == pytest.approx(plan["sd"], rel=1e-3)


def test_the_plan_in_words(capsys) -> None:
    assert run(["plan", "swing", "--rounds", "2"]) == 0
    said = capsys.readouterr().out
    assert "  9  315° NW" in said
    assert "heading 0.559°" in " ".join(said.split())
    assert "need 6 headings" in complaint(capsys, "plan", "swing", "--headings", "3")


def test_a_card_corrects_no_readings(capsys) -> None:
    run(["fit", "deviation", "swing.csv", "-o", "cal.json"])
    assert "corrects headings" in complaint(capsys, "export", "cal.json", "--to", "c")


def test_the_sources_of_a_card(capsys) -> None:
    run(["fit", "deviation", "swing.csv", "-o", "cal.json"])
    capsys.readouterr()
    assert run(["cite", "cal.json"]) == 0
    assert "Handbook of Magnetic Compass Adjustment" in capsys.readouterr().out
