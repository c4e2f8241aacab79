"""One dataset of many sensors: time and memory, and what fits to moments leave to the rows.

python -m benchmarks.fleet_dataset [--draws 1] [--quick]
"""

from __future__ import annotations

import multiprocessing as mp
import os
import resource
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.parquet import ParquetWriter

from agonic.ellipsoid import fit_moments
from agonic.errors import AgonicError
from agonic.fleet.dataset import calibrate_dataset
from agonic.fleet.settings import FleetSettings
from agonic.fleet.simulation.files import make_tables as columns_of
from agonic.fleet.simulation.simulate import SimulatedFleet, simulate_fleet
from agonic.moments import Moments
from agonic.population import Population, write_population
from benchmarks import tables

Array = NDArray[np.float64]

SENSORS, ROWS = 100_000, 200
FIELD = 50_000.0
COMPARED = 500
CHUNK = 1_000_000  # rows drawn at once

INTRODUCTION = """\
{sensors} sensors, {rows} readings each (float32, with time and temperature), soft iron of 4 %,
noise of 100 to 300 nT, biases of 15 000 nT: all fitted from the moments that DuckDB sums, sensors
in doubt by their rows. Time on the clock and of processors, from the file's name to the table on
disk, on {cores} cores with a load of {load:.1f} from other work when it began; memory is the peak
of the process, that of the processes for single rows aside. Stages in seconds on the clock."""

COMPARISON = """## What the rows would have changed

A simulated fleet of {n} boards, 300 readings each, every ninth or so broken or with exchanged axes,
and a mixed one of {m} sensors (40 to 1500 readings, noise of 30 to 1500 nT, a third in one
hemisphere, drifting, with correlated noise, outliers, or a bias that jumps): every sensor by
moments and by its rows. "Kept" are those that no doubt sends to their rows; z is the largest
difference of any of nine parameters over the standard error by rows."""


