"""One recording of one magnetometer, from 10⁵ to 10⁸ rows: cost over the reading alone.

python -m benchmarks.fleet_recording [--largest 1e8] [--quick] [--full]

Writes docs/_static/cost.svg where it ran up to the largest.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import tables

Array = NDArray[np.float64]

PICTURE = Path(__file__).parent.parent / "docs" / "_static" / "cost.svg"
SIZES = (100_000, 1_000_000, 10_000_000, 100_000_000)
CHUNK = 1 << 20
NAMES = ("time_s", "mag_x_nT", "mag_y_nT", "mag_z_nT")
BIAS = np.array([3000.0, -500.0, 100.0])
MATRIX = np.eye(3) + 0.05 * np.array([[0.3, 0.2, -0.1], [0.2, -0.5, 0.4], [-0.1, 0.4, 0.6]])
FIELD, NOISE = 50_000.0, 100.0
INTRODUCTION = """One magnetometer at 50 Hz in one Parquet file: time and three axes, row groups of
2²⁰ rows; a soft iron of some per cent, noise {noise:.0f} nT. Every figure is wall time in a process
of its own, rounds: {rounds}, of which the best, the steps of one after the other; the file is in
the system's cache. Reading is `pyarrow.parquet.ParquetFile.iter_batches` over the same four columns
with its default settings (it decodes on all cores). The fit starts with nothing loaded of pyarrow.
Checksums of the files, for the record of origin, are taken by `open_mission` before.
Memory is the largest resident size of the process, shared libraries included. {cores} cores,
load average at the start {load:.1f}, at the end {{load:.1f}}."""


class Case(NamedTuple):
    """A file to be made: rows, how pages are compressed, bytes of a reading."""

    rows: int
    codec: str = "zstd"
    width: int = 8

    @property
    def name(self) -> str:
        return f"{self.codec}, float{8 * self.width}"


class Spent(NamedTuple):
    """Wall time and processor time, s, and largest memory, MB, of a process; error over standard
    error."""

    seconds: float
    busy: float
    memory: float
    error: float = 0.0


def write(case: Case, path: Path) -> None:
    """Write the recording in chunks."""
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    rng = np.random.default_rng(case.rows)
    inverse = np.linalg.inv(MATRIX)
    kind = pa.float64() if case.width == 8 else pa.float32()
    schema = pa.schema([(NAMES[0], pa.float64()), *((name, kind) for name in NAMES[1:])])
    with ParquetWriter(path, schema, compression=case.codec) as writer:
        for start in range(0, case.rows, CHUNK):
            n = min(CHUNK, case.rows - start)
            to = rng.standard_normal((n, 3))
            to *= FIELD / np.linalg.norm(to, axis=1)[:, None]
            raw = to @ inverse.T + BIAS + NOISE * rng.standard_normal((n, 3))
            axes = [raw[:, i].astype(kind.to_pandas_dtype()) for i in range(3)]
            writer.write_table(pa.table([(start + np.arange(n)) / 50.0, *axes], schema=schema))


# --- what is timed, each in a process of its own -----------------------------------------------


class Clock:
    """Wall and processor time since it was made."""

    def __init__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    def spent(self) -> tuple[float, float]:
        """Both, s."""
        wall, busy = self._begun
        return time.perf_counter() - wall, time.process_time() - busy


def reading(path: Path) -> Spent:
    """The four columns, batch by batch, and nothing else."""
    from pyarrow.parquet import ParquetFile

    clock = Clock()
    with ParquetFile(path, pre_buffer=False) as file:
        for _ in file.iter_batches(columns=list(NAMES)):
            pass
    return Spent(*clock.spent(), peak_MB())


def opening(path: Path) -> Spent:
    """The checksum."""
    from agonic.logs.large.mission import open_mission

    clock = Clock()
    open_mission([path])
    return Spent(*clock.spent(), peak_MB())


def fitted(path: Path) -> Spent:
    """The fit by the readings drawn."""
    from agonic.ellipsoid import fit_recording
    from agonic.logs.large.mission import Mission
    from agonic.logs.parquet import count_rows
    from agonic.provenance import Input
    from agonic.reference import Reference

    n = count_rows(path)
    made_of = (Input(name=path.name, sha256="", count=n),)  # the checksum is timed by itself
    mission = Mission(files=(path,), inputs=made_of, rows=n)
    clock = Clock()
    fit = fit_recording(mission, Reference.constant(FIELD))
    spent = clock.spent()
    if not (fit.converged and fit.ok):
        raise SystemExit(fit.status)
    error = float(np.abs((fit.calibration.bias - BIAS) / fit.sd[:3]).max())
    return Spent(*spent, peak_MB(), error)


def peak_MB() -> float:
    """The largest memory of this process so far (Linux; elsewhere not known)."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if "VmHWM" in line), float("nan"))


