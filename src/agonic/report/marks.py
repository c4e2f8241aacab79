"""Marks of a figure: curves, areas, dots, lines and bars, where they lie in the units of its axes.

What is drawn is said once, as data: `figure` makes SVG of it for pages, `display.plots` a figure of
Matplotlib. A mark has the class that colours it in the style sheets and its words in the legend.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.report.axes import Columns


class Mark(NamedTuple):
    """What is drawn: its kind, its classes in the style sheets, of which the last is that of its
    key, its words in the legend ("" where it needs none), and where it lies. A NaN is a gap; what
    lies nowhere is left out, and its words too."""

    kind: str
    name: str
    words: str
    at: tuple[Array, ...]

    @property
    def seen(self) -> bool:
        """Whether there is anything to draw."""
        return self.kind == "histogram" or bool(np.isfinite(np.sum(self.at, axis=0)).any())


def _mark(kind: str, name: str, *at: ArrayLike, words: str = "") -> Mark:
    return Mark(kind, name, words, tuple(np.atleast_1d(np.asarray(a, np.float64)) for a in at))


# by name, then where it lies: across, and one value or two
curve = partial(_mark, "curve")
area = partial(_mark, "area")
dots = partial(_mark, "dots")
whiskers = partial(_mark, "whiskers")
level = partial(_mark, "level")  # across the whole figure: values
upright = partial(_mark, "upright")  # over the whole height: places
span = partial(_mark, "span")  # the same from place to place
bars = partial(_mark, "bars")  # from place to place, and from value to value
histogram = partial(_mark, "histogram")  # counts, and their edges


def line(columns: Columns, values: Array, name: str = "mean", words: str = "mean") -> Mark:
    """A line through one value a column, broken where there are no readings or a NaN stands."""
    return curve(name, columns.across, columns.break_up(values), words=words)


def mean(columns: Columns, values: Array, name: str = "mean", words: str = "mean") -> Mark:
    """The mean of each column."""
    return line(columns, columns.mean(values), name, words)


def band(columns: Columns, low: Array, high: Array, name: str = "band", words: str = "") -> Mark:
    """A band between two values a column."""
    low, high = columns.break_up(low), columns.break_up(high)
    return area(name, columns.across, low, high, words=words)


def spread(
    columns: Columns, values: Array, name: str = "range", words: str = "least to largest"
) -> Mark:
    """A band from the least to the largest value of each column; arrows say where that lies beyond
    the axis."""
    drawn = band(columns, columns.least(values), columns.largest(values), name, words)
    return drawn._replace(kind="spread")


def residuals(columns: Columns, values: Array) -> list[Mark]:
    """Least to largest, the middle two thirds where there are enough readings, and the median."""
    low, middle, high = columns.percentiles(values, (16.0, 50.0, 84.0))
    enough = len(values) >= 5 * columns.most  # for the middle two thirds to mean something
    return [
        spread(columns, values),
        *([band(columns, low, high, "middle", "the middle two thirds")] if enough else []),
        level("zero", 0.0),
        line(columns, middle, words="median"),
    ]


def foot(columns: Columns, rows: Mask, name: str, words: str = "") -> Mark:
    """A bar along the foot under the columns that consist mostly of these rows."""
    inside = columns.mean(rows.astype(np.float64)) > 0.5
    first, last = columns.edges()
    return _mark("foot", name, first[inside], last[inside], words=words)
