"""What is said of stations: their numbers in words, and rows of tables of findings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


def join_numbers(numbers: Iterable[int]) -> str:
    """Numbers in words, runs of three and more drawn together.

    >>> join_numbers([7, 2, 3, 4, 10]), join_numbers([5])
    ('2–4, 7, 10', '5')
    """
    left = sorted(set(numbers))
    parts: list[str] = []
    while left:
        run = 1
        while run < len(left) and left[run] == left[0] + run:
            run += 1
        if run < 3:
            run = 1
        parts.append(f"{left[0]}–{left[run - 1]}" if run > 1 else f"{left[0]}")
        left = left[run:]
    return ", ".join(parts)


def name_stations(numbers: Iterable[int]) -> str:
    """Stations by number.

    >>> name_stations([3]), name_stations([2, 3, 4])
    ('station 3', 'stations 2–4')
    """
    given = set(numbers)
    return f"station{'s' if len(given) > 1 else ''} {join_numbers(given)}"


class Told(NamedTuple):
    """What is said of a kind of fault: the finding's name, its message, and what to do."""

    name: str
    message: str
    action: str
