"""A cluster of 2, 4 and 8 workers: python -m benchmarks.fleet_workers [--quick] [--logs N].

By processor time and bytes, which other work and few cores do not change: what more workers cost,
and what 10¹² readings would.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from agonic.fleet.engine import Dask
from agonic.fleet.run import run_fleet
from benchmarks import tables
from benchmarks.fleet_logs import ROWS, write_logs
from benchmarks.fleet_recording import Case, write

WORKERS = (2, 4, 8)
LOGS, QUICK = 320, 64
BATCH = 4
FEW = BATCH * max(WORKERS)
"""Logs of the short run, one batch for each worker: its cost is that of the start."""
INTRODUCTION = """CSV files of {rows} readings each, by Dask on one machine of {cores} cores,
workers with one thread each, the logs read by the workers. Two runs, of {few} and {many} logs:
their difference is what a log costs once the workers are started, in processor time of all
processes, and of scheduler and client alone. Bytes are those that scheduler and client send and
receive; readings never move, only names of files and rows of the table."""
HEADER = (
    "workers",
    "start, processor s",
    "a log, processor ms",
    "of it scheduler, ms",
    "moved a log, kB",
    "moved a reading, bytes",
    "logs a second and processor",
)


class Spent(NamedTuple):
    """Processor time of all processes and of this one, s; bytes in and out of this one."""

    all: float
    own: float
    moved: int


@contextmanager
def counted() -> Iterator[list[int]]:
    """Bytes that Dask's connections of this process carry, in both directions."""
    from distributed.comm import tcp

    total = [0]
    write, read = tcp.TCP.write, tcp.read_bytes_rw

    async def count_written(self: Any, *given: Any, **more: Any) -> int:
        sent = await write(self, *given, **more)
        total[0] += sent
        return int(sent)

    async def count_read(stream: Any, n: int) -> Any:
        total[0] += n
        return await read(stream, n)

    tcp.TCP.write, tcp.read_bytes_rw = count_written, count_read
    try:
        yield total
    finally:
        tcp.TCP.write, tcp.read_bytes_rw = write, read


def measure(logs: list[Path], out: Path, workers: int) -> Spent:
    """One run, with the start and the end of its cluster."""
    own, below = time.process_time(), _below()
    with counted() as moved:
        run = run_fleet(logs, out, engine=Dask(workers=workers, batch=BATCH))
    assert run.calibrated == len(logs)
    own = time.process_time() - own
    return Spent(own + _below() - below, own, moved[0])


def _below() -> float:
    """Processor time of the processes that ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def rows(folder: Path, many: int) -> list[tuple[str, ...]]:
    """A line for each number of workers."""
    logs = sorted((folder / "logs").iterdir())
    lines = []
    for workers in WORKERS:
        tables.progress(f"fleet_workers: {workers}")
        few = measure(logs[:FEW], folder / f"few{workers}", workers)
        all_ = measure(logs[:many], folder / f"many{workers}", workers)
        each, own, moved = ((all_[k] - few[k]) / (many - FEW) for k in range(3))
        lines.append(
            (
                str(workers),
                f"{few.all - FEW * each:.1f}",
                f"{1e3 * each:.1f}",
                f"{1e3 * own:.2f}",
                f"{moved / 1e3:.2f}",
                f"{moved / ROWS:.1f}",
                f"{1 / each:.0f}",
            )
        )
    return lines


# --- 10¹² readings -----------------------------------------------------------------------------

COST = """## What 10¹² readings would cost

In processor time, by the figures of this table, of one dataset (`fleet_dataset.md`) and of one
recording (`fleet_recording.md`), each linear in its rows. A processor-day is one core for a day:
divide by the number of cores. Small logs are calibrated and verified on held-out parts one by one;
a dataset of many sensors is fitted from its moments, and by rows where these leave a doubt."""


def find(name: str, pattern: str) -> float:
    """A figure of a kept table; not a number where there is none."""
    path = tables.RESULTS / f"{name}.md"
    found = re.search(pattern, path.read_text(encoding="utf-8")) if path.exists() else None
    return float(found[1]) if found else float("nan")


def costs(log_ms: float) -> dict[str, float]:
    """Processor time of a reading, s, by the way it is fitted."""
    busy = r"at\s+work for\s+[\d.]+\s+and\s+([\d.]+) ns"
    sensors = find("fleet_dataset", r"(\d+) sensors, 200 readings each")
    of_dataset = find("fleet_dataset", r"\| sensor after sensor \| [\d.]+ \| ([\d.]+)")
    return {
        "one recording": 1e-9 * find("fleet_recording", busy),
        "sensors of 200 readings in one dataset": of_dataset / sensors / 200,
        f"small logs of {ROWS} readings, by Dask": 1e-3 * log_ms / ROWS,
    }


def cost_table(log_ms: float) -> str:
    """Time of 10¹² readings, and what a cluster of a thousand cores takes."""
    lines = [
        (name, f"{1e9 * each:.3g}", f"{1e12 * each / 86_400:.3g}", _duration(1e9 * each))
        for name, each in costs(log_ms).items()
    ]
    head = ("readings in", "a reading, ns", "processor-days", "a thousand cores")
    return tables.markdown(head, lines)


STORED = """In Parquet (time and three axes, float64, zstd) a reading takes {size:.1f} bytes: 10¹²
are {size:.0f} TB, which the fit reads once."""


def bytes_of_reading() -> float:
    """The size of a recording over its readings."""
    n = 1_000_000
    with TemporaryDirectory() as folder:
        path = Path(folder, "recording.parquet")
        write(Case(n), path)
        return path.stat().st_size / n


def _duration(seconds: float) -> str:
    """A time in words.

    >>> _duration(90), _duration(7200)
    ('1.5 min', '2 h')
    """
    for size, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def main() -> None:
    """Write the logs, run each cluster twice, print both tables."""
    parser = argparse.ArgumentParser(description="2, 4 and 8 workers")
    parser.add_argument("--logs", type=int, default=LOGS, help="default: %(default)s")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} logs")
    asked = parser.parse_args()
    many = QUICK if asked.quick else max(asked.logs, 2 * FEW)
    with TemporaryDirectory(prefix="agonic-bench-") as name:
        write_logs(Path(name) / "logs", many)
        lines = rows(Path(name), many)
    print(INTRODUCTION.format(rows=ROWS, cores=os.cpu_count(), few=FEW, many=many) + "\n")
    print(tables.markdown(HEADER, lines))
    print(f"\n{COST}\n\n{cost_table(float(lines[0][2]))}")
    print("\n" + STORED.format(size=bytes_of_reading()))


if __name__ == "__main__":
    main()
