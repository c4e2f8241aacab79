"""Directives drawn from the source: `house`, the picture of the imports, and `house-figures`.

The layers are those that import-linter keeps (pyproject.toml), the arrows are the imports as they
stand, so neither can be out of date.
"""

from __future__ import annotations

import ast
import tomllib
from collections import defaultdict
from functools import cache
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import grimp
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "agonic"
LAYERS = "The house: arrows run downwards only"
WIDE, ROW, GAP, HIGH = 820, 58, 8, 30


@cache
def imports() -> grimp.ImportGraph:
    """The imports of the package that happen when it runs."""
    return grimp.build_graph("agonic", exclude_type_checking_imports=True, cache_dir=None)


def layers() -> list[list[str]]:
    """The rooms of each floor, from the top: the contract that import-linter keeps."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (contract,) = (one for one in contracts if one["name"] == LAYERS)
    return [
        [room.strip() for room in layer.replace(":", "|").split("|")]
        for layer in contract["layers"]
    ]


def arrows() -> set[tuple[str, str]]:
    """Which room imports which, without what follows from other arrows."""
    below: dict[str, set[str]] = defaultdict(set)
    for module in imports().modules:
        for other in imports().find_modules_directly_imported_by(module):
            room, there = module.split(".")[1:2], other.split(".")[1:2]
            if room and there and room != there:
                below[room[0]].add(there[0])
    reached: dict[str, set[str]] = {}
    for room in (room for floor in reversed(layers()) for room in floor):
        reached[room] = below[room].union(*(reached.get(there, set()) for there in below[room]))
    return {
        (room, there)
        for room in reached
        for there in below[room]
        if not any(there in reached.get(between, ()) for between in below[room])
    }


def lines_of(room: str) -> int:
    """Lines of Python in a folder or a module."""
    files = [SOURCE / f"{room}.py"]
    if not files[0].exists():
        files = list((SOURCE / room).rglob("*.py"))
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def picture() -> str:
    """The house as SVG: a floor per layer, a box per room, an arrow per import that is needed."""
    place: dict[str, tuple[float, float, float]] = {}
    boxes = []
    for floor, rooms in enumerate(layers()):
        wide = (WIDE - GAP * (len(rooms) - 1)) / max(len(rooms), 4)
        left = (WIDE - len(rooms) * wide - GAP * (len(rooms) - 1)) / 2
        for k, room in enumerate(rooms):
            x, y = left + k * (wide + GAP), floor * ROW + 2
            place[room] = (x + wide / 2, y, y + HIGH)
            boxes.append(
                f'<g class="room"><title>{room}: {lines_of(room)} lines</title>'
                f'<rect x="{x:.0f}" y="{y}" width="{wide:.0f}" height="{HIGH}" rx="4"/>'
                f'<text x="{x + wide / 2:.0f}" y="{y + 20}">{room}</text></g>'
            )
    drawn = []
    for room, there in sorted(arrows()):
        if room not in place or there not in place:
            continue
        (x1, _, y1), (x2, y2, _) = place[room], place[there]
        middle = (y1 + y2) / 2
        drawn.append(
            f'<path d="M{x1:.0f} {y1}C{x1:.0f} {middle:.0f} {x2:.0f} {middle:.0f} {x2:.0f} {y2}"/>'
        )
    high = len(layers()) * ROW
    return (
        f'<svg class="house" viewBox="0 0 {WIDE} {high}" role="img" '
        f'aria-label="The packages of agonic by layer, with their imports">'
        f'<g class="arrows">{"".join(drawn)}</g>{"".join(boxes)}</svg>'
    )


def figures() -> list[tuple[str, str]]:
    """Size and order of the code, by name."""
    files = sorted(SOURCE.rglob("*.py"))
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
    sizes = [len(file.read_text(encoding="utf-8").splitlines()) for file in files]
    lengths, public, documented = [], 0, 0
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lengths.append(_lines_of_body(node))
        for node in tree.body:
            named = isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_"
            public += named
            documented += named and ast.get_docstring(node) is not None
    return [
        ("files", f"{len(files)}"),
        ("lines", f"{sum(sizes)}"),
        ("longest file", f"{max(sizes)} lines"),
        ("median function", f"{median(lengths):.0f} lines"),
        ("nine in ten functions", f"at most {quantiles(lengths, n=10)[-1]:.0f} lines"),
        ("public functions and classes with a docstring", f"{documented} of {public}"),
        ("modules that `ag.read` of a CSV file needs", _needed("agonic.logs.read")),
        ("modules that `ag.fit_ellipsoid` needs", _needed("agonic.ellipsoid")),
    ]


def _lines_of_body(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function below its signature and its docstring."""
    body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


def _needed(module: str) -> str:
    """How many modules stand behind one, and the longest chain among them."""
    graph = imports()

    @cache
    def depth(name: str) -> int:
        below = graph.find_modules_directly_imported_by(name)
        return 1 + max(map(depth, below), default=0)

    return f"{len(graph.find_upstream_modules(module)) + 1}, the longest chain {depth(module)}"


class House(SphinxDirective):
    """The picture."""

    def run(self) -> list[nodes.Node]:
        """The SVG, inline, so that it takes the colours of the page."""
        return [nodes.raw("", picture(), format="html")]


class HouseFigures(SphinxDirective):
    """The table."""

    def run(self) -> list[nodes.Node]:
        """A row a figure."""
        rows = ["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in figures())]
        return self.parse_text_to_nodes("\n".join(rows))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("house", House)
    app.add_directive("house-figures", HouseFigures)
    return {"parallel_read_safe": True}
