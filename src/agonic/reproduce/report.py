"""What is said and shown of a document made again: page, text and JSON."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agonic.report.digits import count
from agonic.report.document import Document
from agonic.report.markup import Markup, element, markup, table
from agonic.report.section import Section, Table
from agonic.report.tables import NOTHING, mark
from agonic.reproduce.documents import Source
from agonic.reproduce.run import Row

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
        return table(self.head, rows, class_=self.style)


def describe_reproduction(source: Source, rows: Sequence[Row], folder: Path) -> Document:
    """The document beside what was made of it in a folder.

    >>> from agonic.reproduce.documents import Item
    >>> item = Item(at="table", what="x", page="", command="", key="", limit=">= 5.44")
    >>> made = Source(name="samsat", title="A chamber", origin="", setup=[], items=[item])
    >>> print(describe_reproduction(made, [Row(item, [7.1])], Path()).to_text().splitlines()[0])
    A chamber: 1 of 1 item within its limits.
    """
    met = sum(row.verdict == "met" for row in rows)
    status = (
        f"{met} of {count(len(rows), 'item')} within {'its' if len(rows) == 1 else 'their'} limits."
    )
    return Document(
        schema="agonic/reproduce@1",
        kind="A document reproduced",
        name=source.title,
        about=f"{source.origin}. {status}",
        status=f"{source.title}: {status}",
        sections=[
            Section(
                "Item by item", [Rows(HEAD, [*map(write_row, rows)], "findings")], printed=True
            ),
            *_list_figures(source, folder),
            Section("Commands", [element("pre", "\n".join(list_commands(source)))]),
        ],
        values={
            "document": source.name,
            "title": source.title,
            "met": met,
            "items": [make_record(row) for row in rows],
        },
        styles=source.styles,
    )


def write_row(row: Row) -> list[str]:
    """An item as cells of text, the verdict last."""
    item = row.item
    unit = f" {item.unit}".replace(" °", "°").replace(" ″", "″") if item.unit else ""
    here = ", ".join(f"{number:.4g}" for number in row.numbers) + unit if row.numbers else NOTHING
    limit = ", ".join(item.limits) + ("" if item.limit else " (ours)")
    why = row.failed or (row.verdict == "missed" and item.missed)
    verdict = f"{row.verdict}: {why}" if why else row.verdict
    return [item.at, item.what, item.says or NOTHING, here, limit, verdict]


def make_record(row: Row) -> dict[str, Any]:
    """An item for programs."""
    item = row.item
    return {
        "at": item.at,
        "what": item.what,
        "document": item.says or None,
        "numbers": row.numbers,
        "unit": item.unit or None,
        "limits": item.limits,
        "limit_of": "document" if item.limit else "agonic",
        "verdict": row.verdict,
        "why": row.failed or item.missed or None,
        "command": item.command,
    }


def list_commands(source: Source) -> list[str]:
    """Every command of a document, in order, each once."""
    of_items = (one for item in source.items for one in (item.before, item.command) if one)
    return list(dict.fromkeys([*source.setup, *of_items]))


def _list_figures(source: Source, folder: Path) -> Iterable[Section]:
    """The figures of the document, out of the pages that its commands wrote."""
    for figure in source.figures:
        page = folder / figure.file
        found = find_section(page.read_text("utf-8"), figure.heading) if page.exists() else ""
        if found:
            yield Section(f"{figure.at}: {figure.heading.lower()}", [Markup(found)])


def find_section(page: str, heading: str) -> str:
    """What stands under a heading of a page.

    >>> find_section("<section><h3>Bias</h3><p>flat</p></section>", "Bias")
    '<p>flat</p>'
    """
    within = rf"<h[23][^>]*>{re.escape(heading)}</h[23]>(.*?)</section>"
    found = re.search(within, page, re.DOTALL)
    return found[1] if found else ""
