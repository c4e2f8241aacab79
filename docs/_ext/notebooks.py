"""Notebooks as pages: `{notebook} NAME` runs `examples/NAME.ipynb` and shows what its cells give.

A notebook is run in this process in an empty folder, without Jupyter: a cell shows what it prints
and the value of its last line, as the page of the object, as a figure, or in words.
"""

from __future__ import annotations

import ast
import base64
import json
from collections.abc import Iterator
from contextlib import chdir, redirect_stdout
from functools import cache
from io import BytesIO, StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import matplotlib
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

EXAMPLES = Path(__file__).parents[2] / "examples"


class Shown(NamedTuple):
    """A cell with what it gave: its kind and text, what it printed, and the value of its end."""

    kind: str
    text: str
    printed: str = ""
    value: Any = None


@cache
def run_notebook(path: Path) -> tuple[Shown, ...]:
    """The cells of a notebook, run one after the other in an empty folder; once in a process."""
    return tuple(_run_cells(path))


def _run_cells(path: Path) -> Iterator[Shown]:
    matplotlib.use("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    with TemporaryDirectory() as folder, chdir(folder):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"])
            if cell["cell_type"] != "code":
                yield Shown("markdown", text)
                continue
            printed = StringIO()
            with redirect_stdout(printed):
                value = _run_cell(text, names)
            yield Shown("code", text, printed.getvalue(), value)


def _run_cell(text: str, names: dict[str, Any]) -> Any:
    """Run a cell; the value of its last line, where that is an expression."""
    tree = ast.parse(text)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)  # type: ignore[attr-defined]


def draw_value(value: Any) -> str:
    """What a notebook shows of a value, as HTML; nothing of None."""
    if value is None:
        return ""
    if hasattr(value, "savefig"):
        picture = BytesIO()
        value.savefig(picture, format="png", dpi=90)
        data = base64.b64encode(picture.getvalue()).decode()
        return f'<p><img alt="figure" src="data:image/png;base64,{data}"></p>'
    if hasattr(value, "_repr_html_"):
        return str(value._repr_html_())
    return ""


class Notebook(SphinxDirective):
    """A notebook with its output."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes of all cells."""
        path = EXAMPLES / f"{self.arguments[0]}.ipynb"
        self.env.note_dependency(str(path))
        made: list[nodes.Node] = []
        for cell in run_notebook(path):
            if cell.kind == "markdown":
                title, _, rest = cell.text.partition("\n")
                text = rest if title.startswith("# ") else cell.text
                made += self.parse_text_to_nodes(text, allow_section_headings=True)
                continue
            made.append(nodes.literal_block(cell.text, cell.text, language="python"))
            html = draw_value(cell.value)
            said = cell.printed + ("" if html or cell.value is None else repr(cell.value))
            if said:
                made.append(nodes.literal_block(said, said, language="text"))
            if html:
                made.append(nodes.raw("", html, format="html"))
        return made


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("notebook", Notebook)
    return {"parallel_read_safe": True}
