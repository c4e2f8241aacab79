"""The public names of a package: listed in its `__init__.pyi`, loaded when they are first used."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from inspect import isfunction
from typing import Any, NamedTuple

from agonic.misuse import explain_misuse

UNLISTED = "# isort: split"
"""What stands after it is found and not listed."""


class Offer(NamedTuple):
    """What a package puts into its namespace: how names are found, and which there are."""

    find: Callable[[str], Any]
    list_names: Callable[[], list[str]]
    names: list[str]


def offer(package: str, stub: str) -> Offer:
    """The names that the file `stub`, a line a name, lists for a package.

    A command pays only for the names that it uses. A function tells what is wrong with what it was
    given (`explain_misuse`).
    """
    text = read_stub(stub)
    home_of, listed = find_homes(text), sorted(find_homes(text.partition(UNLISTED)[0]))

    def find(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if home_of[name] == package:  # a group of further names
            return import_module(f"{package}.{name}")
        value = getattr(import_module(home_of[name]), name)
        if isfunction(value):
            value = explain_misuse(value, package)
        setattr(sys.modules[package], name, value)
        return value

    return Offer(find, lambda: list(listed), listed)


def read_stub(stub: str) -> str:
    """The text of a file of names."""
    with open(stub, encoding="utf-8") as lines:
        return lines.read()


def find_homes(text: str) -> dict[str, str]:
    """The module of each name in lines `from MODULE import NAME as NAME`."""
    lines = (line.split() for line in text.splitlines() if line.startswith("from "))
    return {words[-1]: words[1] for words in lines}
