"""The directive `scoreboard`: benchmarks/results/real.md, a figure for each recording.

The figures are drawn from the table when the page is built, so neither can be out of date.
"""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

TABLE = Path(__file__).parents[2] / "benchmarks" / "results" / "real.md"
NOT_FITS = ("recording", "known", "agonic says", "stated")
WIDE, ROW, LEFT, RIGHT = 720, 22, 170, 100


class Score(NamedTuple):
    """One line of the table: what is known and said, the figures by who made them, what agonic
    stated."""

    recording: str
    known: str
    says: str
    figures: dict[str, str]
    stated: str


def read_scores() -> list[Score]:
    """The lines of the table."""
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    head, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    table = [dict(zip(head, row, strict=True)) for row in rows]
    return [
        Score(
            row["recording"],
            row["known"],
            row["agonic says"],
            {name: cell for name, cell in row.items() if name not in NOT_FITS},
            row["stated"],
        )
        for row in table
    ]


def find_number(cell: str) -> float | None:
    """The number of a cell; None where there is none.

    >>> find_number("(3.5 %)"), find_number("failed")
    (3.5, None)
    """
    try:
        return float(cell.strip("()").rstrip("°% "))
    except ValueError:
        return None


def draw(score: Score) -> str:
    """Bars over a logarithmic axis, one a fit, and a line at what agonic stated."""
    numbers = {name: find_number(cell) for name, cell in score.figures.items()}
    stated = find_number(score.stated)
    known = [v for v in (*numbers.values(), stated) if v is not None and v > 0]
    low, high = math.log10(min(known)) - 0.3, math.log10(max(known)) + 0.05

    def across(value: float) -> float:
        return LEFT + (WIDE - LEFT - RIGHT) * (math.log10(max(value, 1e-300)) - low) / (high - low)

    high_px = ROW * len(numbers) + 4
    parts = []
    for k, (name, value) in enumerate(numbers.items()):
        y, cell = ROW * k + 2, escape(score.figures[name])
        own = ' class="own"' if name == "agonic" else ""
        parts.append(f'<text x="{LEFT - 8}" y="{y + 15}" text-anchor="end">{escape(name)}</text>')
        if value is not None:
            size = f'width="{max(across(value) - LEFT, 1.0):.1f}" height="{ROW - 6}"'
            parts.append(f'<rect{own} x="{LEFT}" y="{y + 2}" {size}/>')
        parts.append(f'<text x="{WIDE - 4}" y="{y + 15}" text-anchor="end">{cell}</text>')
    if stated is not None:
        at = f"{across(stated):.1f}"
        parts.append(f'<path d="M{at} 0V{high_px}"><title>stated {score.stated}</title></path>')
    words = ", ".join(f"{name} {cell}" for name, cell in score.figures.items())
    label = escape(f"{score.recording}: {words}; stated {score.stated}")
    box = f'viewBox="0 0 {WIDE} {high_px}"'
    return f'<svg class="score" role="img" aria-label="{label}" {box}>{"".join(parts)}</svg>'


class Scoreboard(SphinxDirective):
    """A heading, what agonic says, and a figure for each line."""

    def run(self) -> list[nodes.Node]:
        self.env.note_dependency(str(TABLE))
        made: list[nodes.Node] = []
        for score in read_scores():
            section = nodes.section(ids=[nodes.make_id(score.recording)])
            section += nodes.title(text=score.recording)
            says = f"{score.known}. agonic says: {score.says}; it states {score.stated}."
            section += nodes.paragraph(text=says[:1].upper() + says[1:])
            section += nodes.raw("", draw(score), format="html")
            made.append(section)
        return made


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("scoreboard", Scoreboard)
    return {"parallel_read_safe": True}