def alone(work: Callable[[Path], Spent], path: Path) -> Spent:
    """Do it in a new process, so that time and memory are its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(work, path).result()


def measured(
    case: Case, works: tuple[Callable[[Path], Spent], ...], rounds: int
) -> dict[str, Spent]:
    """The best of some rounds of each work; its largest memory."""
    best: dict[str, Spent] = {}
    with TemporaryDirectory() as folder:
        path = Path(folder, "recording.parquet")
        tables.progress(f"{case.rows} rows, {case.name}: writing")
        write(case, path)
        alone(reading, path)  # the file into the system's cache
        for round_ in range(rounds):
            for work in works:
                tables.progress(f"{case.rows} rows, {case.name}: {work.__name__}, {round_ + 1}")
                now, before = alone(work, path), best.get(work.__name__)
                memory = max(now.memory, before.memory if before else 0.0)
                faster = now if before is None or now.seconds < before.seconds else before
                best[work.__name__] = faster._replace(memory=memory)
    return best


# --- what is told ------------------------------------------------------------------------------

HEADER = ("rows", "file", "reading", "fit", "over reading", "checksum", "memory")


def row(case: Case, spent: dict[str, Spent]) -> tuple[str, ...]:
    """A line of the table."""
    base, whole, check = spent["reading"], spent["fitted"], spent.get("opening")
    return (
        f"{case.rows:,}".replace(",", " "),
        case.name,
        f"{base.seconds:.2f} s",
        f"{whole.seconds:.2f} s",
        f"{whole.seconds / base.seconds:.2f}",
        f"{check.seconds:.2f} s" if check else "",
        f"{whole.memory:.0f} MB",
    )


def extrapolated(spent: dict[int, dict[str, Spent]], name: str) -> tuple[float, float]:
    """Seconds to begin with and seconds a row, by the least and the most rows."""
    sizes = sorted(spent)
    first, last = (spent[n][name].seconds for n in (sizes[0], sizes[-1]))
    slope = (last - first) / (sizes[-1] - sizes[0])
    return first - slope * sizes[0], slope


def main() -> None:
    """Measure, print, and draw."""
    parser = argparse.ArgumentParser(description="one recording, any length")
    parser.add_argument("--largest", type=float, default=1e8, help="rows (default: 1e8)")
    parser.add_argument("--quick", action="store_true", help="up to 10⁶ rows; keeps nothing")
    parser.add_argument("--full", action="store_true", help="two rounds, and other kinds of files")
    asked = parser.parse_args()
    largest = 1_000_000 if asked.quick else int(asked.largest)
    begun, rounds = os.getloadavg()[0], 2 if asked.full else 1
    works = (reading, fitted)
    spent: dict[int, dict[str, Spent]] = {}
    rows = []
    for n in [n for n in SIZES if n < largest] + [largest]:
        more = (opening,) if n == largest else ()
        spent[n] = measured(Case(n), (*works, *more), rounds)
        rows.append(row(Case(n), spent[n]))
    for case in (Case(largest, "snappy"), Case(largest, "zstd", 4)) if asked.full else ():
        rows.append(row(case, measured(case, works, rounds)))
    introduction = (
        INTRODUCTION.format(noise=NOISE, rounds=rounds, cores=os.cpu_count(), load=begun)
        .replace("{{", "{")
        .replace("}}", "}")
    )
    costs = {name: extrapolated(spent, name) for name in ("reading", "fitted")}
    many = {name: (begin + slope * 1e10) / 60 for name, (begin, slope) in costs.items()}
    busy = {name: of.busy / largest * 1e9 for name, of in spent[largest].items()}
    error = max(of["fitted"].error for of in spent.values())
    parts = [
        introduction.format(load=os.getloadavg()[0]),
        tables.markdown(HEADER, rows),
        f"A row costs {costs['reading'][1] * 1e9:.0f} ns to read and "
        f"{costs['fitted'][1] * 1e9:.0f} ns with the fit. At that pace 10¹⁰ rows, six years at "
        f"50 Hz, take {many['reading']:.0f} minutes to read and {many['fitted']:.0f} to fit, in "
        f"the same memory. The processors are at work for {busy['reading']:.0f} and "
        f"{busy['fitted']:.0f} ns a row, whatever else runs. The largest error of a bias is "
        f"{error:.1f} standard errors.",
    ]
    print("\n\n".join(parts))
    if largest == max(SIZES):
        draw(spent, costs, PICTURE)


COLOURS = {"reading": "#7b8089", "fitted": "#c2571a"}
MARKS = {1e-3: "1 ms", 1e-1: "0.1 s", 1e1: "10 s", 1e3: "17 min", 1e5: "28 h"}
LEFT, RIGHT, TOP, BOTTOM = 70, 640, 20, 330


def draw(
    spent: dict[int, dict[str, Spent]], costs: dict[str, tuple[float, float]], path: Path
) -> None:
    """Seconds over rows, both logarithmic: what was measured, and the straight lines they make."""
    top = 1e10

    def at(rows: float, seconds: float) -> tuple[float, float]:
        x = LEFT + (RIGHT - LEFT) * np.log10(rows / min(spent)) / np.log10(top / min(spent))
        y = BOTTOM - (BOTTOM - TOP) * np.log10(seconds / 1e-3) / np.log10(1e5 / 1e-3)
        return round(float(x), 1), round(float(y), 1)

    parts = []
    for power in range(5, 11):
        x, _ = at(10.0**power, 1.0)
        parts.append(f'<path class="g" d="M{x} {TOP}V{BOTTOM}"/>')
        label = f'10<tspan dy="-5" font-size="10">{power}</tspan>'
        parts.append(f'<text x="{x}" y="{BOTTOM + 22}" text-anchor="middle">{label}</text>')
    for seconds, word in MARKS.items():
        _, y = at(top, seconds)
        parts.append(f'<path class="g" d="M{LEFT} {y}H{RIGHT}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4}" text-anchor="end">{word}</text>')
    for row, (name, (begin, slope)) in enumerate(costs.items()):
        ink = f'stroke="{COLOURS[name]}" fill="none"'
        for low, high, dash in (
            (min(spent), max(spent), ""),
            (max(spent), top, ' stroke-dasharray="3 4"'),
        ):
            line = [at(n, begin + slope * n) for n in np.geomspace(low, high, 40)]
            points = " ".join(f"{x},{y}" for x, y in line)
            parts.append(f'<polyline {ink} stroke-width="1.5"{dash} points="{points}"/>')
        for n, of in spent.items():
            x, y = at(n, of[name].seconds)
            parts.append(f'<circle cx="{x}" cy="{y}" r="4" fill="{COLOURS[name]}"/>')
        y = TOP + 24 + 20 * row
        parts.append(f'<circle cx="{LEFT + 18}" cy="{y - 4}" r="4" fill="{COLOURS[name]}"/>')
        parts.append(f'<text x="{LEFT + 30}" y="{y}">{name}</text>')
    body = "\n".join(parts)
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {RIGHT + 30} {BOTTOM + 60}" '
        f'font-family="sans-serif" font-size="13" fill="#222">\n'
        "<style>.g{stroke:#ddd;stroke-width:1}</style>\n"
        f'<rect width="100%" height="100%" fill="#fff"/>\n{body}\n'
        f'<text x="{(LEFT + RIGHT) / 2}" y="{BOTTOM + 46}" text-anchor="middle">rows; dotted: at '
        "the same pace</text>\n</svg>\n",
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
