"""The directive `result`: a table of benchmarks/results, as it was measured last.

    ```{result} thermal 2
    ```

is the second table of thermal.md, with a line below that says what made it.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


def find_table(name: str, number: int = 1) -> str:
    """A table of a page of results, in markdown.

    Raises `LookupError` where the page or the table is not there.
    """
    page = RESULTS / f"{name}.md"
    if not page.is_file():
        raise LookupError(f"there is no table {page.name}; make bench writes them")
    tables = re.findall(r"^\|.*\n(?:\|.*\n)+", page.read_text(encoding="utf-8"), re.MULTILINE)
    if not 1 <= number <= len(tables):
        raise LookupError(f"{page.name} has {len(tables)} tables and not {number}")
    return str(tables[number - 1])


def find_maker(name: str) -> str:
    """What made a page of results, in a sentence."""
    text = (RESULTS / f"{name}.md").read_text(encoding="utf-8")
    return text[text.rindex("Made by ") :].partition("\n")[0]


class Result(SphinxDirective):
    """A table and what made it."""

    required_arguments = 1
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        name, *number = self.arguments
        self.env.note_dependency(str(RESULTS / f"{name}.md"))
        table = find_table(name, int(*number) if number else 1)
        return self.parse_text_to_nodes(f"{table}\n{find_maker(name)}\n")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("result", Result)
    return {"parallel_read_safe": True}
