"""The figures of the scoreboard are those of the benchmark's table."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def scoreboard():
    pytest.importorskip("docutils")
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        import scoreboard
    finally:
        sys.path.pop(0)
    return scoreboard


def test_every_line_of_the_table_has_a_figure_with_its_numbers(scoreboard):
    scores = scoreboard.read_scores()
    assert len(scores) > 10
    assert len({score.recording for score in scores}) == len(scores)
    for score in scores:
        drawn = scoreboard.draw(score)
        assert {"as flown", "agonic"} <= set(score.figures)
        for cell in (*score.figures.values(), score.stated):
            assert cell in drawn


def test_longer_bars_are_larger_errors(scoreboard):
    figures = {"as flown": "8 %", "other": "failed", "agonic": "(0.5 %)"}
    score = scoreboard.Score("one", "known", "good", figures, "0.6 %")
    drawn = scoreboard.draw(score)
    widths = [float(part.split('"')[0]) for part in drawn.split('width="')[1:]]
    assert len(widths) == 2
    assert widths[0] > widths[1] > 0
    assert drawn.count('class="own"') == 1


def test_stated_errors_contain_the_found_ones(scoreboard):
    """On every real recording of the table that agonic does not refuse."""
    for score in scoreboard.read_scores():
        found = scoreboard.find_number(score.figures["agonic"])
        if not score.says.startswith("refused"):
            assert found < 1.5 * scoreboard.find_number(score.stated), score.recording
