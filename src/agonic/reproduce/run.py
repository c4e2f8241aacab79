"""Executing the commands of a document, and the numbers taken out of what they say."""

from __future__ import annotations

import csv
import json
import operator
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from shlex import join, split
from typing import Any, Literal

import msgspec
from msgspec.structs import replace

from agonic.cli import FAILED, GOOD, run
from agonic.errors import AgonicError

Number = float | list[float]


class Item(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An equation, figure, table or claim of a document, and what shows it here.

    Attributes
    ----------
    at : where in the document. what : what our number is. page : of the documentation.
    says : what the document says of it, "" where it states no number.
    before : a command that the item rests on alone. command : what makes the number.
    key : where it is in the command's JSON, names and indices between dots, several between commas;
        or FILE:key in a JSON or CSV file. Of a list with `length` the number is how long it is.
    truth : numbers, or where they are, from which our number is then the largest distance.
    factor : what both are multiplied with, into the unit.
    unit : of the number.
    limit : the document's own, "< 10" or "5 to 6"; several for a list of numbers.
    ours : a limit of our own where the document states none.
    missed : why the document's number is not met, where it is not.
    """

    at: str
    what: str
    page: str
    command: str
    key: str
    says: str = ""
    before: str = ""
    truth: Number | str | None = None
    factor: float = 1.0
    length: bool = False
    unit: str = ""
    limit: str | list[str] = ""
    ours: str | list[str] = ""
    missed: str = ""

    @property
    def limits(self) -> list[str]:
        """The limit of each number."""
        given = self.limit or self.ours
        return [given] if isinstance(given, str) else given


class Source(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A document: its name on the command line, title and origin, and its items.

    Attributes
    ----------
    files : input that is written before anything runs, by name. setup : commands that the items
        rest on. data : files and folders among what they make that a user may have of their own.
    figures : where in the document, and the file and heading of the page where it is drawn here.
    styles : style sheets of those pages.
    """

    name: str
    title: str
    origin: str
    setup: list[str]
    items: list[Item]
    files: dict[str, str] = {}
    data: list[str] = []
    figures: list[dict[str, str]] = []
    styles: list[str] = []


def load_documents() -> dict[str, Source]:
    """The documents by their names."""
    text = Path(__file__).with_name("documents.toml").read_text("utf-8")
    found = msgspec.convert(tomllib.loads(text)["document"], list[Source])
    return {one.name: one for one in found}


def with_own_data(source: Source, given: Sequence[Path]) -> Source:
    """The document with files and folders of the user in the place of its own, in their order. What
    makes the replaced ones is left out, and so is all that rests on none of them or needs the truth
    of a simulation."""
    if len(given) > len(source.data):
        raise AgonicError(f"{source.name} takes {', '.join(source.data)} of your own, no more")
    for one in given:
        if not one.exists():
            raise AgonicError(f"{one} is not there")
    own = {name: str(one.resolve()) for name, one in zip(source.data, given, strict=False)}
    reached = set(own)
    setup = [made for one in source.setup if (made := _rewrite(one, own, reached))]
    items = []
    for item in source.items:
        before, command = (_rewrite(one, own, reached) for one in (item.before, item.command))
        if command and not isinstance(item.truth, str):
            items.append(replace(item, before=before, command=command))
    return replace(source, setup=setup, items=items)


def _rewrite(command: str, own: Mapping[str, str], reached: set[str]) -> str:
    """The command on the user's data; "" where it makes what is replaced or reads none of it."""
    words = split(command)
    out = words[words.index("-o") + 1] if "-o" in words else ""
    reads = [word for word in words if word != out and {word, word.split("/")[0]} & reached]
    if out in own or not reads:
        return ""
    reached.add(out)
    return join(own.get(word, word) for word in words)


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
    """Whether a number keeps to a limit."""
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
    """Every item of a document, made in an empty folder, in the order of the document."""
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
    """The numbers of an item in the JSON of its command, or their largest distance from the
    truth."""
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
    """What is at a key, names and indices between dots, several between commas."""
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
