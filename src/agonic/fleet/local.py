"""`Processes`: the engine of one machine."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from queue import SimpleQueue
from typing import TypeVar

from agonic.errors import AgonicError
from agonic.fleet.engine import LONGEST_S, Lost
from agonic.logs.child_process import Child

T = TypeVar("T")
R = TypeVar("R")

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
