"""`Item` and `Source`: a document and what it holds, as rows of `documents.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path

import msgspec

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
