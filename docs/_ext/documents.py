"""The directive `documents`: the documents that agonic began with, reproduced while the page is
built, a section and a table for each.

    {documents}

A command that fails is an error; a number that misses its document's is said to.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from agonic.reproduce.report import HEAD, list_commands, write_row
from agonic.reproduce.run import Row, Source, load_documents, reproduce


class Documents(SphinxDirective):
    """A section and a table for each document."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        lines: list[str] = []
        for source in load_documents().values():
            with TemporaryDirectory() as folder:
                rows = reproduce(source, Path(folder))
            if failed := [row.failed for row in rows if row.failed]:
                raise self.error("\n".join(failed))
            lines += _write_section(source, rows)
        container = nodes.Element()
        place = StringList(lines, source="documents.toml")
        self.state.nested_parse(place, 0, container, match_titles=1)
        return container.children


def _write_section(source: Source, rows: list[Row]) -> Iterator[str]:
    """The lines of one document."""
    yield from ("", f"## {source.title}", "", source.origin, "")
    yield from (_line([*HEAD, "Page"]), _line(["---"] * (len(HEAD) + 1)))
    for row in rows:
        page = row.item.page
        *cells, verdict = write_row(row)
        verdict = verdict.replace("missed", "**missed**", 1)
        yield _line([*cells, verdict, f"[{Path(page).stem.replace('-', ' ')}]({page})"])
    commands = [f"agonic reproduce {source.name} -o {source.name}", "", *list_commands(source)]
    yield from ("", "```text", *commands, "```")


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("documents", Documents)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
