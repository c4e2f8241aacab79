"""The file of a history: nothing is lost, nothing is counted twice, and nothing else is touched."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from agonic.errors import LogError
from agonic.population import History, Population, Row
from agonic.population.store_schema import UNDATED

DAY = datetime(2026, 3, 1, 12, 30, 0, 250, tzinfo=UTC)


def row(k: int, sensor: str = "7", **more: object) -> Row:
    return replace(
        Row(
            sensor=sensor,
            source=f"{k}.csv",
            sha256=f"{k:x}",
            key=f"key-{sensor}-{k}",
            start=DAY + timedelta(days=k),
            verdict="good",
            status="fine",
            rows=300,
            findings=("gap", "stuck"),
            device_id=197388,
            unit_in="nT",
            unit_out="nT",
            gauge="symmetric",
            model="full",
            bias_x=1.5 + k,
            bias_y=-2.0,
            bias_z=3.0,
            bias_x_sd=0.1,
            bias_y_sd=0.1,
            bias_z_sd=0.2,
            matrix_xx=1.0,
            matrix_yy=1.1,
            matrix_zz=0.9,
            matrix_xy=0.01,
            matrix_yx=0.01,
        ),
        **more,
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "boards.sqlite"


def test_rows_come_back_as_they_went_in_and_in_order_of_time(path: Path) -> None:
    rows = [row(k) for k in (3, 1, 2)] + [row(9, "8", device_id=None, bias_x=None)]
    with History.open(path) as history:
        assert history.add(rows) == 4
        back = list(history.of("7"))
        assert back == [row(1), row(2), row(3)]
        assert [type(getattr(back[0], f.name)) for f in fields(Row)] == [
            type(getattr(row(1), f.name)) for f in fields(Row)
        ]
        assert list(history.of("8")) == [rows[-1]]


def test_adding_again_changes_nothing(path: Path) -> None:
    rows = [row(k) for k in range(5)] + [row(9, sha256="", key="")]
    with History.open(path) as history:
        assert history.add(rows) == 6
        before = path.read_bytes()
        assert history.add(rows) == 0
        assert history.add(Population.of(rows)) == 0
        assert len(history.of("7")) == 6
    assert path.read_bytes() == before


def test_a_log_that_was_calibrated_anew_counts_once(path: Path) -> None:
    with History.open(path) as history:
        history.add([row(k) for k in range(3)])
        assert history.add([row(1, key="with another version", bias_x=77.0)]) == 1
        assert history.of("7")["bias_x"].tolist() == [1.5, 77.0, 3.5]
        assert history.sensors()[0].calibrations == 3
        # what was there first is known still, and does not come back
        assert history.add([row(1)]) == 0
        assert history.of("7")["bias_x"].tolist() == [1.5, 77.0, 3.5]
        # another stretch of the same log is another calibration
        assert history.add([row(1, key="later", start=DAY + timedelta(days=1, hours=2))]) == 1
        assert len(history.of("7")) == 4


def test_a_log_without_a_date_has_that_of_its_first_adding(path: Path) -> None:
    undated = row(1, start=None)
    with History.open(path) as history:
        history.add([undated, row(400)], now=DAY + timedelta(days=5))
        history.add([replace(undated, key="again")], now=DAY + timedelta(days=900))
        kept = history.of("7")
        assert kept["source"].tolist() == ["1.csv", "400.csv"]
        assert kept["start"][0] == DAY + timedelta(days=5)
        assert UNDATED.name in kept["findings"][0]
        assert UNDATED.name not in kept["findings"][1]


def test_latest_is_the_last_good_one_of_each_sensor(path: Path) -> None:
    with History.open(path) as history:
        history.add([row(k, sensor) for k in range(3) for sensor in "ab"])
        history.add(
            [
                row(4, "a", verdict="check"),
                row(5, "a", verdict="refused"),
                row(4, "c", verdict="check"),
                row(5, "d", verdict="refused"),
            ]
        )
        assert history.latest()["sensor"].tolist() == ["a", "b", "c"]
        assert history.latest()["source"].tolist() == ["2.csv", "2.csv", "4.csv"]
        assert history.latest(before=1)["source"].tolist() == ["1.csv", "1.csv"]
        kept = {one.sensor: one for one in history.sensors()}
        assert (kept["a"].calibrations, kept["a"].refused, kept["a"].verdict) == (5, 1, "refused")
        assert kept["a"].first == DAY
        assert kept["a"].last == DAY + timedelta(days=5)
        assert history.columns("sensor", "time")["sensor"].tolist() == [*"aaaabbbc"]


def test_missing_sensors_and_files_are_said(path: Path, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such"):
        History.open(path, new=False)
    assert not path.exists()
    with History.open(path) as history, pytest.raises(LogError, match="no sensor 'x'"):
        history.of("x")
    with pytest.raises(LogError, match=r"no folder .*create it"):
        History.open(tmp_path / "no" / "folder.sqlite")


def test_files_that_are_not_ours_are_left_alone(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.sqlite"
    with sqlite3.connect(other) as database:
        database.execute("CREATE TABLE calibration (x)")
    database.close()
    text = tmp_path / "notes.txt"
    text.write_text("no database at all, but longer than the head of one would be" * 9)
    for foreign in (other, text):
        before = foreign.read_bytes()
        with pytest.raises(LogError, match=r"no history|not a history"):
            History.open(foreign)
        assert foreign.read_bytes() == before
    History.open(path).close()
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA user_version = 99")
    database.close()
    with pytest.raises(LogError, match="later agonic"):
        History.open(path)


def test_damaged_rows_are_said_and_names_that_are_no_text_are_kept(path: Path) -> None:
    with History.open(path) as history:
        assert history.add([row(1), row(2), row(3, sensor="caf\udce9")]) == 3
        assert history.of("caf\udce9")["sensor"].tolist() == ["caf\\udce9"]
        with sqlite3.connect(path) as database:
            database.execute("UPDATE calibration SET start = 'yesterday' WHERE source = '2.csv'")
        database.close()
        with pytest.raises(LogError, match="damaged, a row"):
            history.of("7")
        with sqlite3.connect(path) as database:
            database.execute("UPDATE calibration SET bias_x = 'far' WHERE source = '2.csv'")
        database.close()
        with pytest.raises(LogError, match="damaged, a row"):
            history.columns("bias_x")


@pytest.mark.slow
def test_what_fails_half_way_leaves_nothing(path: Path) -> None:
    def rows():
        yield from (row(k) for k in range(20_000))
        raise RuntimeError("power cut")

    with History.open(path) as history:
        history.add([row(-1)])
        with pytest.raises(RuntimeError, match="power cut"):
            history.add(rows())
        assert len(history.of("7")) == 1


KILLED = """
import sys
sys.path.insert(0, {tests!r})
from tests.population.test_store import History, row
with History.open({path!r}) as history:
    for batch in range(10_000):
        history.add(row(k, f"s{{batch}}") for k in range(50))
        print(batch, flush=True)
