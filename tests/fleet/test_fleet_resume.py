"""A run that was cut off goes on, and ends with the same table byte for byte."""

import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from agonic.errors import AgonicError
from agonic.fleet import one_log
from agonic.fleet.inputs import JOURNAL
from agonic.fleet.journal import Journal
from agonic.fleet.run import run_fleet
from agonic.fleet.settings import FleetRun, FleetSettings
from tests.fleet.boards import run_here, write_bad, write_boards

LOGS = 9


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with logs, good, bad and twice the same, and the table of an unbroken run."""
    folder = tmp_path_factory.mktemp("fleet")
    write_boards(folder / "logs", LOGS)
    write_bad(folder / "logs")
    shutil.copy(folder / "logs" / "board003.csv", folder / "logs" / "same.csv")
    run_here(folder / "logs", out=folder / "unbroken")
    return folder


def table(run: FleetRun) -> bytes:
    return run.table.read_bytes()


def wait_for(path: Path, process: subprocess.Popen[bytes]) -> None:
    while not path.exists():
        assert process.poll() is None
        time.sleep(0.01)


def test_a_killed_run_goes_on_where_it_was(fleet: Path, tmp_path: Path) -> None:
    """With workers and without; the test below kills one process between any two logs."""
    draw = random.Random(1)
    out = tmp_path / "out"
    arguments = [sys.executable, "-m", "agonic", "fleet", str(fleet / "logs"), "-o", str(out)]
    for workers in ("2", "0"):
        process = subprocess.Popen([*arguments, "--workers", workers])
        wait_for(out / JOURNAL, process)
        time.sleep(draw.uniform(0.0, 1.2))
        process.send_signal(signal.SIGKILL)
        process.wait()
    run = run_here(fleet / "logs", out=out)
    assert table(run) == (fleet / "unbroken" / "fleet.parquet").read_bytes()
    assert run.calibrated + run.resumed + run.repeated == len(run.population)


@pytest.mark.slow
def test_a_kill_between_any_two_logs_changes_nothing(
    fleet: Path, tmp_path: Path, monkeypatch
) -> None:
    out, finished = tmp_path / "out", 0
    while not (out / "fleet.parquet").exists():
        child = os.fork()
        if child == 0:
            left = [3]

            def told(_: object, left: list[int] = left) -> None:
                left[0] -= 1
                if not left[0]:
                    os.kill(os.getpid(), signal.SIGKILL)

            monkeypatch.setattr("agonic.fleet.journal.COMMIT_S", 0.0)
            run_here(fleet / "logs", out=out, progress=told)
            os._exit(0)
        os.waitpid(child, 0)
        finished += 1
    assert finished > LOGS / 4
    assert (out / "fleet.parquet").read_bytes() == (
        fleet / "unbroken" / "fleet.parquet"
    ).read_bytes()


@pytest.mark.slow
def test_finished_logs_are_not_read_again(fleet: Path, tmp_path: Path, monkeypatch) -> None:
    out = tmp_path / "out"
    first = run_here(fleet / "logs", out=out)
    assert first.repeated == 1  # calibrated once, a row each
    rows = {Path(row.source).stem: row for row in first.population}
    assert rows["same"].bias_x == rows["board003"].bias_x
    assert rows["same"].key == rows["board003"].key

    def never(*_: object, **__: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr("agonic.fleet.run.hash_file", never)
    monkeypatch.setattr("agonic.fleet.run.calibrate_log", never)
    again = run_here(fleet / "logs", out=out)
    assert (again.calibrated, again.resumed) == (0, len(first.population))
    assert table(again) == table(first)


@pytest.mark.slow
def test_what_counts_is_the_content(fleet: Path, tmp_path: Path) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    shutil.copytree(fleet / "logs", logs)
    first = run_here(logs, out=out)
    os.utime(logs / "board000.csv")  # touched
    (logs / "board001.csv").rename(logs / "moved.csv")
    text = (logs / "board002.csv").read_text()
    (logs / "board002.csv").write_text(text.replace("\n1.", "\n1.0", 1))  # another reading or time
    again = run_here(logs, out=out)
    assert again.calibrated == 1
    assert "moved" in again.population["sensor"]
    before = {row.sensor: row for row in first.population}
    after = {row.sensor: row for row in again.population}
    assert after["board000"] == before["board000"]
    assert after["moved"].bias_x == before["board001"].bias_x
    assert after["board002"].sha256 != before["board002"].sha256


@pytest.mark.slow
def test_other_settings_are_other_work_and_the_old_is_kept(fleet: Path, tmp_path: Path) -> None:
    logs, out = fleet / "logs" / "board00[0-4].csv", tmp_path / "out"
    first = run_here(logs, out=out)
    in_field = run_here(logs, out=out, settings=FleetSettings(field_nT=50_000.0))
    assert (in_field.calibrated, in_field.resumed) == (5, 0)
    assert in_field.population["magnitude"].tolist() == [50_000.0] * 5
    back = run_here(logs, out=out)
    assert (back.calibrated, back.resumed) == (0, 5)
    assert table(back) == table(first)
    # who the sensors are is not part of the work
    named = run_here(logs, out=out, settings=FleetSettings(name=r"board(\d+)"))
    assert named.calibrated == 0
    assert named.population["sensor"].tolist() == [f"{n:03}" for n in range(5)]


def test_another_version_is_other_work(fleet: Path, tmp_path: Path, monkeypatch) -> None:
    logs, out = fleet / "logs" / "board00[0-1].csv", tmp_path / "out"
    run_here(logs, out=out)
    monkeypatch.setattr("agonic.fleet.settings.__version__", "99.0")
    assert run_here(logs, out=out).calibrated == 2


def test_a_log_without_date_keeps_the_date_of_the_first_run(fleet: Path, tmp_path: Path) -> None:
    settings = FleetSettings(at=(52.0, 5.0, 0.0))
    with Journal(tmp_path / JOURNAL, work=settings.work) as journal:
        journal.undated("2025-01-01")
    log = fleet / "logs" / "board000.csv"
    (row,) = run_here(log, out=tmp_path, settings=settings).population
    dated = FleetSettings(at=(52.0, 5.0, 0.0), date="2025-01-01")
    (wanted,) = run_here(log, out=tmp_path / "dated", settings=dated).population
    assert row.magnitude == wanted.magnitude


def test_what_may_pass_is_tried_again(fleet: Path, tmp_path: Path, monkeypatch) -> None:
    log, out = fleet / "logs" / "board000.csv", tmp_path / "out"

    def exhausted(*_: object, **__: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patched:
        patched.setattr(one_log, "calibrate", exhausted)
        assert run_here(log, out=out).population["verdict"].tolist() == ["refused"]
    assert run_here(log, out=out).population["verdict"].tolist() != ["refused"]


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path) -> None:
    write_boards(tmp_path / "logs", 1)
    (tmp_path / "out").mkdir()
    with (
        Journal(tmp_path / "out" / JOURNAL, work="w"),
        pytest.raises(AgonicError, match="another run"),
    ):
        run_fleet([tmp_path / "logs"], tmp_path / "out")


@pytest.mark.parametrize("damage", ["text", "rows"])
def test_a_damaged_journal_is_said_to_be_one(tmp_path: Path, damage: str) -> None:
    write_boards(tmp_path / "logs", 1)
    out = tmp_path / "out"
    run_here(tmp_path / "logs", out=out)
    if damage == "text":
        (out / JOURNAL).write_text("this is no database, but long enough to be taken for one" * 9)
    else:
        with sqlite3.connect(out / JOURNAL) as db:
            db.execute("update rows set row = x'00'")
        db.close()
    with pytest.raises(AgonicError, match="delete it"):
        run_here(tmp_path / "logs", out=out)
