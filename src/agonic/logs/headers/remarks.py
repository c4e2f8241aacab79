"""What is told of columns that could not be taken, or could be taken otherwise."""

from __future__ import annotations

from collections.abc import Iterable

from agonic.logs.headers.columns import Identified, find_doubtful, find_rivals

_CLOCKS = frozenset(("time", "date", "hour", "gps_tow"))


def tell_rivals(found: Identified, headers: list[str], fields: list[str]) -> tuple[str, ...]:
    """What was taken where a table holds a field twice, and how to take the other."""
    notes = []
    for number in fields:
        axes = found["field"][number]
        if rivals := find_rivals(headers, axes):
            taken = ", ".join(axes[axis].header for axis in "xyz" if axis in axes)
            given = ",".join(f"{axis}={header}" for axis, header in zip("xyz", rivals, strict=True))
            notes.append(f"{taken} are taken; the table holds the field again: --columns {given}")
    return tuple(notes)


def tell_doubtful(headers: Iterable[str]) -> tuple[str, ...]:
    """What was left out because several columns could be it."""
    if doubtful := find_doubtful(headers):
        return (f"{' and '.join(doubtful)} left out: which of them is meant? --columns says it",)
    return ()


def tell_no_clock(found: Identified, others: Iterable[str]) -> tuple[str, ...]:
    """What could be the clock of a table that has none that is known."""
    free = [header for header in others if header.strip()]
    if _CLOCKS.intersection(found) or not free:
        return ()
    return (f"no column is known for a time ({', '.join(free[:5])}): --columns time=… names it",)
