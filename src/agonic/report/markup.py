"""HTML and SVG elements whose text is escaped unless it is markup already."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any


class Markup(str):
    """Text that is valid HTML as it stands; any other string is escaped on its way in."""

    __slots__ = ()


def markup(*children: str) -> Markup:
    """The children one after the other, escaped where they are not markup."""
    return Markup("".join(c if isinstance(c, Markup) else escape(c) for c in children))


def element(name: str, *children: str, **attributes: str | float | None) -> Markup:
    """An element with its children and attributes; `None` leaves an attribute out. A trailing
    underscore keeps clear of Python's words, the others become hyphens."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    return Markup(f"<{name}{written}>{markup(*children)}</{name}>")


def table(head: Iterable[str], rows: Iterable[Iterable[str]], **attributes: str | None) -> Markup:
    """A table whose first cell of each row names the row; a row may be markup already."""
    return element(
        "table",
        element("thead", element("tr", *(element("th", h, scope="col") for h in head))),
        element("tbody", *(one if isinstance(one, Markup) else row(one) for one in rows)),
        **attributes,
    )


def grouped_table(
    head: Sequence[str], groups: Iterable[tuple[str, Iterable[Iterable[str]]]], **attributes: str
) -> Markup:
    """A table whose rows stand in groups, each under its own heading."""
    bodies = (
        element(
            "tbody",
            element("tr", element("th", heading, scope="rowgroup", colspan=len(head))),
            *map(row, rows),
        )
        for heading, rows in groups
    )
    columns = element("tr", *(element("th", text, scope="col") for text in head))
    return element("table", element("thead", columns), *bodies, **attributes)


def row(cells: Iterable[str], **attributes: str) -> Markup:
    """A row of a table; its first cell names it."""
    first, *others = cells
    head = element("th", first, scope="row")
    return element("tr", head, *(element("td", cell) for cell in others), **attributes)


def data_script(value: Any, **attributes: str) -> Markup:
    """Data for the page's own script, safe whatever the strings in it say."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return element("script", Markup(text), type="application/json", **attributes)
