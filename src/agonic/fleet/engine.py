"""`Engine`: the seam between the work on one log and where it is done."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from queue import SimpleQueue
from typing import Protocol, TypeVar

from agonic.errors import AgonicError
from agonic.logs.child_process import Child

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


TRIES = 2
"""How often a task may end its process."""


@dataclass(frozen=True, slots=True)
class Processes:
    """Child processes of this machine: `workers` of them, or one for each processor.

    A task that ends its process is tried once more; one that takes longer than `longest_s` seconds
    is stopped. Both come back as `Lost`, and the others are not concerned.

    >>> sorted(result for _, result in Processes(1).run(abs, [-1, 2, -3]))
    [1, 2, 3]
    """

    workers: int | None = None
    longest_s: float = LONGEST_S

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`."""
        waiting = iter(tasks)
        children = [Child() for _ in range(self.workers or count_processors())]
        free: SimpleQueue[Child] = SimpleQueue()
        for child in children:
            free.put(child)

        def work(task: T) -> R | Lost:
            child = free.get()
            try:
                return ask(child, function, task, self.longest_s)
            finally:
                free.put(child)

        with ThreadPoolExecutor(len(children)) as threads:
            try:
                under_way = {
                    threads.submit(work, task): task for task in islice(waiting, len(children))
                }
                while under_way:
                    for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                        for task in islice(waiting, 1):
                            under_way[threads.submit(work, task)] = task
                        yield under_way.pop(done), done.result()
            finally:
                for child in children:
                    child.close()


def ask(child: Child, function: Callable[[T], R], task: T, longest_s: float) -> R | Lost:
    """What a child process makes of a task, or why there is no result."""
    for _ in range(TRIES):
        try:
            result: R = child.ask(function, task, longest_s)
        except TimeoutError:
            return Lost.late(longest_s)
        except ChildProcessError:
            continue
        except AgonicError:
            raise
        except Exception as error:
            raise AgonicError(f"unexpected:\n{error}") from error
        return result
    return Lost()


def count_processors() -> int:
    """How many processors this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
