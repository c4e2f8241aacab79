"""How many small logs a second: python -m benchmarks.fleet_logs [--quick] [--logs N]."""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from agonic.exports.csv import write_csv
from agonic.fleet.engine import Dask, Engine, Processes
from agonic.fleet.inputs import JOURNAL
from agonic.fleet.run import FleetRun, Progress, run_fleet
from agonic.simulation import simulate
from benchmarks import tables

ROWS = 300
LOGS, QUICK = 2000, 200
WORKERS = 2
BARE = dict.fromkeys(
    ("roll_deg", "pitch_deg", "heading_deg", "rotation_rate")
)  # as a logger of boards
INTRODUCTION = """{logs} CSV files of {rows} readings each, one sensor a file, calibrated and
verified on held-out parts as `agonic calibrate` does it, by {workers} processes on {processors}
processors with one thread each. Seconds are from the start of the work to the table and the report,
with the start of processes or cluster."""


@dataclass
class Watch:
    """Kills a worker of a cluster when half of the logs are done."""

    half: int
    killed: int | None = None

    def __call__(self, progress: Progress) -> None:
        if self.killed is None and progress.done >= self.half:
            self.killed = _worker()
            os.kill(self.killed, signal.SIGKILL)


def main() -> None:
    """Write the logs, run each way, and print the table."""
    logs = _asked()
    with tempfile.TemporaryDirectory(prefix="agonic-bench-") as name:
        folder = Path(name)
        write_logs(folder / "logs", logs)
        print(
            INTRODUCTION.format(
                logs=logs, rows=ROWS, workers=WORKERS, processors=len(os.sched_getaffinity(0))
            )
        )
        print()
        print(tables.markdown(("run", "seconds", "logs a second", "table"), _rows(folder, logs)))
    own, below = (resource.getrusage(who).ru_maxrss / 1024 for who in (_SELF, _CHILDREN))
    print(f"\nLargest memory: {own:.0f} MB of the first process, {below:.0f} MB of any other.")


_SELF, _CHILDREN = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN


def _rows(folder: Path, logs: int) -> list[tuple[str, ...]]:
    """Each way of running, its seconds and its table."""
    seconds, run = _timed(folder, "local", Processes(WORKERS))
    whole, table = seconds, run.table.read_bytes()
    rows = [_row("local processes", seconds, logs, run, table)]
    rows.append(_row("… again, nothing changed", *_again(folder, logs), table))
    killed_s, seconds, run = _killed(folder, whole)
    name = f"… killed after {killed_s:.1f} s; the rest of it ({run.resumed} logs were done)"
    rows.append(_row(name, seconds, run.calibrated, run, table))
    seconds, run = _timed(folder, "dask", Dask(workers=WORKERS))
    more = f"{seconds / whole - 1:+.0%}"
    rows.append(_row(f"Dask, a cluster of its own ({more})", seconds, logs, run, table))
    watch = Watch(half=logs // 2)
    seconds, run = _timed(folder, "hurt", Dask(workers=WORKERS), watch)
    assert watch.killed is not None
    rows.append(_row("… one worker killed half-way", seconds, logs, run, table))
    return rows


def _row(name: str, seconds: float, logs: int, run: FleetRun, table: bytes) -> tuple[str, ...]:
    same = "the same" if run.table.read_bytes() == table else "ANOTHER"
    row = (name, f"{seconds:.1f}", f"{logs / seconds:.0f}", same)
    tables.progress(f"fleet_logs: {', '.join(row)}")
    return row


def _again(folder: Path, logs: int) -> tuple[float, int, FleetRun]:
    seconds, run = _timed(folder, "local", Processes(WORKERS))
    assert run.resumed == logs
    return seconds, logs, run


def _timed(
    folder: Path, out: str, engine: Engine, watch: Watch | None = None
) -> tuple[float, FleetRun]:
    begun = time.perf_counter()
    run = run_fleet([folder / "logs"], folder / out, engine=engine, progress=watch)
    return time.perf_counter() - begun, run


def _killed(folder: Path, whole: float) -> tuple[float, float, FleetRun]:
    """A run that is killed at a random moment: when, and the seconds and the run that end it."""
    out = folder / "killed"
    command = [sys.executable, "-m", "agonic", "fleet", str(folder / "logs"), "-o", str(out)]
    process = subprocess.Popen([*command, "--workers", str(WORKERS)], stdout=subprocess.DEVNULL)
    while not (out / JOURNAL).exists():
        time.sleep(0.01)
    moment = random.Random(9).uniform(0.3, 0.8) * whole
    time.sleep(moment)
    process.kill()
    process.wait()
    return (moment, *_timed(folder, "killed", Processes(WORKERS)))


def _worker() -> int:
    """A process of the cluster of this process."""
    below = psutil.Process().children(recursive=True)
    return int(next(p.pid for p in below if any("spawn_main" in part for part in p.cmdline())))


def write_logs(folder: Path, n: int) -> None:
    """Logs of boards turned by hand in a laboratory."""
    folder.mkdir()
    for seed in range(n):
        made = simulate("sphere", n=ROWS, seed=seed)
        write_csv(made.samples.with_columns(**BARE), folder / f"board{seed:06}.csv")


def _asked() -> int:
    parser = argparse.ArgumentParser(description="logs a second of a fleet")
    parser.add_argument("--logs", type=int, default=LOGS, help="default: %(default)s")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} logs")
    asked = parser.parse_args()
    return QUICK if asked.quick else int(asked.logs)


if __name__ == "__main__":
    main()
