"""Five people's first minutes, each from an empty folder: what they type, see and are left with."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.console import progress
from tests.first_use.walk import (
    FIRST_SCREEN,
    Person,
    write_counts,
    write_flight,
    write_level_rover,
)

pytestmark = pytest.mark.usefixtures("empty_folder")


@pytest.fixture
def person(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Person:
    monkeypatch.delenv("COLUMNS", raising=False)  # as wide as where there is no terminal
    return Person(capsys)


def test_whoever_looks_first_sees_truth_beside_estimate(person: Person) -> None:
    shown = person.types("agonic demo")
    assert shown.status == 0
    assert "truth found" in shown.text
    assert "heading error: as recorded" in shown.text
    assert {Path(file).suffix for file in shown.files} == {".html", ".json", ".h", ".toml", ".csv"}


def test_the_builder_of_a_drone_with_three_compasses(person: Person) -> None:
    """One row a compass, which file to load, and headings by the next command."""
    write_flight("flight.bin")
    shown = person.types("agonic calibrate flight.bin")
    assert shown.status in (0, 1)
    for compass in ("MAG[0]", "MAG[1]", "MAG[2]"):
        assert any(f" {compass}: " in line and "heading good to" in line for line in shown.lines)
    assert "Load compass.param (MAG[0], MAG[1], MAG[2])" in shown.text
    assert "flight.bin-agonic/compass.param" in shown.files
    headings = person.goes_on(shown)
    assert "headings.csv" in headings.files
    exported = person.types("agonic export flight.bin-agonic/setup.toml --to ardupilot -o o.param")
    assert exported.status == 0
    assert "COMPASS_OFS3_X" in Path("o.param").read_text()


def test_the_maker_with_three_columns_of_counts(person: Person) -> None:
    """Counts need no unit: the header turns counts into counts."""
    write_counts("xyz.csv")
    shown = person.types("agonic calibrate xyz.csv")
    assert shown.status == 0
    assert "--unit" not in shown.text
    assert "mag.h for firmware" in shown.text
    assert "[counts]" in Path("xyz.csv-agonic/mag.h").read_text()
    assert "corrected.csv" in person.goes_on(shown).files
    known = person.types("agonic calibrate xyz.csv --field 50000 -o known")
    assert known.status == 0
    packet = person.types("agonic export known/mag.json --to motioncal")
    assert packet.status == 0
    assert Path("known/mag.bin").stat().st_size == 68


def test_the_team_of_a_cubesat(person: Person) -> None:
    made = person.types("agonic simulate orbit -n 6000 -o day.csv")
    fitted = person.goes_on(made)
    assert "now.json" in fitted.files
    alone = person.types("agonic calibrate day.csv")
    assert person.goes_on(alone).status in (0, 1)


def test_the_team_of_a_cubesat_in_a_chamber(person: Person) -> None:
    """A plan, recordings of five boards and their calibrations are a screen each."""
    boards = "--sensors 2xMMC5883MA,3xMPU-9255"
    planned = person.types(f"agonic plan thermal {boards} -o plan.html --folder chamber")
    assert planned.files == {"plan.html", "chamber/campaign.toml"}
    made = person.types(f"agonic simulate campaign {boards} --rate 0.02 -o camp")
    fitted = person.goes_on(made)
    assert fitted.text.count(": good, ready to use") == 5
    assert {Path(file).suffix for file in fitted.files} == {".json", ".html"}


def test_the_owner_of_a_rover(person: Person) -> None:
    """With accelerometer and gyro it is calibrated level; without, a page says what helps."""
    calibrated = person.goes_on(person.types("agonic simulate rover -o rover.csv -n 3000"))
    assert calibrated.status == 0
    assert person.goes_on(calibrated).files == {"headings.csv"}
    write_level_rover("cart.csv")
    refused = person.types("agonic calibrate cart.csv")
    assert refused.status == 1
    assert refused.following == ""
    page = refused.text.split("what cannot be tilted: ")[1].split()[0].rstrip(".")
    assert (Path(__file__).parents[2] / page).is_file()


SCRIPT = """
import agonic as ag

fit = ag.fit_ellipsoid("log.csv", 50_000)
print(fit)
print(ag.verify(fit, "log.csv", 50_000))
print(ag.apply(fit, "log.csv"))
ag.save(fit, "mag.json")
print(ag.compare(fit, "mag.json").status)
"""


def test_who_uses_python(person: Person, capsys: pytest.CaptureFixture[str]) -> None:
    """Paths, fits and files are taken wherever samples and calibrations are."""
    person.types("agonic simulate hand -o log.csv -n 1500")
    Path("script.py").write_text(SCRIPT)
    capsys.readouterr()
    runpy.run_path("script.py")
    said = capsys.readouterr().out.splitlines()
    assert len(said) <= FIRST_SCREEN
    assert "no difference" in said[-1] or "chance" in said[-1]


def test_a_sensor_that_never_turned_is_told_to_turn_and_nothing_else(person: Person) -> None:
    rng = np.random.default_rng(1)
    still = np.array([20_000.0, 1000.0, 43_000.0]) + rng.normal(size=(900, 3))
    samples = ag.Samples(field=still, time=np.arange(900) / 10, roll_deg=still[:, 0] * 0,
                         pitch_deg=still[:, 0] * 0)  # fmt: skip
    ag.write_csv(samples, "small.csv")
    shown = person.types("agonic calibrate small.csv")
    assert shown.status == 1
    assert "turn it slowly about all three axes" in shown.text
    assert shown.following == ""
    assert "--at" not in shown.text


@pytest.mark.parametrize(
    "command",
    [
        "calibrate log.csv",
        "simulate tumble -o t.csv",
        "evaluate log.csv --field 50000",
        "plan thermal --sensors MPU-9255 -o plan.html",
    ],
)
def test_no_wait_is_silent(command: str, person: Person, monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes a while says so on a terminal, and how long it took."""
    person.types("agonic simulate hand -o log.csv -n 1500")
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    monkeypatch.setattr(progress, "SILENT_S", 0.0)
    monkeypatch.setattr(progress, "LONG_S", 0.0)
    shown = person.types(f"agonic {command}")
    assert "Calibrating" in shown.complaint or "working" in shown.complaint
    assert "took" in shown.complaint
