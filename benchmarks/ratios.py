"""The main jobs beside what else does them, in two minutes: python -m benchmarks.ratios.

With --compare: against the kept table, what became more than a quarter slower is named. It ends
with status 0 all the same: a guard that cries because the machine is busy is soon ignored.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import problems, rivals, tables
from benchmarks.readers import read_pairs
from benchmarks.timing import Pair, measure

SLOWER = 1.25
"""Times the kept ratio from which a job is named."""
ROUNDS = 5
SHARE = 0.1
"""Of the readings of the table of readers."""
INTRODUCTION = """Processor time, the best of {rounds} rounds in which both take turns, so that
other work on the machine counts little. Beside each job stands what a user would type instead:
SciPy's least squares of the same unknowns, a filter from a textbook, the library that reads the
same file. agonic's results have standard errors, coverage, findings and held-out checks besides.
Over: agonic's time over the other's; below one it is the faster. `make bench-quick` measures the
same and names what became more than a quarter slower."""
HEADER = ("job", "agonic, ms", "beside", "its time, ms", "over")


def jobs(folder: Path) -> Iterator[Pair]:
    """Every job with its rival, data made when its turn comes."""
    robust = "SciPy, soft_l1"
    yield Pair(
        "ellipsoid, robust, 30 000 rows",
        problems.ellipsoid(30_000),
        robust,
        rivals.magnitude(30_000, "soft_l1"),
    )
    for name, ours, theirs in (
        ("levelled, 300 rows", problems.levelled, rivals.levelled),
        ("vector, 300 rows", problems.vector, rivals.vector),
        ("interference, 300 rows", problems.interference, rivals.interference),
    ):
        yield Pair(name, ours(300), "SciPy", theirs(300))
    yield Pair("vector, 30 000 rows", problems.vector(30_000), "SciPy", rivals.vector(30_000))
    n = 3378
    yield Pair(f"thermal, known field, {n} rows", problems.thermal(n), "lstsq", rivals.thermal(n))
    yield Pair("network 3-3-3", problems.published_network(), "SciPy, lm", rivals.trained())
    yield Pair(
        "tracker, 2000 single readings",
        problems.tracked_singly(2000),
        "textbook filter",
        rivals.filtered(2000),
    )
    yield Pair(
        "calibrate, 30 000 rows",
        problems.calibrate(30_000),
        robust,
        rivals.magnitude(30_000, "soft_l1"),
    )
    yield Pair("IGRF, 3000 points", problems.world_model(3000), "Legendre", rivals.legendre(3000))
    page, work = rivals.paged(10_000)
    yield Pair("page of a calibration", page, "the calibration", work)
    for pair, _ in read_pairs(folder, SHARE):
        yield pair._replace(name=f"read {pair.name}")
    yield from _long(folder)


def _long(folder: Path) -> Iterator[Pair]:
    """A recording that is read piece by piece, beside reading it."""
    import agonic as ag
    from benchmarks.fleet_recording import FIELD, Case, write
    from benchmarks.readers import with_pyarrow

    path = folder / "long.parquet"
    write(Case(3_000_000), path)
    mission = ag.inflight.open_mission([path])
    work = partial(ag.fit_recording, mission, ag.Reference.constant(FIELD))
    yield Pair("recording, 3 million rows", work, "pyarrow, reading", partial(with_pyarrow, path))


def rows(rounds: int, kept: dict[str, float]) -> Iterator[tuple[Pair, float, tuple[str, ...]]]:
    """Each job with its ratio and its row; what seems slower than the kept is measured again."""
    with TemporaryDirectory() as folder:
        for pair in jobs(Path(folder)):
            tables.progress(f"ratios: {pair.name} beside {pair.rival}")
            spent = measure(pair, rounds)
            before = kept.get(key(pair))
            if before is not None and spent.ratio > SLOWER * before:
                again = measure(pair, 2 * rounds)
                spent = min(spent, again, key=lambda one: one.ratio)
            cells = (f"{1e3 * spent.ours:.3g}", pair.rival, f"{1e3 * spent.theirs:.3g}")
            yield pair, spent.ratio, (pair.name, *cells, f"{spent.ratio:.3g}")


def key(pair: Pair) -> str:
    """What a row of the table is known by."""
    return f"{pair.name} | {pair.rival}"


def read_kept() -> dict[str, float]:
    """The ratios of the kept table."""
    path = tables.RESULTS / "ratios.md"
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]
    return {f"{row[0]} | {row[2]}": float(row[4]) for row in cells[2:]}


def compare(rounds: int) -> None:
    """Ratios now and kept, and which are worse."""
    kept = read_kept()
    slower, lines = [], []
    for pair, ratio, (name, ours, rival, _, over) in rows(rounds, kept):
        before = kept.get(key(pair))
        change = ratio / before if before else float("nan")
        lines.append((name, ours, rival, over, f"{before or float('nan'):.3g}", f"{change:.2f}"))
        if change > SLOWER:
            slower.append(f"{name} (beside {rival}): {change:.2f} times the kept ratio")
    print(tables.markdown((*HEADER[:3], "over", "kept", "change"), lines))
    print()
    print("\n".join(["Slower by more than a quarter:", *slower] if slower else ["Nothing slower."]))


def main() -> int:
    """Print the table, or what changed."""
    warnings.simplefilter("ignore")
    asked = tables.arguments(__doc__ or "", draws=ROUNDS, compare=True)
    rounds = 2 if asked.quick else asked.draws
    if asked.compare:
        compare(rounds)
        return 0
    table = [row for _, _, row in rows(rounds, {})]
    print(INTRODUCTION.format(rounds=rounds) + "\n")
    print(tables.markdown(HEADER, table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
