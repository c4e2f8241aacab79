"""`Dask`: the engine of a cluster, by Dask distributed."""

from __future__ import annotations

import logging
import socket
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain, islice, repeat
from threading import local
from typing import Any, TypeVar
from urllib.parse import urlsplit

from agonic.errors import AgonicError, MissingExtraError
from agonic.fleet.engine import LONGEST_S, Lost, ask, count_processors
from agonic.logs.child_process import Child
from agonic.version import __version__

T = TypeVar("T")
R = TypeVar("R")

BATCH = 16
"""Tasks that go to a worker together: each message costs the scheduler about a millisecond."""
WAITING = 3
"""Batches for each thread of the cluster that are under way at a time."""
SECONDS = 30
"""How long a scheduler and its workers may take to answer at first."""
CONNECTED_S = 5
"""How long the line to a scheduler may take; without one, Dask's client would try on and on."""
PATIENCE_S = 20
"""How long the way of finished answers may take."""


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
    batch: int = BATCH
    security: Mapping[str, Any] | None = None
    longest_s: float = LONGEST_S

    def run(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
        """As `Engine.run`."""
        distributed = _import_distributed()
        with _silence_dask(), self._client(distributed) as client:
            for batch, answers in _submit_batches(
                client,
                partial(_answer_batch, function, self.longest_s),
                _make_batches(iter(tasks), self.batch),
                WAITING * _count_threads(client),
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
                timeout=SECONDS,
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
        socket.create_connection((parts.hostname, parts.port), timeout=CONNECTED_S).close()
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


def _make_batches(tasks: Iterator[T], size: int) -> Iterator[list[T]]:
    return iter(lambda: list(islice(tasks, size)), [])


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
            answers = future.result(timeout=PATIENCE_S)
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
        client.wait_for_workers(1, timeout=SECONDS)
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
