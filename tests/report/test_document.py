"""A document says the same on a page, as text and to programs."""

import numpy as np
import pytest

from agonic.health import Finding, sentences
from agonic.report.document import Document
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table
from agonic.report.text import WIDTH

DOUBT = Finding("linear", "check", "the constant depends on the current", "use lower currents")


def drawn() -> Markup:
    return element("svg", class_="drawn")


def unwanted() -> Markup:
    raise AssertionError("figures are drawn for pages only")


def made(verdict: str = "check", **more) -> Document:
    """A document with a bit of everything."""
    return Document(
        kind="Axis of a coil",
        name="coil <7>",
        method="4 reversals",
        verdict=verdict,
        status="It is -3 nT off.",
        findings=[DOUBT],
        remarks=["the log has no date"],
        key_figures=[("Noise", "12 nT", "one reading")],
        entries={"Constant": "76 nT/A", "Condition": "3"},
        values={"n": 4, "constant_nT_A": np.array([76.0])},
        **more,
    )


def test_text_has_verdict_status_and_entries_under_each_other() -> None:
    assert made().to_text().splitlines() == [
        "! coil <7>: check (4 reversals)",
        "  It is −3 nT off.",
        "  Constant   76 nT/A",
        "  Condition  3",
        "  Note      the log has no date",
    ]


def test_a_refused_result_shows_no_numbers() -> None:
    refused = made("refused")
    assert "76" not in refused.to_text()
    page = refused.to_html()
    assert "76 nT/A" not in page
    assert "key-figures" not in page.split("</style>")[1]
    assert "constant depends" in page


def test_the_page_escapes_names_and_says_what_to_do() -> None:
    page = made().to_html()
    assert page.count("coil &lt;7&gt;") == 2
    assert "Use lower currents." in page
    assert "What was found" in page
    assert "What was found" not in made(entries_title="").to_html()


def test_only_printed_sections_are_in_the_text_and_nothing_is_drawn_for_it() -> None:
    table = Table(["Step", "nT"], [["1", "12.5"], ["10", "9.1"]])
    shown = made(
        sections=[
            Section("Steps", ["Each at rest.", {"All": "2"}, table, unwanted], printed=True),
            Section("Figures", [unwanted]),
        ]
    )
    lines = shown.to_text().splitlines()
    assert lines[4:] == [
        "",
        "Steps",
        "  Each at rest.",
        "  All  2",
        "  Step    nT",
        "     1  12.5",
        "    10   9.1",
        "  Note      the log has no date",
    ]


def test_a_page_draws_what_a_section_holds() -> None:
    table = Table(["Step", "nT"], [["1", "12.5"]], scrolls=True)
    blocks = [drawn, lambda: [drawn(), drawn()], table, drawn(), "at -3 nT"]
    page = made(sections=[Section("Figures", blocks), Section("", [drawn])]).to_html()
    assert page.count('class="drawn"') == 5
    assert '<div class="scroll"><table class="numbers">' in page
    assert "<p>at −3 nT</p>" in page
    assert "<h2></h2>" not in page


def test_a_record_has_verdict_and_findings_unless_the_wing_says_otherwise() -> None:
    record = made().to_record()
    assert list(record) == ["verdict", "status", "findings", "n", "constant_nT_A"]
    assert record["findings"][0]["name"] == "linear"
    assert Document(name="plan", status="6 steps", values={"n": 6}).to_record() == {"n": 6}
    assert Document(name="x", verdict="good", values={"findings": 0}).to_record()["findings"] == 0


def test_without_a_verdict_the_status_comes_first() -> None:
    plan = Document(kind="Plan", name="six steps", status="6 steps to ±1 nT", entries={"n": "6"})
    assert plan.to_text() == "6 steps to ±1 nT\n  n  6"
    assert '<p class="kicker">6 steps to ±1 nT</p>' in plan.to_html()
    assert plan.good
    assert "Findings" not in plan.to_html()


