"""`Section` and `Table`: the parts of a document, as markup and as lines of text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from agonic.citations import find_citation
from agonic.provenance import Input, Provenance
from agonic.report import tables, text
from agonic.report.digits import count, typeset
from agonic.report.figure import Figure
from agonic.report.markup import Markup, element, markup, table


@dataclass(frozen=True)
class Table:
    """A table: its head and its rows, whose first cell names them. `style` are its classes in the
    style sheets; `scrolls` lets it be wider than a small screen. Cells of a table that is printed
    as text are plain strings."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    style: str = "numbers"
    scrolls: bool = False

    def to_html(self) -> Markup:
        """The table as markup."""
        made = table(self.head, self.rows, class_=self.style)
        return element("div", made, class_="scroll") if self.scrolls else made


def tabulate(
    items: Iterable[Any],
    columns: Mapping[str, Callable[[Any], str]],
    style: str = "numbers",
    *,
    scrolls: bool = False,
) -> Table:
    """A row an item, in which each column, by its head, says something of it."""
    rows = [[say(item) for say in columns.values()] for item in items]
    return Table([*columns], rows, style, scrolls)


Shown = str | Mapping[str, str] | Table | Figure
"""Prose (or markup as it stands), entries, a table, or a figure."""

Block = Shown | Callable[[], "Shown | Sequence[Shown]"]
"""The same, or what makes one or several: called only for a page."""


@dataclass(frozen=True)
class Section:
    """A part of a document under its heading, which may be empty. `printed` sections are part of
    the plain text too, without what is drawn in them. `style` are classes of the style sheets for
    all blocks together: "pair" puts two beside each other."""

    title: str
    blocks: Sequence[Block]
    printed: bool = False
    style: str = ""

    def to_html(self, level: str = "h2", anchor: str = "") -> Markup:
        """The section as markup, its heading of a level, and an anchor to link to."""
        drawn = [_block(block) for block in self.blocks]
        if self.style:
            drawn = [element("div", *drawn, class_=self.style)]
        if not self.title:
            return markup(*drawn)
        return tables.part(self.title, *drawn, level=level, anchor=anchor)

    def to_text(self, width: int = text.WIDTH) -> list[str]:
        """The section as lines, after an empty one."""
        lines = ["", *([self.title] if self.title else [])]
        for block in self.blocks:
            if isinstance(block, Table):
                lines += text.format_columns(block.head, block.rows, width)
            elif isinstance(block, Mapping):
                lines += text.wrap_entries(block, width=width)
            elif isinstance(block, str) and not isinstance(block, Markup):
                lines.append(text.wrap(block, width=width))
        return lines


def _block(block: Block) -> Markup:
    """A block of a section as markup."""
    if isinstance(block, Markup):
        return block
    if isinstance(block, str):
        return element("p", typeset(block))
    if isinstance(block, Table | Figure):
        return block.to_html()
    if isinstance(block, Mapping):
        return tables.definitions({name: typeset(words) for name, words in block.items() if words})
    made = block()
    if isinstance(made, str | Mapping | Table | Figure):
        return _block(made)
    return markup(*map(_block, made))


def aside(*words: str) -> Markup:
    """A note in small letters, which pages alone have."""
    return element("p", *words, class_="aside")


def list_inputs(*inputs: Input | None, method: Sequence[str] = (), equation: str = "") -> Section:
    """A section of the files with their checksums, each once, the software, published sources."""
    files = {one.sha256: one for one in inputs if one is not None}
    made = Provenance()
    entries = {
        "Equation": equation,
        "Inputs": "; ".join(
            f"{one.name}, {count(one.count, 'row')}, SHA-256 {one.sha256}" for one in files.values()
        ),
        "Software": f"{made.software}, {made.created}",
        "Sources": "; ".join(map(find_citation, method)),
    }
    return Section("Provenance", [{name: said for name, said in entries.items() if said}])