"""


def test_what_add_returned_for_survives_a_kill(path: Path) -> None:
    code = KILLED.format(tests=str(Path(__file__).parents[2]), path=str(path))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout
    done = -1
    while done < 17:
        done = int(process.stdout.readline())
    time.sleep(0.003)
    os.kill(process.pid, signal.SIGKILL)
    rest = process.stdout.read().split()
    process.wait()
    process.stdout.close()
    done = max([done, *map(int, rest)])
    with History.open(path) as history:
        kept = history.sensors()
        assert len(kept) in (done + 1, done + 2)  # one may have been kept and not yet said
        assert all(one.calibrations == 50 for one in kept)
        assert history.add(row(k, "s0") for k in range(50)) == 0


def added(path: str, worker: int) -> int:
    total = 0
    for batch in range(20):
        with History.open(path) as history:
            own = [row(batch, f"w{worker}")]
            total += history.add([*own, row(batch, "shared")])
    return total


def test_processes_that_write_at_once_lose_nothing(path: Path) -> None:
    with ProcessPoolExecutor(4) as pool:
        totals = list(pool.map(added, [str(path)] * 4, range(4)))
    assert sum(totals) == 4 * 20 + 20
    with History.open(path) as history:
        assert [one.calibrations for one in history.sensors()] == [20] * 5


@pytest.mark.slow
def test_a_sensor_among_many_is_found_by_an_index(path: Path) -> None:
    """By the steps of the database, which do not depend on the machine: a scan takes 20 000."""
    with History.open(path) as history:
        history.add(row(k, f"s{number}") for number in range(2000) for k in range(10))
        steps: list[None] = []
        history._database.set_progress_handler(lambda: steps.append(None), 1)
        assert len(history.of("s1234")) == 10
        history._database.set_progress_handler(None, 1)
    assert 0 < len(steps) < 5000
