"""What is told on stderr of work that takes a while, on a terminal only: a bar, or that it goes on
and how long it took."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")

SILENT_S = 2.0
"""Nobody waits longer without a word."""
LONG_S = 5.0
"""What took longer says how long."""
_shown: list[str] = []
"""What bars are of, since the command began."""


@contextmanager
def timing(name: str) -> Iterator[None]:
    """A line where a command shows no bar for two seconds, and at the end the time that it took."""
    if not sys.stderr.isatty():
        yield
        return
    _shown.clear()
    begun, done = time.monotonic(), threading.Event()

    def tell() -> None:
        if not done.wait(SILENT_S) and not _shown:
            print(f"{name} is working …", file=sys.stderr)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()
    if (took := time.monotonic() - begun) >= LONG_S:
        print(f"{name} took {took:.3g} s", file=sys.stderr)


@contextmanager
def _open_bar(what: str, *columns: str) -> Iterator[Any]:
    """A bar with its name and these columns, of rich or of a text; None where nobody looks."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich import progress as parts
    from rich.console import Console

    _shown.append(what)
    own: dict[str, Any] = vars(parts)
    made = [own[one]() if one in own else parts.TextColumn(one) for one in columns]
    head = (parts.TextColumn("{task.description}"), parts.BarColumn())
    with parts.Progress(*head, *made, console=Console(stderr=True), transient=True) as bar:
        yield bar


def progress(items: Sequence[T], what: str) -> Iterable[T]:
    """The items, with a bar on stderr while they are worked through."""
    if len(items) < 2 or not sys.stderr.isatty():
        yield from items
        return
    with _open_bar(what, "TimeRemainingColumn") as bar:
        yield from bar.track(items, description=what)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """A moving bar with the time that has passed, while one thing is worked on."""
    with _open_bar(what, "TimeElapsedColumn") as bar:
        if bar is not None:
            bar.add_task(what, total=None)
        yield


@contextmanager
def counting(total: int) -> Iterator[Callable[[str, int], None]]:
    """A function that is told the name of a pass and how much of `total` is done in it."""
    with _open_bar("passes", "TimeRemainingColumn") as bar:
        tasks: dict[str, Any] = {}

        def told(what: str, done: int) -> None:
            if bar is None:
                return
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=total)
            bar.update(tasks[what], completed=done)

        yield told


@contextmanager
def paced(what: str, things: str) -> Iterator[Callable[[int, int, int, str], None]]:
    """A function that is told how many things are done, of how many, and how many were before. The
    rate and the remaining time are of those that were not done before; a stage that is told stands
    in their place."""
    with _open_bar(what, "MofNCompleteColumn", "{task.fields[pace]}") as bar:
        task = None if bar is None else bar.add_task(what, total=None, pace="")
        begun = time.monotonic()

        def told(done: int, total: int, before: int, stage: str) -> None:
            if bar is not None:
                pace = stage or _pace(done - before, total - done, time.monotonic() - begun, things)
                bar.update(task, completed=done, total=total, pace=pace)

        yield told


def _pace(done: int, left: int, seconds: float, things: str) -> str:
    """The rate and the remaining time."""
    if done < 1 or seconds <= 0:
        return ""
    remaining = round(left * seconds / done)
    minutes, rest = divmod(remaining, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{done / seconds:.3g} {things}/s, {hours}:{minutes:02}:{rest:02} left"
