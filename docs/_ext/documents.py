"""The directive `documents`: the table of documents.toml, its numbers made while the page is built.

    {documents}

A number that is not what its item says, or a command that fails, is an error.
"""

from __future__ import annotations

import json
import operator
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from terminal import executed

FILE = Path(__file__).parents[1] / "documents.toml"
HOLDS = {"<": operator.lt, ">": operator.gt, "==": operator.eq}
HEAD = ("Where", "What", "Here", "The document", "This build")


def load_documents() -> list[dict[str, Any]]:
    """The documents with their items."""
    documents: list[dict[str, Any]] = tomllib.loads(FILE.read_text(encoding="utf-8"))["document"]
    return documents


def reproduce(document: dict[str, Any]) -> list[str]:
    """What each item's command says, as text for its last column."""
    with TemporaryDirectory() as folder:
        for command in document.get("setup", ()):
            _run(command, folder)
        said: dict[str, dict[str, Any]] = {}
        return [_find(item, folder, said) for item in document["items"]]


def _find(item: dict[str, Any], folder: str, said: dict[str, dict[str, Any]]) -> str:
    """The number of one item; each command runs once."""
    if "missing" in item:
        return f"not here: {item['missing']}"
    if "command" not in item:
        return ""
    command = item["command"]
    if command not in said:
        if "before" in item:
            _run(item["before"], folder)
        said[command] = json.loads(_run(f"{command} --json", folder))
    if "key" not in item:
        return "runs"
    value: Any = said[command]
    for part in item["key"].split("."):
        value = value[int(part)] if isinstance(value, list) else value[part]
    value = len(value) if isinstance(value, list) else value
    if "holds" in item:
        sign, limit = item["holds"].split()
        if not HOLDS[sign](value, float(limit)):
            raise ValueError(f"{item['what']}: {value:g} is not {item['holds']}")
    return f"{value:.4g} {item.get('unit', '')}".replace(" °", "°").replace(" ″", "″").strip()


def _run(command: str, folder: str) -> str:
    """What a command prints; status 1, a verdict below good, is an answer too."""
    printed, status = executed(command, folder)
    if status not in (0, 1):
        raise ValueError(f"{command!r} left with status {status}: {printed}")
    return printed


class Documents(SphinxDirective):
    """A section and a table for each document."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        lines: list[str] = []
        for document in load_documents():
            try:
                found = reproduce(document)
            except (ValueError, KeyError, IndexError) as error:
                raise self.error(str(error)) from error
            lines += ["", f"## {document['title']}", "", document["source"], ""]
            lines += [_row(HEAD), _row(["---"] * len(HEAD))]
            lines += [
                _row(_cells(item, said))
                for item, said in zip(document["items"], found, strict=True)
            ]
            commands = [*document.get("setup", ())]
            for item in document["items"]:
                commands += [item[k] for k in ("before", "command") if k in item]
            lines += ["", "```text", *dict.fromkeys(commands), "```"]
        container = nodes.Element()
        self.state.nested_parse(StringList(lines, source=str(FILE)), 0, container, match_titles=1)
        return container.children


def _cells(item: dict[str, Any], said: str) -> list[str]:
    page = item.get("page")
    here = f"[{Path(page).stem.replace('-', ' ')}]({page})" if page else ""
    return [item["at"], item["what"], here, item.get("published", ""), said]


def _row(cells: Any) -> str:
    return f"| {' | '.join(cells)} |"


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_directive("documents", Documents)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
