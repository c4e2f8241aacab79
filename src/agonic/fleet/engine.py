"""`Engine`: the seam between the work on one log and where it is done."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol, TypeVar

LONGEST_S = 600.0
"""Longest that one log may take unless told otherwise.

A board's log takes 0.05 s, the fit of the longest recording tried (100 million rows) 13 s:
benchmarks/results/fleet_logs.md and fleet_recording.md.
"""

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, slots=True)
class Lost:
    """A task without a result, and why: it crashed, or did not end in time."""

    sentence: str = (
        "the process that worked on it ended, twice: a library crashed on it, or it needs more "
        "memory than there is; fetch it again, or cut it"
    )

    @classmethod
    def late(cls, longest_s: float) -> Lost:
        """That of a task which was stopped."""
        return cls(
            f"it took longer than {longest_s:g} s, the time limit of one log: cut it, or give it "
            "more time with --timeout"
        )


class Engine(Protocol):
    """Somewhere to work on many tasks: processes of this machine, or workers of a cluster."""

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """Each task with its result, as they are finished; each once, whatever happens to workers.

        `function` can be pickled; what it raises ends the run. Tasks are taken as there is room,
        so that no more than a few wait. Closing the iterator ends all work.
        """
        ...


@dataclass(frozen=True, slots=True)
class Here:
    """The engine that does everything in this process, one task after the other."""

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`.

        >>> list(Here().run(abs, [-1, 2]))
        [(-1, 1), (2, 2)]
        """
        for task in tasks:
            yield task, function(task)