def readings(sensors: int, rows: int, together: bool) -> Iterator[dict[str, Any]]:
    """The readings as columns, sensor after sensor or all sensors at each moment."""
    rng = np.random.default_rng(0)
    bias, noise = rng.normal(0, 15_000, (sensors, 3)), rng.uniform(100, 300, sensors)
    skew = rng.normal(0, 0.04, (sensors, 3, 3))
    shape = np.eye(3) + (skew + np.swapaxes(skew, 1, 2)) / 2
    for start in range(0, sensors * rows, CHUNK):
        place = np.arange(start, min(start + CHUNK, sensors * rows))
        which, moment = (
            (place // rows, place % rows) if together else (place % sensors, place // sensors)
        )
        u = rng.normal(size=(len(place), 3))
        u *= FIELD / np.linalg.norm(u, axis=1, keepdims=True)
        raw = np.einsum("nij,nj->ni", shape[which], u) + bias[which]
        raw += noise[which, None] * rng.normal(size=u.shape)
        axes = {f"mag_{a}_nT": raw[:, i].astype(np.float32) for i, a in enumerate("xyz")}
        warm = np.full(len(place), 20.0, dtype=np.float32)
        yield {"sensor": which, "time_s": moment * 0.1, **axes, "temperature_C": warm}


def mixed(n: int) -> Iterator[dict[str, Any]]:
    """Sensors of many sizes and noises, most with something that is not white noise."""
    rng = np.random.default_rng(5)
    for k in range(n):
        rows, noise = int(rng.integers(40, 1500)), np.exp(rng.uniform(np.log(30), np.log(1500)))
        z = rng.uniform(-0.3 if k % 3 == 0 else -1, 1, rows)
        z = np.sort(z) if k % 2 else z
        along = np.cumsum(rng.normal(0, 0.5, rows))
        u = np.sqrt(1 - z**2) * np.stack([np.cos(along), np.sin(along), z / np.sqrt(1 - z**2)])
        skew = rng.normal(0, 0.05, (3, 3))
        raw = FIELD * u.T @ (np.eye(3) + (skew + skew.T) / 2) + rng.normal(0, 15_000, 3)
        raw += noise * rng.normal(size=raw.shape)
        late = np.arange(rows)[:, None] / rows
        fault = k % 7
        if fault == 1:
            raw += late * rng.normal(0, 300, 3)
        elif fault == 2:
            steps = rng.normal(size=(rows + 12, 3)).cumsum(axis=0)
            raw += noise * (steps[12:] - steps[:-12]) / np.sqrt(12)
        elif fault == 3:
            raw += (rng.random((rows, 1)) < 0.03) * rng.normal(0, 8000, (rows, 3))
        elif fault in (4, 5):
            raw += (late > 0.4) * rng.normal(0, 2000 if fault == 4 else 400, 3)
        axes = {f"mag_{a}_nT": raw[:, i] for i, a in enumerate("xyz")}
        yield {"sensor": np.full(rows, k), "time_s": np.arange(rows) * 0.1, **axes}


def kept(path: Path, parts: Iterator[Any]) -> Path:
    """The parts as one Parquet file."""
    writer = None
    for part in parts:
        table = pa.table(dict(part))
        writer = writer or ParquetWriter(path, table.schema)
        writer.write_table(table)
    assert writer is not None
    writer.close()
    return path


def measured(path: Path) -> tuple[dict[str, float], Population]:
    """Seconds by stage, in all and of processors, peak in MB, and the table."""
    begun, busy = time.perf_counter(), time.process_time()
    stages: dict[str, float] = {}

    def tell(stage: str, done: int, total: int) -> None:
        stages.setdefault(stage, time.perf_counter() - begun)

    table = calibrate_dataset(path, FleetSettings(field_nT=FIELD), progress=tell)
    write_population(table, path.with_suffix(".table.parquet"))
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = {
        "all": time.perf_counter() - begun,
        "processors": time.process_time() - busy + children.ru_utime + children.ru_stime,
        "MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }
    edges = [*stages.values(), told["all"]]
    told |= dict(zip(stages, np.diff(edges), strict=True))
    return told, table


def _send(path: Path, pipe: Any) -> None:
    told, table = measured(path)
    told["by rows"] = float((table["method"] != "adjusted").sum())
    told["good"] = float((table["verdict"] == "good").sum())
    pipe.send(told)


def size_table(sensors: int, rows: int, folder: Path) -> str:
    """Both orders of rows, each in a process of its own."""
    stages = ("hashing", "summing", "fitting", "checking", "calibrating by rows")
    lines = []
    for name, together in (("sensor after sensor", True), ("all sensors at each moment", False)):
        tables.progress(f"fleet_dataset: {name}")
        path = kept(folder / "a.parquet", readings(sensors, rows, together))
        ours, theirs = mp.Pipe()
        work = mp.get_context("spawn").Process(target=_send, args=(path, theirs))
        work.start()
        told = ours.recv()
        work.join()
        lines.append(
            (
                name,
                f"{told['all']:.1f}",
                f"{told['processors']:.1f}",
                f"{told['MB']:.0f}",
                *(f"{told.get(stage, 0.0):.1f}" for stage in stages),
                f"{told['by rows']:.0f}",
                f"{told['good']:.0f}",
            )
        )
    head = ("order of rows", "s", "processor s", "MB", *stages, "sensors by rows", "good")
    return tables.markdown(head, lines)


def compared(name: str, path: Path, settings: FleetSettings) -> list[str]:
    """How many are kept, and how they differ from what their rows say."""
    tables.progress(f"fleet_dataset: {name} by rows")
    found = calibrate_dataset(path, settings)
    rows = calibrate_dataset(path, settings, refine="all")
    alone = calibrate_dataset(path, settings, refine="none")
    kept = found["method"] == "adjusted"
    z = _over_sd(found, rows)[kept]
    all_z = _over_sd(alone, rows)[~kept]
    worst = np.nanmax(z, axis=1)
    other = int((found["verdict"] != rows["verdict"]).sum())
    without = int(((alone["verdict"] == "good") != (rows["verdict"] == "good")).sum())
    lost = all_z[np.isfinite(all_z).all(axis=1)]
    return [
        name,
        str(len(found)),
        str(int(kept.sum())),
        f"{np.sqrt(np.nanmean(z**2)):.3f}",
        f"{np.percentile(worst, 99):.2f}",
        f"{worst.max():.2f}",
        str(int((found["model"] != rows["model"])[kept].sum())),
        str(other),
        str(without),
        f"{np.median(np.abs(lost).max(axis=1)):.2f}",
    ]


def _over_sd(left: Population, right: Population) -> Array:
    """Differences of bias and of six entries of the matrix, over their standard errors."""
    upper = [0, 4, 8, 1, 2, 5]
    matrix = (left.matrix - right.matrix).reshape(-1, 9)[:, upper]
    sd = np.hstack([right.bias_sd, right.matrix_sd.reshape(-1, 9)[:, upper]])
    difference = np.hstack([left.bias - right.bias, matrix])
    return np.abs(difference) / np.where(sd > 0, sd, np.nan)


def comparison(n: int, folder: Path) -> str:
    """Two fleets, by moments and by rows."""
    fleet: SimulatedFleet = simulate_fleet(
        n, broken=0.08, swapped=0.03, duplicated=0.0, damaged=0.01, seed=3
    )
    laboratory = kept(folder / "fleet.parquet", columns_of(fleet))
    lines = [
        compared("laboratory", laboratory, FleetSettings(field_nT=48_000.0)),
        compared("mixed", kept(folder / "mixed.parquet", mixed(n)), FleetSettings()),
    ]
    head = (
        "fleet",
        "sensors",
        "kept",
        "kept: rms z",
        "99 % of z below",
        "largest z",
        "other model",
        "other verdict",
        "without rows, other",
        "others by moments: median z",
    )
    return tables.markdown(head, lines)


CENTRES = """## One centre for all sensors, or one for each

The noise of a sensor (150 nT in 50 000 nT, 300 readings), told by moments about a centre so far
from its own middle and moved there, against the same about its middle: the largest relative
difference of 200 draws. The sums need a pass for the middles first; one common centre would not."""


def centre_table() -> str:
    """What rounding makes of the noise, by the distance of the centre over the field."""
    lines = []
    for distance in (0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
        worst = max(_rounding(distance, seed) for seed in range(200))
        lines.append((f"{distance:g}", f"{worst:.1e}"))
    return tables.markdown(("distance over field", "change of the noise"), lines)


def _rounding(distance: float, seed: int) -> float:
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(300, 3))
    raw = FIELD * u / np.linalg.norm(u, axis=1, keepdims=True) + 150 * rng.normal(size=u.shape)
    away = FIELD * distance * np.array([0.6, -0.64, 0.48])
    noises = []
    for centre in (raw.mean(axis=0), away):
        moments = Moments.of(raw, centre=centre, scale=FIELD)
        try:
            noises.append(fit_moments(moments, model="full").noise)
        except AgonicError:
            return np.inf
    return abs(noises[1] / noises[0] - 1)


def main() -> None:
    """Print the tables."""
    asked = tables.arguments("one dataset of many sensors", draws=1)
    warnings.simplefilter("ignore")
    sensors, n = (5000, 100) if asked.quick else (SENSORS, COMPARED)
    introduction = INTRODUCTION.format(
        sensors=sensors, rows=ROWS, cores=os.cpu_count(), load=os.getloadavg()[0]
    )
    with TemporaryDirectory() as name:
        folder = Path(name)
        parts = [
            introduction,
            size_table(sensors, ROWS, folder),
            COMPARISON.format(n=n, m=n),
            comparison(n, folder),
            CENTRES,
            centre_table(),
        ]
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
