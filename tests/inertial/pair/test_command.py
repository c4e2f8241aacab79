"""`agonic fit pair` and `agonic simulate shots`, as they are typed."""

from pathlib import Path

import pytest

import agonic as ag
from tests.command_line import answer, complaint

pytestmark = pytest.mark.usefixtures("empty_folder")


def test_from_shots_to_a_setup_to_headings(capsys) -> None:
    status, made = answer(capsys, "simulate", "shots", "-o", "shots.csv", "--bad", "1")
    assert status == 0
    words = ("fit", "pair", "shots.csv", "-o", "setup.toml", "--report", "r.html")
    status, found = answer(capsys, *words, "--at", "52.1,5.2", "--date", "2026-05-01")
    assert (status, found["schema"], found["verdict"]) == (0, "agonic/fit-pair@1", "good")
    assert found["left_out"] == made["bad"]
    assert found["files"] == ["setup.toml", "r.html"]
    assert len(found["residuals"]) == found["n"] == 24
    assert "left out" in Path("r.html").read_text(encoding="utf-8")
    setup = ag.load_setup("setup.toml")
    assert setup.tilt == "accelerometer"
    assert setup.declination_deg == pytest.approx(2.4, abs=1)
    later = ("simulate", "shots", "-o", "later.csv", "--targets", "0", "--survey", "1")
    assert answer(capsys, *later)[0] == 0
    status, checked = answer(capsys, "fit", "pair", "later.csv", "--check", "setup.toml")
    assert (status, checked["schema"], checked["verdict"]) == (0, "agonic/check-pair@1", "good")
    assert answer(capsys, "heading", "setup.toml", "later.csv", "-o", "h.csv")[0] == 0
    export = ("export", "setup.toml", "--to", "c", "-o", "firmware")
    assert answer(capsys, *export)[0] == 0
    assert "force_bias" in Path("firmware/compass.c").read_text(encoding="utf-8")


def test_what_is_asked_for_wrongly_says_so(capsys) -> None:
    answer(capsys, "simulate", "shots", "-o", "shots.csv", "--attitudes", "6", "--targets", "0")
    assert "12 are needed" in complaint(capsys, "fit", "pair", "shots.csv")
    assert "name it .toml" in complaint(capsys, "fit", "pair", "shots.csv", "-o", "cal.json")
    said = complaint(capsys, "fit", "pair", "shots.csv", "--check", "a.toml", "-o", "b.toml")
    assert "leave -o out" in said
