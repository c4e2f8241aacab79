"""The engine of one machine: every task once, whatever becomes of processes."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import psutil
import pytest

from agonic.errors import AgonicError
from agonic.fleet.engine import Lost, Processes
from agonic.fleet.run import run_fleet
from agonic.fleet.settings import FleetSettings
from tests.fleet.boards import run_here, write_boards
from tests.fleet.deadly import deadly_once, fatal, squared


def test_each_task_has_its_result_once() -> None:
    done = list(Processes(2).run(squared, range(500)))
    assert sorted(done) == [(n, n * n) for n in range(500)]


def test_few_tasks_wait_at_a_time() -> None:
    taken = 0

    def tasks():
        nonlocal taken
        for n in range(400):
            taken += 1
            yield n

    for done, _ in enumerate(Processes(2).run(squared, tasks()), start=1):
        assert taken - done <= 2 * 4


def test_a_process_that_is_killed_costs_nothing(tmp_path: Path) -> None:
    """Each of five tasks ends its process the first time."""
    done = list(Processes(2).run(partial(deadly_once, folder=str(tmp_path)), range(60)))
    assert sorted(done) == [(n, n) for n in range(60)]
    assert len(list(tmp_path.iterdir())) == 5


def test_a_task_that_ends_its_process_twice_is_lost_alone() -> None:
    done = dict(Processes(2).run(fatal, range(60)))
    assert {n for n, result in done.items() if isinstance(result, Lost)} == {7, 8, 31}
    assert all(result == n for n, result in done.items() if n not in (7, 8, 31))


def test_what_the_work_raises_ends_the_run_and_all_processes() -> None:
    with pytest.raises(AgonicError, match="not a number"):
        list(Processes(2).run(int, ["1", "not a number", "3"]))
    assert not children()


def test_closing_ends_all_processes() -> None:
    running = Processes(2).run(time.sleep, [0.0, 86_400.0, 86_400.0, 86_400.0])
    next(running)
    assert len(children()) == 2
    running.close()
    assert not children()


def test_a_task_that_hangs_is_lost_alone_and_in_time() -> None:
    """Each of its neighbours has its result, and the run ends."""
    naps = [0.0] * 50 + [86_400.0] + [0.001] * 50
    done = list(Processes(2, longest_s=5.0).run(time.sleep, naps))
    lost = [(nap, result) for nap, result in done if isinstance(result, Lost)]
    assert len(done) == len(naps)
    assert [nap for nap, _ in lost] == [86_400.0]
    assert "longer than 5 s" in lost[0][1].sentence
    assert "--timeout" in lost[0][1].sentence
    assert not children()


def test_a_script_without_a_guard_may_start_processes(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from agonic.fleet.engine import Processes\nprint(dict(Processes(1).run(abs, [-1])))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("{-1: 1}\n", "")


def test_a_log_that_hangs_is_a_row_that_says_so(tmp_path: Path) -> None:
    write_boards(tmp_path / "logs", 3)
    out = tmp_path / "out"
    done = run_fleet([tmp_path / "logs"], out, engine=Processes(2, longest_s=0.001))
    assert done.population["verdict"].tolist() == ["refused"] * 3
    assert all("the time limit of one log" in status for status in done.population["status"])
    again = run_fleet([tmp_path / "logs"], out, engine=Processes(2))
    assert again.population["verdict"].tolist() == ["good"] * 3


@pytest.mark.slow
def test_the_table_is_that_of_one_process(tmp_path: Path) -> None:
    write_boards(tmp_path / "logs", 8)
    here = run_here(tmp_path / "logs", out=tmp_path / "here")
    both = run_fleet([tmp_path / "logs"], tmp_path / "both", engine=Processes(2))
    assert here.table.read_bytes() == both.table.read_bytes()


@pytest.mark.slow
def test_an_interruption_leaves_no_process_and_a_journal(tmp_path: Path) -> None:
    write_boards(tmp_path / "logs", 24)
    command = [sys.executable, "-m", "agonic", "fleet", "logs", "-o", "out", "--workers", "2"]
    process = subprocess.Popen(
        command, cwd=tmp_path, start_new_session=True, stderr=subprocess.PIPE, text=True
    )
    while not (tmp_path / "out" / "journal.sqlite").exists():
        time.sleep(0.01)
    time.sleep(0.5)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    _, said = process.communicate(timeout=20)
    assert process.returncode == 2
    assert said.startswith("agonic: interrupted; the same command goes on")
    assert said.count("\n") == 1
    end = time.monotonic() + 15
    while of_group(process.pid):  # the server of processes may still be importing
        assert time.monotonic() < end
        time.sleep(0.05)
    assert len(run_here(tmp_path / "logs", out=tmp_path / "out").population) == 24


def test_logs_are_found_from_wherever_one_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_boards(tmp_path / "logs", 2)
    monkeypatch.chdir(tmp_path)
    settings = FleetSettings(files=True)
    run = run_fleet(["logs"], "out", settings=settings, engine=Processes(2))
    assert run.population["source"].tolist() == ["logs/board000.csv", "logs/board001.csv"]
    assert all(Path("out", str(path)).is_file() for path in run.population["calibration"])


def of_group(group: int) -> list[str]:
    """The processes of a group that run."""
    found = subprocess.run(
        ["ps", "-e", "-o", "pgid=,stat=,args="], capture_output=True, text=True, check=True
    ).stdout
    rows = [line.split(None, 2) for line in found.splitlines()]
    return [row[2] for row in rows if row[0] == str(group) and not row[1].startswith("Z")]


_BEFORE: set[int] = set()


@pytest.fixture(autouse=True)
def forget_what_reads_logs() -> None:
    """Earlier tests of this process may have left the one that reads logs waiting."""
    _BEFORE.clear()
    _BEFORE.update(process.pid for process in psutil.Process().children(recursive=True))


def children() -> list[psutil.Process]:
    """The processes that work for this one since a test began."""
    found = psutil.Process().children(recursive=True)
    new = [process for process in found if process.pid not in _BEFORE]
    running = [process for process in new if process.status() != psutil.STATUS_ZOMBIE]
    return [process for process in running if "child_process" in " ".join(process.cmdline())]
