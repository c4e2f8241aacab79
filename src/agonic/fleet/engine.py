"""`Engine`: the seam between the work on one log and where it is done."""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice, repeat
from queue import SimpleQueue
from threading import local
from typing import Any, Protocol, TypeVar
from urllib.parse import urlsplit

from agonic.errors import AgonicError, MissingExtraError
from agonic.logs.child_process import Child
from agonic.version import __version__

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
        """As `Engine.run`."""
        for task in tasks:
            yield task, function(task)


@dataclass(frozen=True, slots=True)
class Processes:
    """Child processes of this machine: `workers` of them, or one for each processor. A task that
    ends its process is tried once more; one that takes longer than `longest_s` seconds is stopped.
    Both come back as `Lost`, and the others are not concerned."""

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
    for _ in range(2):  # tries
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


ANSWER_S = 30
"""How long a scheduler and its workers may take to answer at first."""


@dataclass(frozen=True, slots=True)
class Dask:
    """Workers of a cluster: that of a scheduler which runs, or one of its own on this machine.

    A batch whose worker ends goes to another. A worker has a child process for its tasks, so that
    none of them can end it, or hold it up.

    Parameters
    ----------
    scheduler : its address, "tcp://host:8786". Its workers have the same version of agonic, and
        find the logs, and the folder for files, under the same paths.
    workers : of a cluster of its own; one for each processor unless told otherwise.
    batch : tasks that go to a worker together.
    security : keywords of `distributed.Security`, such as `tls_ca_file`, `tls_client_cert` and
        `tls_client_key`, for a scheduler at "tls://…". Dask's own settings (`distributed.comm.tls`)
        hold where none is given. A scheduler without TLS runs what anybody sends it.
    longest_s : seconds that a task may take; it is then `Lost`, and the others are not concerned.
    """

    scheduler: str | None = None
    workers: int | None = None
    batch: int = 16  # each message costs the scheduler about a millisecond
    security: Mapping[str, Any] | None = None
    longest_s: float = LONGEST_S

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`."""
        distributed = _import_distributed()
        waiting = iter(tasks)
        batches = iter(lambda: list(islice(waiting, self.batch)), [])
        with _silence_dask(), self._client(distributed) as client:
            for batch, answers in _submit_batches(
                client,
                partial(_answer_batch, function, self.longest_s),
                batches,
                3 * _count_threads(client),
            ):
                yield from zip(batch, answers or repeat(Lost()), strict=bool(answers))

    @contextmanager
    def _client(self, distributed: Any) -> Iterator[Any]:
        """A client of the cluster; with it, a cluster of its own is closed."""
        if self.scheduler is None:
            with (
                _start_cluster(distributed, self.workers or count_processors()) as cluster,
                distributed.Client(cluster, set_as_default=False) as client,
            ):
                yield client
            return
        _reach(self.scheduler)
        try:
            client = distributed.Client(
                self.scheduler,
                timeout=ANSWER_S,
                set_as_default=False,
                security=distributed.Security(**self.security) if self.security else None,
            )
        except (OSError, ValueError, TypeError) as error:
            raise _explain_unreached(self.scheduler, error) from None
        with client:
            yield client


def _reach(scheduler: str) -> None:
    """Raises `AgonicError` where nobody listens at the address of a scheduler."""
    try:
        parts = urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}")
        if parts.scheme not in ("tcp", "tls", "ws", "wss") or not parts.hostname or not parts.port:
            raise ValueError("its address is like tcp://host:8786")
        socket.create_connection((parts.hostname, parts.port), timeout=5).close()
    except (OSError, ValueError) as error:
        raise _explain_unreached(scheduler, error) from None


def _explain_unreached(scheduler: str, error: Exception) -> AgonicError:
    return AgonicError(
        f"the scheduler {scheduler} does not answer ({error}); start one with `dask scheduler`"
    )


_OWN = {
    # else a worker that ends again some seconds after it was replaced is given up for good
    "distributed.deploy.lost-worker-timeout": "1 day",
    "logging.distributed": "critical",
}


@contextmanager
def _start_cluster(distributed: Any, workers: int) -> Iterator[Any]:
    import dask

    with dask.config.set(_OWN):
        cluster = distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",  # nobody else is to give it work
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        )
        try:
            yield cluster
        finally:
            # one that is closed while it starts a lost worker anew stumbles over that worker: the
            # work is done by then
            with suppress(AssertionError):
                cluster.close()


def _submit_batches(
    client: Any, function: Callable[[list[T]], R], batches: Iterator[list[T]], most: int
) -> Iterator[tuple[list[T], R | None]]:
    """Each batch with its answers, None where workers ended with it; `most` under way at a time."""
    distributed = _import_distributed()
    finished = distributed.as_completed(loop=client.loop)
    underway: dict[str, tuple[Any, list[T]]] = {}
    again: list[list[T]] = []
    while True:
        returned, again = again, []
        for batch in islice(chain(returned, batches), max(most - len(underway), len(returned))):
            future = client.submit(function, batch, pure=False)
            underway[future.key] = future, batch
            finished.add(future)
        if not underway:
            return
        future, batch = underway.pop(next(finished).key)
        try:
            answers = future.result(timeout=20)
        except distributed.KilledWorker:
            answers = None
        except TimeoutError:  # the worker ended with the answers, and nobody makes them anew
            future.cancel()
            again.append(batch)
            continue
        except (OSError, distributed.CancelledError) as error:
            raise AgonicError(
                f"the cluster was lost ({error}); the same command goes on from there"
            ) from None
        yield batch, answers


_of_thread = local()


def _answer_batch(function: Callable[[T], R], longest_s: float, batch: list[T]) -> list[R | Lost]:
    """What a worker does: a child process of it works, which may crash or be stopped."""
    if not hasattr(_of_thread, "child"):
        _of_thread.child = Child()
    return [ask(_of_thread.child, function, task, longest_s) for task in batch]


def _count_threads(client: Any) -> int:
    """How many tasks the cluster works on at a time; its workers must be of one mind with us."""
    try:
        client.wait_for_workers(1, timeout=ANSWER_S)
        versions = set(client.run(_get_version).values())
    except TimeoutError:
        raise AgonicError("the scheduler has no workers; start some with `dask worker`") from None
    except ImportError as error:
        raise AgonicError(f"a worker of the cluster has no agonic ({error})") from None
    if versions != {__version__}:
        others = ", ".join(sorted(versions - {__version__}))
        raise AgonicError(f"workers of the cluster have agonic {others}, and this is {__version__}")
    return sum(client.nthreads().values())


def _get_version() -> str:
    return __version__


@contextmanager
def _silence_dask() -> Iterator[None]:
    """Dask's own words on workers that come and go are kept from the user, who gets rows."""
    loggers = [
        logging.getLogger(name)
        for name in ("distributed", *logging.root.manager.loggerDict)
        if name.partition(".")[0] == "distributed"
    ]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def _import_distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("a cluster", "cluster") from None
    return distributed
