"""The engine of a cluster: the same table, whatever becomes of its workers."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

pytest.importorskip("distributed")

import distributed

from agonic.errors import AgonicError
from agonic.fleet.engine import Dask, Lost, _start_cluster
from agonic.fleet.run import run_fleet
from tests.fleet.boards import run_here, write_bad, write_boards
from tests.fleet.deadly import fatal, squared


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Two workers, each watched by a nanny that replaces it."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=50
    ) as made:
        yield made


@pytest.fixture(scope="module")
def dask(cluster: Any) -> Dask:
    return Dask(scheduler=cluster.scheduler_address, batch=4)


def test_each_task_has_its_result_once(dask: Dask) -> None:
    assert sorted(dask.run(squared, range(200))) == [(n, n * n) for n in range(200)]


def test_few_tasks_are_under_way_at_a_time(dask: Dask) -> None:
    taken = 0

    def tasks() -> Iterator[int]:
        nonlocal taken
        for n in range(300):
            taken += 1
            yield n

    for done, _ in enumerate(dask.run(squared, tasks()), start=1):
        assert taken - done <= 3 * 2 * 4 + 4


@pytest.mark.slow
def test_the_table_is_that_of_one_process_though_a_worker_is_killed(
    dask: Dask, cluster: Any, tmp_path: Path
) -> None:
    write_boards(tmp_path / "logs", 24)
    write_bad(tmp_path / "logs")
    here = run_here(tmp_path / "logs", out=tmp_path / "here")
    killed: list[int] = []

    def told(progress: Any) -> None:
        if progress.done >= 8 and not killed:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    run = run_fleet([tmp_path / "logs"], tmp_path / "out", engine=dask, progress=told)
    assert killed
    assert run.calibrated == len(run.population)
    assert run.table.read_bytes() == here.table.read_bytes()


@pytest.mark.slow
def test_a_task_that_ends_workers_is_lost_alone() -> None:
    done = list(Dask(workers=2, batch=4).run(fatal, range(24, 40)))
    assert sorted(n for n, _ in done) == list(range(24, 40))
    assert {n for n, result in done if isinstance(result, Lost)} == {31}
    assert all(result == n for n, result in done if n != 31)


def test_what_the_work_raises_ends_the_run(dask: Dask) -> None:
    with pytest.raises(AgonicError, match="not a number"):
        list(dask.run(int, ["1", "not a number", "3"]))


def test_a_scheduler_that_is_not_there_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agonic.fleet.engine.ANSWER_S", 0.5)
    with pytest.raises(AgonicError, match="does not answer"):
        list(Dask(scheduler="tcp://127.0.0.1:9").run(squared, [1]))


@pytest.mark.slow
def test_a_cluster_of_its_own_listens_on_loopback_only() -> None:
    with _start_cluster(distributed, 1) as cluster:
        addresses = [cluster.scheduler_address, *cluster.scheduler_info["workers"]]
        assert {urlsplit(address).hostname for address in addresses} == {"127.0.0.1"}


@pytest.mark.slow
def test_security_is_passed_on(monkeypatch: pytest.MonkeyPatch, dask: Dask) -> None:
    given: dict[str, Any] = {}

    def refuse(address: str, **options: Any) -> None:
        given.update(options)
        raise OSError("enough")

    monkeypatch.setattr(distributed, "Client", refuse)
    with pytest.raises(AgonicError, match="enough"):
        list(Dask(scheduler=dask.scheduler, security={"tls_ca_file": "ca.pem"}).run(squared, [1]))
    assert given["security"].tls_ca_file == "ca.pem"
