"""Which station, and which board, a file of a campaign is of, told by its name."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

_TOKEN = re.compile(r"\d+|[^\W\d_]+")
_STATION_WORDS = frozenset(
    """
    pos position pose station stn st orientation lage stellung poz
    поз позиция положение пол станция точка ст
    """.split()  # noqa: SIM905
)
_MOST = 999
"""The largest number of a station; longer numbers are dates and times."""


class StationFile(NamedTuple):
    """A file with the number of its station and the name of its board, as far as they are known."""

    station: int | None
    board: str
    path: Path


def number_files(files: Sequence[Path], folder: Path) -> list[StationFile]:
    """The files by what their names, and those of their folders, differ in.

    The station is the number behind a word such as pos or station, else the number in which names
    differ that are otherwise alike; the board is the words in which they differ beside it.
    """
    tokens = [_split_name(file, folder) for file in files]
    at = _find_places(tokens)
    boards = _name_boards(tokens, at)
    made = [
        StationFile(None if k is None else int(own[k]), board, file)
        for file, own, k, board in zip(files, tokens, at, boards, strict=True)
    ]
    return sorted(made, key=lambda f: (f.station is None, f.station or 0, f.board, f.path))


def _split_name(file: Path, folder: Path) -> list[str]:
    """The words and numbers of a name, with those of the folders between."""
    name = file.relative_to(folder) if file.is_relative_to(folder) else Path(file.name)
    return _TOKEN.findall(str(name.with_suffix("")))


def _find_places(tokens: Sequence[list[str]]) -> list[int | None]:
    """Where in each name the number of the station stands."""
    by_word = [_find_behind_word(own) for own in tokens]
    if all(k is not None for k in by_word):
        return by_word
    places = [[k for k, token in enumerate(own) if token.isdigit()] for own in tokens]
    if len({len(own) for own in places}) == 1 and (c := _choose_column(tokens, places)) is not None:
        return [own[c] for own in places]
    found: list[int | None] = [None] * len(tokens)
    groups: defaultdict[tuple[str, ...], list[int]] = defaultdict(list)
    for i, own in enumerate(tokens):
        groups[tuple("" if token.isdigit() else token for token in own)].append(i)
    for rows in groups.values():
        column = _choose_shared_column([tokens[i] for i in rows], [places[i] for i in rows])
        for i in rows:
            found[i] = None if column is None else places[i][column]
    return found


def _find_behind_word(own: Sequence[str]) -> int | None:
    """The last number that stands behind a word for a station."""
    marked = (
        k
        for k in range(len(own) - 1, 0, -1)
        if own[k].isdigit() and own[k - 1].lower() in _STATION_WORDS
    )
    return next(marked, None)


def _choose_column(tokens: Sequence[list[str]], places: Sequence[list[int]]) -> int | None:
    """The number in which all names differ; one that can be a station's before a date or time."""
    columns = [
        [int(own[p]) for own, p in zip(tokens, at, strict=True)] for at in zip(*places, strict=True)
    ]
    apart = [c for c, column in enumerate(columns) if len(set(column)) == len(tokens)]
    small = [c for c in apart if max(columns[c]) <= _MOST]
    return next(iter([*small, *apart]), None)


def _choose_shared_column(tokens: Sequence[list[str]], places: Sequence[list[int]]) -> int | None:
    """Of names alike in their words, the number with the most values, the others its boards."""
    if len(tokens) < 2:
        return None
    whole = _choose_column(tokens, places)
    if whole is not None:
        return whole
    columns = [
        [int(own[p]) for own, p in zip(tokens, at, strict=True)] for at in zip(*places, strict=True)
    ]
    small = [c for c, column in enumerate(columns) if max(column) <= _MOST]
    if not small:
        return None
    best = max(small, key=lambda c: len(set(columns[c])))
    pairs = {tuple(column[i] for column in columns) for i in range(len(tokens))}
    return best if len(set(columns[best])) > 1 and len(pairs) == len(tokens) else None


def _name_boards(tokens: Sequence[list[str]], at: Sequence[int | None]) -> list[str]:
    """The words in which names differ beside the station; "" where they do not.

    Numbers count only where the words leave two files of one station alike.
    """
    rest = [[t for k, t in enumerate(own) if k != p] for own, p in zip(tokens, at, strict=True)]
    stations = [None if p is None else own[p] for own, p in zip(tokens, at, strict=True)]
    words = [[t for t in own if not t.isdigit()] for own in rest]
    keys = list(zip(stations, map(tuple, words), strict=True))
    chosen = words if len(set(keys)) == len(keys) else rest
    common = set.intersection(*map(set, chosen)) if chosen else set()
    if chosen is rest:  # board1 and not 1
        return [
            _join_numbers([t for t in own if t.lower() not in _STATION_WORDS], common)
            for own in rest
        ]
    return ["-".join(t for t in own if t not in common) for own in chosen]


def _join_numbers(own: Iterable[str], common: set[str]) -> str:
    """The tokens that differ, each number with the word before it."""
    parts: list[str] = []
    before = ""
    for token in own:
        if token not in common:
            parts.append(f"{before}{token}" if token.isdigit() else token)
        before = "" if token.isdigit() or token not in common else token
    return "-".join(parts)
