"""Executing the commands of a document, and the numbers taken out of what they say."""

from __future__ import annotations

import csv
import json
import operator
from collections.abc import Callable, Iterable, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from shlex import split
from typing import Any, Literal

from agonic.cli import FAILED, GOOD, run
from agonic.errors import AgonicError
from agonic.reproduce.documents import Item, Source

SIGNS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
}
"""What stands in a limit before its number."""


@dataclass(frozen=True)
class Row:
    """An item with the numbers that its command makes; without one where it failed, and why."""

    item: Item
    numbers: list[float]
    failed: str = ""

    @property
    def verdict(self) -> Literal["met", "missed", "failed"]:
        """Whether every number keeps to its limit."""
        if self.failed:
            return "failed"
        limits = self.item.limits * (len(self.numbers) if len(self.item.limits) == 1 else 1)
        kept = (holds(n, limit) for n, limit in zip(self.numbers, limits, strict=True))
        return "met" if all(kept) else "missed"


def holds(number: float, limit: str) -> bool:
    """Whether a number keeps to a limit.

    >>> holds(9.2, "< 10"), holds(5.0, ">= 5.44"), holds(5.0, "-1 to 6")
    (True, False, True)
    """
    if " to " in limit:
        low, high = map(float, limit.split(" to "))
        return low <= number <= high
    sign, value = limit.split()
    return SIGNS[sign](number, float(value))


def execute(command: str, folder: Path | str) -> tuple[str, str, int]:
    """What a command of agonic prints, what it complains of, and its exit status."""
    said, complained = StringIO(), StringIO()
    with chdir(folder), redirect_stdout(said), redirect_stderr(complained):
        status = run(split(command)[1:])
    return said.getvalue(), complained.getvalue(), status


def reproduce(
    source: Source, folder: Path, track: Callable[[list[Item]], Iterable[Item]] = iter
) -> list[Row]:
    """Every item of a document, made in an empty folder, in the order of the document.

    Parameters
    ----------
    source : the document. folder : where the commands run and their files stay. track : what the
        items go through while they are worked on, a progress bar for one.

    Raises
    ------
    AgonicError : where a command that all items rest on fails.
    """
    for name, text in source.files.items():
        (folder / name).write_text(text, "utf-8")
    said: dict[str, Any] = {}
    for command in source.setup:
        _run(command, folder, said)
    return [_make_row(item, folder, said) for item in track(source.items)]


def _make_row(item: Item, folder: Path, said: dict[str, Any]) -> Row:
    try:
        if item.before:
            _run(item.before, folder, said)
        return Row(item, find_numbers(item, _run(item.command, folder, said), folder))
    except (AgonicError, LookupError, TypeError, OSError) as error:
        return Row(item, [], f"{type(error).__name__ if not str(error) else error}")


def _run(command: str, folder: Path, said: dict[str, Any]) -> Any:
    """The JSON of a command, which runs once; a verdict below good is an answer too."""
    if command not in said:
        printed, complained, status = execute(f"{command} --json", folder)
        if status not in (GOOD, FAILED) or not printed:
            raise AgonicError(f"{command}: {complained.strip() or f'exit status {status}'}")
        said[command] = json.loads(printed)
    return said[command]


def find_numbers(item: Item, record: Any, folder: Path) -> list[float]:
    """The numbers of an item in the JSON of its command, or their largest distance from the truth.

    >>> item = Item(at="", what="", page="", command="", key="bias.0", truth=2.0)
    >>> find_numbers(item, {"bias": [5.0, 7.0]}, Path())
    [3.0]
    """
    found = find(item.key, record, folder)
    if item.length:
        return [float(len(found))]
    numbers = [number * item.factor for number in _flatten(found)]
    if item.truth is None:
        return numbers
    truth = item.truth
    known = _flatten(find(truth, record, folder) if isinstance(truth, str) else truth)
    return [max(abs(n - t * item.factor) for n, t in zip(numbers, known, strict=True))]


def find(where: str, record: Any, folder: Path) -> Any:
    """What is at a key of a record, or, after the name of a file and a colon, of that file."""
    name, _, key = where.rpartition(":")
    if not name:
        return look_up(record, key)
    text = (folder / name).read_text("utf-8")
    if not name.endswith(".csv"):
        return look_up(json.loads(text), key)
    lines = (line for line in text.splitlines() if not line.startswith("#"))
    return look_up(list(csv.DictReader(lines)), key)


def look_up(record: Any, key: str) -> Any:
    """What is at a key, names and indices between dots, several between commas.

    >>> look_up({"sensors": [{"sd": [1.0, 2.0]}]}, "sensors.0.sd.-1")
    2.0
    >>> look_up([{"x": 1}, {"x": 2}, {"x": 3}], "0,2.x")
    [1, 3]
    """
    if not key:
        return record
    names, _, rest = key.partition(".")
    if isinstance(record, list):
        found = [look_up(record[int(name)], rest) for name in names.split(",")]
    else:
        while names not in record and "," not in names and rest:  # a name that has a dot
            more, _, rest = rest.partition(".")
            names = f"{names}.{more}"
        found = [look_up(record[name], rest) for name in names.split(",")]
    return found if len(found) > 1 else found[0]


def _flatten(found: Any) -> list[float]:
    """The numbers in a number, or in lists of them."""
    if isinstance(found, list):
        return [number for one in found for number in _flatten(one)]
    return [float(found)]
