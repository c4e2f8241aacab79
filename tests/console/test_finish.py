"""How commands end: files, what is said, exit status."""

import dataclasses
import json
from pathlib import Path

import pytest

from agonic.calibration.affine import Affine
from agonic.console.finish import finish, require_table
from agonic.errors import AgonicError
from agonic.report.document import Document

GOOD = Document(schema="agonic/a@1", kind="A", name="coil", verdict="good", values={"n": 3})
KNOWN = Affine(bias=[0, 0, 0], matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
DOUBTED = Document(schema="agonic/a@1", name="coil", verdict="check", values={})


def test_the_status_follows_from_the_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    assert finish(GOOD) == 0
    assert finish(DOUBTED) == 1
    assert capsys.readouterr().out == "✓ coil: good\n! coil: check\n"


def test_programs_get_one_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.HTML"
    assert finish(GOOD, files=["a.json"], report=page, as_json=True) == 0
    said = json.loads(capsys.readouterr().out)
    assert list(said) == ["schema", "verdict", "n", "files"]
    assert said["files"] == ["a.json", str(page)]
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_people_are_told_what_was_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finish(GOOD, report=tmp_path / "a.txt")
    assert capsys.readouterr().out == f"✓ coil: good\n\nWritten   {tmp_path / 'a.txt'}\n"
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "✓ coil: good\n"
    finish(dataclasses.replace(GOOD, calibration=KNOWN))
    assert capsys.readouterr().out.endswith("\nNothing was written.\n")


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        AgonicError,
        match=r"-o .*a\.pdf is not a type written here; name it .html or .txt",
    ):
        finish(GOOD, report=tmp_path / "a.pdf", option="-o")


def test_a_table_is_not_given_the_name_of_a_page(tmp_path: Path) -> None:
    require_table(tmp_path / "out.csv")
    with pytest.raises(AgonicError, match=r"a text table; name it \.csv"):
        require_table(tmp_path / "out.html")


def test_a_plan_is_a_form_or_a_page_by_its_name(tmp_path: Path) -> None:
    finish(GOOD, report=tmp_path / "a.csv", option="-o", forms={".csv": lambda: "compass_deg\n"})
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "compass_deg\n"
    finish(GOOD, report=tmp_path / "a.html", option="-o", forms={".csv": lambda: ""})
    assert (tmp_path / "a.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_calibration_is_saved_unless_it_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = dataclasses.replace(GOOD, calibration=KNOWN)
    finish(made, out=tmp_path / "a.json", files=["b.csv"], as_json=True)
    said = json.loads(capsys.readouterr().out)
    assert said["files"] == [str(tmp_path / "a.json"), "b.csv"]
    assert (tmp_path / "a.json").exists()
    finish(dataclasses.replace(made, verdict="refused"), out=tmp_path / "no.json")
    assert not (tmp_path / "no.json").exists()


def test_a_folder_gets_the_calibration_and_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "results" / "coil"
    finish(dataclasses.replace(GOOD, calibration=KNOWN), out=folder)
    assert sorted(file.name for file in folder.iterdir()) == ["coil.json", "report.html"]
    assert "coil.json" in capsys.readouterr().out
    finish(dataclasses.replace(GOOD, verdict="refused", calibration=KNOWN), out=tmp_path / "none")
    assert [file.name for file in (tmp_path / "none").iterdir()] == ["report.html"]
