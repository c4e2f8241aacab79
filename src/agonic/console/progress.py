"""A progress bar on stderr for work that takes a while, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")


def progress(items: Sequence[T], what: str) -> Iterable[T]:
    """The items, with a bar on stderr while they are worked through."""
    if len(items) < 2 or not sys.stderr.isatty():
        return items
    from rich.console import Console
    from rich.progress import track

    return track(items, description=what, console=Console(stderr=True), transient=True)


@contextmanager
def waiting(what: str) -> Iterator[None]:
    """A moving bar with the time that has passed, while one thing is worked on."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    texts = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*texts, console=Console(stderr=True), transient=True) as bar:
        bar.add_task(what, total=None)
        yield


@contextmanager
def counting(total: int) -> Iterator[Callable[[str, int], None]]:
    """A function that is told the name of a pass and how much of `total` is done in it."""
    if not sys.stderr.isatty():
        yield lambda _what, _done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, Any] = {}

        def told(what: str, done: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=total)
            bar.update(tasks[what], completed=done)

        yield told


@contextmanager
def paced(what: str, things: str) -> Iterator[Callable[[int, int, int, str], None]]:
    """A function that is told how many things are done, of how many, and how many were before.

    The rate and the remaining time are of those that were not done before; a stage that is told
    stands in their place.
    """
    if not sys.stderr.isatty():
        yield lambda _done, _total, _before, _stage: None
        return
    import time

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    texts = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*texts, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None, pace="")
        begun = time.monotonic()

        def told(done: int, total: int, before: int, stage: str) -> None:
            pace = stage or _pace(done - before, total - done, time.monotonic() - begun, things)
            bar.update(task, completed=done, total=total, pace=pace)

        yield told


def _pace(done: int, left: int, seconds: float, things: str) -> str:
    """The rate and the remaining time.

    >>> _pace(240, 1200, 2.0, "logs")
    '120 logs/s, 0:00:10 left'
    """
    if done < 1 or seconds <= 0:
        return ""
    remaining = round(left * seconds / done)
    minutes, rest = divmod(remaining, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{done / seconds:.3g} {things}/s, {hours}:{minutes:02}:{rest:02} left"
