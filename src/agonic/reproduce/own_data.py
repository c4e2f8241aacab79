"""A user's own data in the place of what is simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import join, split

from msgspec.structs import replace

from agonic.errors import AgonicError
from agonic.reproduce.documents import Source


def with_own_data(source: Source, given: Sequence[Path]) -> Source:
    """The document with files and folders of the user in the place of its own, in their order.

    What makes the replaced ones is left out, and so is all that rests on none of them or needs the
    truth of a simulation.

    Raises
    ------
    AgonicError : where more is given than the document has, or something is not there.

    >>> from agonic.reproduce.documents import Item
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