def test_documents_of_sensors_stand_in_that_of_all() -> None:
    own = made(data={"sensor-1-data": lambda: {"x": 1}}, sections=[Section("More", ["text"])])
    both = Document(name="log", kind="Sensors", sensors=[own, made("good")])
    page = both.to_html()
    assert 'id="sensor-2" aria-labelledby="sensor-2-name"' in page
    assert 'data-source="sensor-1-data"' in page
    assert "<h3>More</h3>" in page
    assert [one["verdict"] for one in both.to_record()["sensors"]] == ["check", "good"]
    assert both.to_text().startswith("! coil <7>: check")
    assert "\n\n✓ coil <7>: good" in both.to_text()


@pytest.mark.parametrize("words", ["turn " * 60, "x" * 300])
def test_lines_are_as_wide_as_a_terminal(words: str) -> None:
    lines = Document(name="a", verdict="good", status=words, entries={"Long": words}).to_text()
    longest = max(map(len, lines.splitlines()))
    assert longest <= WIDTH or " " not in words


def test_control_characters_stay_out_of_the_terminal() -> None:
    said = Document(name="\x1b[31m", verdict="good", status="\x1b[2J", method="\x07").to_text()
    assert said.isprintable() or set(said) - set("\n") == {c for c in said if c.isprintable()}


def test_of_a_refused_result_the_text_says_why_and_no_numbers() -> None:
    coil = Document(
        name="coil",
        verdict="refused",
        status="Too few. " * 40,
        entries={"Constant": "76 nT/A"},
        key_figures=[("Noise", "12 nT", "one reading")],
        refused_numbers=True,
    )
    assert " ".join(coil.to_text().split()) == "✗ coil: refused " + " ".join(["Too few."] * 40)
    assert "12 nT" in coil.to_html()


def test_each_finding_is_a_line_the_gravest_first_with_what_helps() -> None:
    found = (
        Finding("outliers", "note", "3 readings do not fit"),
        Finding("noise", "check", "it is noisy", "move it away"),
        Finding("static", "refuse", "it did not turn", "turn it"),
    )
    status = sentences(*(finding.sentence for finding in found), "noise 12 nT")
    made = Document(name="mag", verdict="check", status=status, findings=found)
    assert made.to_text().splitlines() == [
        "! mag: check",
        "  Refused   It did not turn; turn it.",
        "  Check     It is noisy; move it away.",
        "  Note      3 readings do not fit.",
        "  Noise 12 nT.",
    ]
    assert made.to_text(brief=True).splitlines()[-2:] == [
        "  Check     It is noisy; move it away.",
        "  Noise 12 nT.",
    ]


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_text_fits_every_width_whole(width: int) -> None:
    words = "the directions that were visited leave the heading uncertain " * 4
    table = Table(["sensor", "bias x, nT", "bias y, nT", "noise, nT"], [["MAG", "1", "2", "3"]])
    made = Document(
        name="MAG " * 20,
        verdict="check",
        status=words,
        entries={"Bias": words},
        sections=[Section("Numbers", [table], printed=True)],
        remarks=[words],
        next_step="agonic calibrate a/folder/with/a/name.bin --between 14.8,57.1 -o out",
    )
    lines = made.to_text(width).splitlines()
    assert all(len(line) <= width for line in lines)
    plain = " ".join(line.removesuffix(" \\").strip() for line in lines)
    plain = " ".join(plain.split())
    assert plain.count(words.strip()) == 3
    assert "--between 14.8,57.1 -o out" in plain
    assert "…" not in plain


def test_what_several_sensors_are_told_is_told_once() -> None:
    sensors = [
        Document(name=n, verdict="good", remarks=[f"{n}.h: no term", f"{n} alone"]) for n in "ab"
    ]
    lines = Document(name="log", sensors=sensors).to_text().splitlines()
    assert lines.count("Note      a.h, b.h: no term") == 1
    assert sum("no term" in line for line in lines) == 1
    assert "  Note      a alone" in lines


def test_values_may_say_the_verdict_in_a_place_of_their_own() -> None:
    made = Document(name="coil", verdict="good", values={"sensor": "coil", "verdict": "good"})
    assert list(made.to_record()) == ["sensor", "verdict"]


def test_without_a_verdict_that_of_every_sensor_decides() -> None:
    good, bad = (Document(name=word, verdict=word) for word in ("good", "check"))
    assert Document(name="log", sensors=[good]).good
    assert not Document(name="log", sensors=[good, bad]).good
