"""Reading an ArduPilot log of 17 MB: agonic beside pymavlink, in one run.

    python benchmarks/dataflash.py [LOG.bin]

pymavlink reads the messages one by one and is asked for the same types; without a log, one of half
an hour is made up.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from pymavlink.DFReader import DFReader_binary

from agonic.logs.ardupilot.dataflash import WANTED, read
from agonic.provenance import Input

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "io"))
from dataflash_writer import dataflash, parameters

SECONDS = 1600
REPEATS = 3


def flight() -> bytes:
    """Compass at 50 Hz, motion at 200, attitude at 50, place at 5."""
    rng = np.random.default_rng(0)
    t = {rate: 1e6 + np.arange(SECONDS * rate) * 1e6 / rate for rate in (5, 50, 200)}
    field = {f"Mag{axis}": rng.integers(-600, 600, len(t[50])) for axis in "XYZ"}
    return dataflash(
        parameters({"COMPASS_OFS_X": 10.5, "COMPASS_DIA_X": 1.0}),
        ("MAG", {"TimeUS": t[50], "Health": 1, "OfsX": 10, **field}),
        ("IMU", {"TimeUS": t[200], "AccZ": rng.normal(-9.81, 0.1, len(t[200]))}),
        ("ATT", {"TimeUS": t[50], "Yaw": rng.uniform(0, 360, len(t[50]))}),
        ("GPS", {"TimeUS": t[5], "Status": 3, "GWk": 2300, "Lat": 47.0, "Lng": 8.0}),
    )


def ours(path: Path) -> int:
    """Rows of the magnetometers, raw, with all columns beside them."""
    log = read(path, Input(name=path.name, sha256="", count=0))
    return sum(len(sensor) for sensor in log.sensors)


def theirs(path: Path) -> int:
    """Rows of the magnetometers, after decoding the same message types."""
    rows = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = DFReader_binary(str(path), zero_time_base=True)
        while (message := reader.recv_match(type=list(WANTED))) is not None:
            rows += message.get_type().startswith("MAG")
        reader.close()
    return rows


def timed(job: Callable[[Path], int], path: Path, repeats: int) -> tuple[int, float]:
    """Rows, and the best time, s."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        rows = job(path)
        best = min(best, time.perf_counter() - start)
    return rows, best


def main() -> None:
    """Print the table."""
    with TemporaryDirectory() as folder:
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder, "flight.bin")
        if not path.exists():
            path.write_bytes(flight())
        print(f"{path.name}, {path.stat().st_size / 1e6:.1f} MB\n")
        print(f"{'reader':<12}{'magnetometer rows':>20}{'time, s':>10}")
        for name, job, repeats in (("agonic", ours, REPEATS), ("pymavlink", theirs, 1)):
            rows, best = timed(job, path, repeats)
            print(f"{name:<12}{rows:>20}{best:>10.3f}")


if __name__ == "__main__":
    main()
