"""Time on one core: fits beside peers, moments, and the command line.

python -m benchmarks.speed [--draws 7] [--quick]
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

import agonic as ag
from agonic.ellipsoid.solve import Method
from benchmarks import problems, tables
from benchmarks.peers import ESTIMATORS
from benchmarks.scenarios import MAGNITUDE, Case, draw

OURS: dict[str, Method] = {"agonic default fit": "likelihood", "agonic adjusted fit": "adjusted"}
DEFAULT = "agonic default fit"
LOGS = (
    "ardupilot/center_0003.bin",
    "ardupilot/log171.bin",
    "ardusub/small.tlog",
    "px4/sample.ulg",
    "broad/02_undisturbed_slow_rotation_B.mat",
)
"""Recordings of vehicles whose calibration is timed as a whole."""
SLOWEST_S = 2.0  # what takes longer is run once
RECORDINGS = Path(
    os.environ.get("AGONIC_RECORDINGS", Path(__file__).parents[2] / "shared" / "recordings")
)

INTRODUCTION = """# Time

Median of {draws} runs (what takes over {slowest:g} s is run once), processor time of all threads
and, for commands, of the process that is started, from the shell's start to the end. The default
fit is robust, chooses its model, and brings covariance, coverage and findings; so do the other
methods of agonic (adjusted, Li & Griffiths, linear). The rest give bias and matrix alone. Full
sphere, noise 200 nT. In brackets: times the default fit."""


def median_s(
    work: Callable[[], object], times: int, clock: Callable[[], float] = time.process_time
) -> float:
    """Median duration in seconds, after one run that loads and compiles."""
    runs: list[float] = []
    while len(runs) <= times and (len(runs) < 2 or runs[-1] < SLOWEST_S):
        start = clock()
        work()
        runs.append(clock() - start)
    return statistics.median(runs[1:])


def fits(n: int, times: int) -> dict[str, float | None]:
    """Seconds of each estimator on n readings; None where it is not installed."""
    samples = draw(Case("full sphere", n, 200.0), seed=0).samples
    reference = ag.Reference.constant(MAGNITUDE)
    taken: dict[str, float | None] = {}
    for name, method in OURS.items():
        fit = partial(ag.fit_ellipsoid, samples, reference, method=method)
        taken[name] = median_s(fit, times)
    for name, estimate in ESTIMATORS.items():
        if name.startswith("agonic"):
            continue
        try:
            taken[name] = median_s(partial(estimate, samples.field, MAGNITUDE, 200.0), times)
        except ImportError:
            taken[name] = None
    return taken


def fit_table(sizes: Sequence[int], times: int) -> str:
    """Estimators down, numbers of readings across."""
    columns = []
    for n in sizes:
        tables.progress(f"speed: fits of {n} readings")
        columns.append(fits(n, times))
    rows = [(name, *(_cell(column, name) for column in columns)) for name in columns[0]]
    return tables.markdown(("fit", *(f"{n}, ms" for n in sizes)), rows)


def _cell(column: dict[str, float | None], name: str) -> str:
    taken, ours = column[name], column[DEFAULT]
    if taken is None or ours is None:
        return tables.NOT_INSTALLED
    return f"{1e3 * taken:.3g} ({taken / ours:.2g})"


def moments_table(n: int, times: int) -> str:
    """How many readings a second go into moments."""
    tables.progress("speed: moments")
    field = 5e4 * np.random.default_rng(0).standard_normal((n, 3))
    first = ag.Moments.of(field[:1000])
    rows = [
        ("Moments.of(array)", f"{n / median_s(partial(ag.Moments.of, field), times) / 1e6:.3g}"),
        ("moments.add(array)", f"{n / median_s(partial(first.add, field), times) / 1e6:.3g}"),
    ]
    return tables.markdown(("moments", "million readings a second"), rows)


def command_table(times: int, logs: Sequence[str]) -> str:
    """Whole commands and the size of the page they write."""
    clock = _started
    rows = [("agonic --help", f"{median_s(partial(_agonic, '--help'), times, clock):.2f}", "")]
    for name in logs:
        log = RECORDINGS / "vehicle" / name
        if not log.is_file():
            rows.append(
                (f"agonic calibrate {log.name}", "no recordings: set AGONIC_RECORDINGS", "")
            )
            continue
        tables.progress(f"speed: agonic calibrate {log.name}")
        with tempfile.TemporaryDirectory() as folder:
            work = partial(_agonic, "calibrate", str(log), "-o", folder)
            taken = median_s(work, min(times, 3), clock)
            page = Path(folder, "report.html").stat().st_size / 1e6
        size = log.stat().st_size / 1e6
        rows.append((f"agonic calibrate {log.name}, {size:.1f} MB", f"{taken:.2f}", f"{page:.2f}"))
    return tables.markdown(("command", "s", "page, MB"), rows)


def main_job_table(sizes: Sequence[int]) -> str:
    """The main job without reading and writing."""
    rows = []
    for n in sizes:
        tables.progress(f"speed: calibrate of {n} rows")
        rows.append((f"{n}", f"{median_s(problems.calibrate(n), 3):.2f}"))
    return tables.markdown(("calibrate(), rows", "s"), rows)


def _started() -> float:
    """Processor time of the processes that this one started and that ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _agonic(*words: str) -> None:
    """Run our command line; a refused sensor (exit status 1) takes time all the same."""
    done = subprocess.run([sys.executable, "-m", "agonic", *words], capture_output=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.decode())


def run(draws: int, quick: bool = False) -> None:
    """Four tables: fits, moments, the main job, commands."""
    warnings.simplefilter("ignore")
    sizes = (3000,) if quick else (3000, 30_000, 300_000)
    parts = [
        INTRODUCTION.format(draws=draws, slowest=SLOWEST_S),
        fit_table(sizes, draws),
        moments_table(100_000 if quick else 3_000_000, draws),
        main_job_table((10_000,) if quick else (10_000, 1_000_000)),
        command_table(draws, LOGS[:1] if quick else LOGS),
    ]
    print("\n\n".join(parts))


def main() -> None:
    """Time everything, print the tables."""
    asked = tables.arguments("time on one core", draws=7)
    run(min(asked.draws, 3) if asked.quick else asked.draws, asked.quick)


if __name__ == "__main__":
    main()
