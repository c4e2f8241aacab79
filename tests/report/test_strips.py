"""Strips of however many readings: nothing is lost, nothing is drawn where it is not."""

import re

import numpy as np
import pytest

from agonic.report.axes import Axis, Columns
from agonic.report.figure import beyond_words, draw, draw_arrows, robust_limit
from agonic.report.marks import line, spread

RNG = np.random.default_rng(5)


def places(drawn) -> list[tuple[str, float]]:
    """Sign and place, per cent of the width, of each arrow."""
    found = re.findall(r'<text x="([\d.]+)%" y="[^"]*">(.)</text>', "".join(drawn))
    return [(sign, float(x)) for x, sign in found]


@pytest.mark.parametrize("ordered", [True, False])
def test_columns_hold_what_lies_in_them(ordered: bool) -> None:
    along = RNG.uniform(0.0, 10.0, 3000)
    along = np.sort(along) if ordered else along
    values, weights = RNG.normal(size=3000), RNG.uniform(size=3000)
    columns = Columns(Axis("", 0.0, 10.0), along, most=37)
    inside = [np.flatnonzero((along * 3.7).astype(int) == k) for k in range(37)]
    assert columns.counts.tolist() == [len(rows) for rows in inside]
    for found, by in (
        (columns.least(values), np.min),
        (columns.largest(values), np.max),
        (columns.mean(values), np.mean),
        (columns.percentiles(values, [50.0])[0], np.median),
    ):
        assert found == pytest.approx([by(values[rows]) for rows in inside])
    weighted = [np.average(values[rows], weights=weights[rows]) for rows in inside]
    assert columns.mean(values, weights) == pytest.approx(weighted)
    assert columns.right == pytest.approx([100 * along[rows].mean() for rows in inside])


def test_a_gap_breaks_the_line() -> None:
    along = np.r_[np.linspace(0.0, 2.0, 500), np.linspace(8.0, 10.0, 500)]
    columns = Columns(Axis("", 0.0, 10.0), along, most=100)
    mark = line(columns, np.zeros(len(columns.places)))
    drawn = draw(mark, columns.x, Axis("", -1.0, 1.0))
    starts = [float(x) for x in re.findall(r"M([\d.]+) ", drawn)]
    assert len(starts) == 2
    assert starts[1] == pytest.approx(805, abs=10)


def test_a_column_in_which_nothing_counted_breaks_the_line() -> None:
    columns = Columns(Axis("", 0.0, 99.0), np.arange(100.0), most=20)
    weights = np.where((np.arange(100) >= 40) & (np.arange(100) < 60), 0.0, 1.0)
    means = columns.mean(np.ones(100), weights)
    assert np.isnan(means).sum() == 4
    drawn = draw(line(columns, means), columns.x, Axis("", -2.0, 2.0))
    assert str(drawn).count("M") == 2
    assert "nan" not in drawn


def test_few_readings_far_apart_are_still_one_line() -> None:
    columns = Columns(Axis("", 0.0, 7.0), np.arange(8.0), most=400)
    drawn = draw(line(columns, np.zeros(8)), columns.x, Axis("", -1.0, 1.0))
    assert str(drawn).count("M") == 1


def test_strays_do_not_set_the_scale_and_what_counted_is_inside() -> None:
    clean = RNG.normal(size=5000)
    strayed = np.r_[clean, np.full(300, 5e4)]
    assert robust_limit(clean, 1.0) == pytest.approx(1.1 * 2.81, rel=0.1)
    assert robust_limit(strayed, 1.0) < 10.0
    weights = np.r_[np.ones(5000), np.zeros(300)]
    assert robust_limit(strayed, 1.0, weights) == robust_limit(clean, 1.0)
    assert robust_limit(clean, 20.0) == 20.0


def test_arrows_stand_over_what_lies_beyond() -> None:
    values = RNG.uniform(-1.0, 1.0, 1000)
    values[200:215] = 50.0
    values[700] = -9.0
    columns = Columns(Axis("", 0.0, 999.0), np.arange(1000.0))
    mark = spread(columns, values)
    (up, at), (down, where) = places(draw_arrows(mark, columns.x, Axis("", -2.0, 2.0)))
    assert (up, down) == ("▲", "▼")
    assert at == pytest.approx(20.7, abs=0.5)
    assert where == pytest.approx(70.0, abs=0.5)
    assert draw_arrows(mark, columns.x, Axis("", -60.0, 60.0)) == []
    said = beyond_words(values, 2.0, "nT")
    assert said.startswith("16 readings lie beyond")
    assert "50.0" in said
    assert beyond_words(values, 60.0, "nT") == ""


def test_a_million_readings_make_a_small_drawing() -> None:
    values = RNG.normal(size=1_000_000)
    columns = Columns(Axis("", 0.0, 1e6), np.arange(1e6))
    drawn = draw(spread(columns, values), columns.x, Axis("", -6.0, 6.0))
    assert len(drawn) < 12_000
    heights = np.array(re.findall(r"[\d.]+ (\d+)", drawn), dtype=float)
    assert 500 - heights.min() == pytest.approx(500 / 6 * values.max(), abs=1)
