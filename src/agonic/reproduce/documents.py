"""`Item` and `Source`: a document and what it holds, as rows of `documents.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import join, split

import msgspec
from msgspec.structs import replace

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
    text = Path(__file__).with_suffix(".toml").read_text("utf-8")
    found = msgspec.convert(tomllib.loads(text)["document"], list[Source])
    return {one.name: one for one in found}


def with_own_data(source: Source, given: Sequence[Path]) -> Source:
    """The document with files and folders of the user in the place of its own, in their order.

    What makes the replaced ones is left out, and so is all that rests on none of them or needs the
    truth of a simulation.

    Raises
    ------
    AgonicError : where more is given than the document has, or something is not there.

    >>> item = Item(at="", what="", page="", command="agonic info flight.csv", key="rows")
    >>> made = Source(name="uav", title="", origin="", setup=[], items=[item], data=["flight.csv"])
    >>> with_own_data(made, [Path(__file__)]).items[0].command.startswith("agonic info /")
    True
    """
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
