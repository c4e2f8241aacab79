"""Docstrings of agonic as reStructuredText: plain text with `names`, sections and formulas.

They are written to be read with `help()`. Here the signs that would mean markup are escaped, and
entries `name : what it is` below an underlined heading become a definition list, and indented lines
with an equation before the first heading a typeset formula.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from formulas import typeset_formula
from sphinx.application import Sphinx

_ENTRY = re.compile(r"^(?P<names>[A-Za-z_][\w, ]*?) : (?P<rest>.+)$")
_FORMULA = re.compile(r"    [^`\"]*[=Σ≤][^`\"]*$")
_PARTS = re.compile(r"(`[^`]*`)")
_MARKS = re.compile(r"([*|\\]|_\b)")


def restructured(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring as reStructuredText.

    >>> list(restructured(["Parameters", "----------", "bias : (3,), |b|", "    in nT."]))
    ['.. rubric:: Parameters', '', '``bias``', '    (3,), \\\\|b\\\\|', '    in nT.']
    """
    after = [*lines[1:], ""]
    doctest, prose = False, True
    for line, following in zip(lines, after, strict=True):
        doctest = line.lstrip().startswith(">>>") or (doctest and bool(line.strip()))
        if doctest:
            yield line
        elif prose and _FORMULA.match(line):
            yield from (".. raw:: html", "", f"    {typeset_formula(line)}", "")
        elif line and set(following) == {"-"}:
            prose = False
            yield from (f".. rubric:: {line}", "")
        elif set(line) != {"-"}:
            yield from _entry(line)


def _entry(line: str) -> Iterator[str]:
    """A line, or the two that `name : what it is` becomes."""
    found = _ENTRY.match(line)
    if found is None:
        yield _escaped(line)
        return
    yield ", ".join(f"``{name.strip()}``" for name in found["names"].split(","))
    yield f"    {_escaped(found['rest'])}"


def _escaped(line: str) -> str:
    """Text in which only `names` are markup."""
    parts = _PARTS.split(line)
    return "".join(p if p.startswith("`") else _MARKS.sub(r"\\\1", p) for p in parts)


def _process(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    lines[:] = [*restructured(lines), ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True}
