"""What is said and shown of a document made again: page, text and JSON."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import asdict

from agonic.report.digits import NO_BREAK, count
from agonic.report.document import Document
from agonic.report.markup import Markup, element, markup
from agonic.report.markup import table as make_table
from agonic.report.section import Section, Table
from agonic.report.tables import NOTHING, mark
from agonic.report.text import wrap_command
from agonic.reproduce.run import Row, Source

HEAD = ["Where", "What", "The document", "Here", "Limit", "Verdict"]
WORDS = {"met": ("good", "met"), "missed": ("refused", "missed"), "failed": ("refused", "failed")}
"""Sign and word of each verdict on a row."""


@dataclass(frozen=True)
class Rows(Table):
    """The table of the items, its verdicts in their colours on a page."""

    def to_html(self) -> Markup:
        """The table as markup."""
        rows = []
        for *cells, verdict in self.rows:
            word, colon, why = verdict.partition(":")
            rows.append([*cells, markup(mark(*WORDS[word]), colon, why)])
        return make_table(self.head, rows, class_=self.style)


def describe_reproduction(source: Source, rows: Sequence[Row], folder: Path) -> Document:
    """The document beside what was made of it in a folder."""
    met = sum(row.verdict == "met" for row in rows)
    status = f"{met} of {count(len(rows), 'item')} met."
    table = Rows(HEAD, [*map(write_row, rows)], "findings")
    commands = element("pre", "\n".join(map(wrap_command, list_commands(source))))
    return Document(
        schema="agonic/reproduce@1",
        kind="A document reproduced",
        name=source.title,
        about=f"{source.origin}. {status}",
        status=f"{source.title}: {status}",
        sections=[
            Section("Item by item", [table], printed=True),
            *_list_figures(source, folder),
            Section("Commands", [commands]),
        ],
        values={
            "document": source.name,
            "title": source.title,
            "met": met,
            "items": [
                asdict(row.item)
                | {"numbers": row.numbers, "verdict": row.verdict, "failed": row.failed}
                for row in rows
            ],
        },
        styles=source.styles,
    )


def write_row(row: Row) -> list[str]:
    """An item as cells of text, the verdict last."""
    item = row.item
    numbers = ", ".join(f"{round(n, 9) + 0.0:.{4 if abs(n) < 1e4 else 6}g}" for n in row.numbers)
    here = f"{numbers} {item.unit}".replace(" °", "°").replace(" ″", "″").strip()
    limit = ", ".join(one.replace(" ", NO_BREAK) for one in item.limits)
    limit = limit.replace("==", "=").replace(">=", "≥").replace("<=", "≤")
    limit += "" if item.limit else " (ours)"
    why = row.failed or (row.verdict == "missed" and item.missed)
    verdict = f"{row.verdict}: {why}" if why else row.verdict
    return [item.at, item.what, item.says or NOTHING, here if numbers else NOTHING, limit, verdict]


def list_commands(source: Source) -> list[str]:
    """Every command of a document, in order, each once."""
    of_items = (one for item in source.items for one in (item.before, item.command) if one)
    return list(dict.fromkeys([*source.setup, *of_items]))


def _list_figures(source: Source, folder: Path) -> Iterable[Section]:
    """The figures of the document, out of the pages that its commands wrote."""
    for figure in source.figures:
        page, heading = folder / figure["file"], figure["heading"]
        if page.exists() and (found := find_section(page.read_text("utf-8"), heading)):
            yield Section(f"{figure['at']}: {heading.lower()}", [Markup(found)])


def find_section(page: str, heading: str) -> str:
    """What stands under a heading of a page."""
    within = rf"<h[23][^>]*>{re.escape(heading)}</h[23]>(.*?)</section>"
    found = re.search(within, page, re.DOTALL)
    return found[1] if found else ""
