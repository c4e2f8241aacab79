"""How the cost of each estimator grows: python -m benchmarks.growth [--quick] [--full].

Each work runs in a process of its own, ten times more rows at a time, as long as it takes less than
a limit. Writes docs/_static/growth.svg beside the table.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import problems, tables
from benchmarks.growth_picture import Curve, draw

PICTURE = Path(__file__).parent.parent / "docs" / "_static" / "growth.svg"
LIMIT_S = 3.0
"""Ten times more rows are asked for where they would take less than this, or as the third size."""
INTRODUCTION = """Processor time and memory of one call, ten times more at a time, as long as the
next call should take less than {limit:g} s, three times at least. Each call is the second in a
process of its own (the first, mostly of 1000 rows, loads and compiles). Memory is what the process
grew by at its peak during the call, the readings themselves not counted. The exponent is the slope
of log time over log size by least squares, over the sizes that take over {floor:g} ms, where
starting a call no longer counts; one is linear. It is followed by that of the last step alone."""
FLOOR_S = 0.03
HEADER = ("estimator", "up to", "time there", "memory there", "each", "exponent", "last step")


class Study(NamedTuple):
    """One estimator: its name, how a work of a size is made, the sizes, what is counted, and the
    size of the first call where that is not 1000 at most."""

    name: str
    make: Callable[[int], problems.Work]
    sizes: Sequence[int]
    of: str = "rows"
    warm: int = 0


def powers(first: int, last: int) -> tuple[int, ...]:
    """Ten times more at a time.

    >>> powers(2, 4)
    (100, 1000, 10000)
    """
    return tuple(10**k for k in range(first, last + 1))


ROWS = powers(2, 6)
STUDIES = (
    Study("moments", problems.moments, powers(2, 7)),
    Study("ellipsoid", problems.ellipsoid, ROWS),
    Study("ellipsoid, adjusted", problems.adjusted, powers(2, 7)),
    Study("two axes", problems.two_axes, ROWS),
    Study("levelled", problems.levelled, ROWS),
    Study("vector", problems.vector, ROWS),
    Study("interference", problems.interference, ROWS),
    Study("inertial", problems.inertial, ROWS[1:]),
    Study("calibrate, all of it", problems.calibrate, ROWS),
    Study("thermal, known field", problems.thermal, ROWS),
    Study("in flight", problems.inflight, ROWS),
    Study("tracker, numba", partial(problems.tracker, compiled=True), ROWS[1:]),
    Study("tracker", problems.tracker, ROWS),
    Study("network 4-4-3", problems.network, ROWS),
    Study("star sensor", problems.alignment, ROWS[1:]),
    Study("coil", problems.coil, ROWS),
    Study("gravity", problems.gravity, ROWS[2:]),
    Study("deviation", problems.deviation, powers(2, 5)),
    Study("headings", problems.heading, ROWS),
    Study("world model", problems.world_model, ROWS, warm=100_000),
)


def of_sources(n: int) -> problems.Work:
    """Currents beside bias and matrix: each has three unknowns."""
    return problems.interference(3000, sources=n)


def of_nodes(n: int) -> problems.Work:
    """Nodes of a network: each has eight unknowns."""
    return problems.network(3000, hidden=n)


def of_degree(n: int) -> problems.Work:
    """Powers of the temperature: each has twelve unknowns."""
    return problems.thermal(3000, degree=n)


UNKNOWNS = (
    Study("sensors of a fleet", problems.fleet, powers(2, 5), "sensors"),
    Study("interference, 3000 rows", of_sources, (1, 2, 4, 8, 16), "currents"),
    Study("network, 3000 rows", of_nodes, (2, 4, 8, 16), "nodes"),
    Study("thermal, 3000 rows", of_degree, (1, 2, 3, 4), "degree"),
)


class Spent(NamedTuple):
    """Processor time of a call, s, and by how much it made the process grow, MB."""

    seconds: float
    memory: float


def measure(study: Study, n: int) -> Spent:
    """One call in this process, after a small one."""
    warnings.simplefilter("ignore")
    study.make(study.warm or (min(n, 1000) if study.of == "rows" else study.sizes[0]))()
    work = study.make(n)
    before = _reset_peak()
    taken = []
    while not taken or (sum(taken) < 1.0 and len(taken) < 5):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return Spent(min(taken), max(_read_status("VmHWM") - before, 0.0))


def _reset_peak() -> float:
    """The memory now, MB, from which the peak is counted again (Linux; elsewhere no figure)."""
    clear = Path("/proc/self/clear_refs")
    if clear.exists():
        clear.write_text("5")
    return _read_status("VmRSS")


def _read_status(key: str) -> float:
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if key in line), float("nan"))


def follow(study: Study, limit: float) -> list[tuple[int, Spent]]:
    """Each size in a process of its own, as long as calls are short."""
    spent: list[tuple[int, Spent]] = []
    for n in study.sizes:
        with multiprocessing.get_context("fork").Pool(1) as pool:
            spent.append((n, pool.apply(measure, (study, n))))
        tables.progress(f"growth: {study.name}, {n}: {spent[-1][1].seconds:.3g} s")
        if 10 * spent[-1][1].seconds > limit and len(spent) > 2 and study.of == "rows":
            break
    return spent


def exponent(spent: Sequence[tuple[int, Spent]], floor: float = FLOOR_S) -> float:
    """The slope of log time over log size, over the sizes whose time is above a floor."""
    seen = [(n, one.seconds) for n, one in spent if one.seconds > floor]
    seen = seen if len(seen) > 1 else [(n, one.seconds) for n, one in spent[-2:]]
    x, y = np.log(np.array(seen)).T
    return float(np.polyfit(x, y, 1)[0])


def describe(study: Study, spent: Sequence[tuple[int, Spent]]) -> tuple[str, ...]:
    """A line of the table."""
    n, last = spent[-1]
    return (
        study.name,
        f"{_power(n)} {study.of}",
        f"{last.seconds:.3g} s",
        f"{last.memory:.1f} MB",
        f"{1e6 * last.seconds / n:.3g} µs",
        f"{exponent(spent):.2f}",
        f"{exponent(spent[-2:], 0.0):.2f}",
    )


def _power(n: int) -> str:
    exact = round(math.log10(n))
    return f"10{'⁰¹²³⁴⁵⁶⁷⁸⁹'[exact]}" if n == 10**exact > 10 else str(n)


def main() -> None:
    """Measure, print, draw."""
    asked = tables.arguments("how cost grows", draws=1)
    limit = 0.3 if asked.quick else 4 * LIMIT_S if asked.full else LIMIT_S
    print(INTRODUCTION.format(limit=limit, floor=1e3 * FLOOR_S))
    curves = []
    for title, studies in (("rows", STUDIES), ("sensors and unknowns", UNKNOWNS)):
        lines = []
        for study in studies:
            spent = follow(study, limit)
            lines.append(describe(study, spent))
            points = [(n, one.seconds, one.memory) for n, one in spent]
            curves.append(Curve(study.name, study.of, exponent(spent), points))
        print(f"\n## With {title}\n\n{tables.markdown(HEADER, lines)}")
    if not asked.quick:
        PICTURE.write_text(draw(curves), encoding="utf-8")


if __name__ == "__main__":
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    main()
