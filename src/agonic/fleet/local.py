"""`Processes`: the engine of one machine."""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

from agonic.errors import AgonicError
from agonic.fleet.engine import Answer, Lost

T = TypeVar("T")
R = TypeVar("R")

WAITING = 3
"""Tasks that a process has at a time, so that it need not wait for the next."""
TRIES = 2
"""How often a task may end its process."""
STARTS = 3
"""How many processes in a row may end before they begin, until nothing more is tried."""
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""Small matrices lose far more to threads than they gain."""

_READY = "ready"


@dataclass(frozen=True, slots=True)
class Processes:
    """Processes of this machine: `workers` of them, or one for each processor.

    Each sends back result by result, so that where one ends it is known which task it was at. That
    task is tried once more; those that waited behind it go to another.

    >>> sorted(result for _, result in Processes(1).run(abs, [-1, 2, -3]))
    [1, 2, 3]
    """

    workers: int | None = None

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`."""
        queue = _Queue(iter(tasks))
        pool: list[_Worker[T]] = []
        failed_starts = 0
        try:
            while self._assign_work(pool, queue, function):
                for worker in _wait_for_any(pool):
                    try:
                        answer = worker.connection.recv()
                    except (EOFError, OSError):
                        pool.remove(worker)
                        failed_starts = 0 if worker.ready else failed_starts + 1
                        yield from queue.take_back(worker)
                        continue
                    if answer == _READY:
                        worker.ready = True
                    else:
                        yield worker.waiting.popleft().task, answer.value()
                    while len(worker.waiting) < WAITING and (entry := queue.take()):
                        worker.give(entry)
                if failed_starts >= STARTS:
                    raise AgonicError(_NO_START)
        finally:
            for worker in pool:
                worker.end()

    def _assign_work(
        self, pool: list[_Worker[T]], queue: _Queue[T], function: Callable[[T], Any]
    ) -> bool:
        """Whether there is work; there are then as many processes as there is work for."""
        for worker in [worker for worker in pool if not worker.waiting]:
            entry = queue.take()
            if entry:
                worker.give(entry)
            else:
                pool.remove(worker)
                worker.end()
        while len(pool) < (self.workers or count_processors()) and (entry := queue.take()):
            pool.append(_Worker.start(function))
            pool[-1].give(entry)
        return bool(pool)


def count_processors() -> int:
    """How many processors this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_NO_START = (
    "the processes end before they begin: in a script, what starts them goes under "
    '`if __name__ == "__main__":`'
)


@dataclass(slots=True)
class _Entry(Generic[T]):
    """A task, and how many processes ended while they were at it."""

    task: T
    ends: int = 0


@dataclass(slots=True)
class _Queue(Generic[T]):
    """Tasks that are to be done, those first that came back."""

    tasks: Iterator[T]
    back: deque[_Entry[T]] = field(default_factory=deque)

    def take(self) -> _Entry[T] | None:
        """The next, if there is any."""
        if self.back:
            return self.back.popleft()
        for task in self.tasks:
            return _Entry(task)
        return None

    def take_back(self, worker: _Worker[T]) -> Iterator[tuple[T, Lost]]:
        """Take back what a process that ended had; the first it was at, if it had begun."""
        worker.end()
        if worker.ready and worker.waiting:
            worker.waiting[0].ends += 1
            if worker.waiting[0].ends >= TRIES:
                lost = worker.waiting.popleft()
                yield lost.task, Lost()
        self.back.extend(worker.waiting)


@dataclass(eq=False, slots=True)
class _Worker(Generic[T]):
    """A process, the line to it, and what it has to do, in order."""

    process: Any
    connection: Connection
    waiting: deque[_Entry[T]] = field(default_factory=deque)
    ready: bool = False

    @classmethod
    def start(cls, function: Callable[[T], Any]) -> _Worker[T]:
        """A new process, which is told the function once."""
        ours, theirs = mp.Pipe()
        context: Any = mp.get_context("forkserver" if sys.platform == "linux" else "spawn")
        if sys.platform == "linux":  # what is imported once serves all processes
            mp.set_forkserver_preload(["__main__", getattr(function, "func", function).__module__])
        with _set_inherited():
            process = context.Process(target=_serve, args=(theirs, function), daemon=True)
            process.start()
        theirs.close()
        return cls(process, ours)

    def give(self, entry: _Entry[T]) -> None:
        """Send it a task; where it has ended already, that is seen when it is listened to."""
        self.waiting.append(entry)
        with suppress(OSError):
            self.connection.send(entry.task)

    def end(self) -> None:
        """Stop it, whatever it does."""
        self.connection.close()
        self.process.terminate()
        self.process.join(1.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


def _wait_for_any(pool: list[_Worker[T]]) -> list[_Worker[T]]:
    """The processes that have sent something, or have ended; waits for the first."""
    lines = {worker.connection: worker for worker in pool}
    return [lines[line] for line in wait(list(lines))]  # type: ignore[index]


def _serve(connection: Connection, function: Callable[[Any], Any]) -> None:
    """What a process does until its line is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, OSError):
        connection.send(_READY)
        while True:
            connection.send(Answer.of(function, connection.recv()))


@contextmanager
def _set_inherited() -> Iterator[None]:
    """What new processes take over: one thread each, and no ear for an interruption.

    An interruption of the terminal goes to all processes; the first one sees to the others.
    """
    before = {name: os.environ.get(name) for name in ENVIRONMENT}
    os.environ.update(ENVIRONMENT)
    posix = hasattr(signal, "pthread_sigmask")
    if posix:
        resource_tracker.ensure_running()  # its start would lift the mask
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if posix else set()
    try:
        yield
    finally:
        if posix:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
