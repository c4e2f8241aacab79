"""Planted faults of a simulated fleet, and which of them are named, by what.

python -m benchmarks.fleet_faults [--draws SENSORS] [--quick]
"""

from __future__ import annotations

import os
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from agonic.fleet.run import calibrate_fleet
from agonic.fleet.settings import FleetSettings
from agonic.fleet.simulation.faults import BROKEN, SWAPPED
from agonic.fleet.simulation.files import make_tables, make_texts, write_dataset, write_logs
from agonic.fleet.simulation.simulate import SimulatedFleet, simulate_fleet
from agonic.population import Population, Row, find_duplicates, find_outliers
from benchmarks import tables as pages

FIELD = 48_000.0
SHARES = {"broken": 0.08, "swapped": 0.04, "duplicated": 0.02, "damaged": 0.02}

RIGHT: Mapping[str, tuple[str, ...]] = {
    "frozen axis": ("frozen axis", "static", "plane", "small tilt"),
    "dead axis": ("plane", "small tilt", "static"),
    "clipping": ("clipping",),
    "noise": ("noise", "disturbed"),
    "spikes": ("outliers", "disturbed"),
    "moved magnet": ("field changed",),
    "axis gain": ("gain",),
    "gain": ("gain", "magnitude"),
    "exchanged axes": ("axes",),
    "reversed axis": ("axes",),
    "turned axes": ("axes",),
    "duplicated": ("duplicated",),
    "truncated": ("torn end", "NaN", "too few readings"),
    "binary": ("binary data", "too few readings"),
    "empty": ("empty", "too few readings"),
    "wrong columns": ("no magnetometer columns", "too few readings"),
    "missing values": ("NaN",),
    "wrong encoding": ("binary data", "too few readings"),
}
"""What a fault may rightly be called: a finding, a quantity of an outlier, or part of a reason.

In a dataset a damaged log is one of a few rows.
"""


@dataclass
class Named:
    """How many logs with one fault there were, and what named them.

    A note leaves a verdict good; it counts as a name, but not as an alarm.
    """

    planted: int = 0
    verdict: int = 0
    note: int = 0
    population: int = 0
    alarmed: int = 0
    rightly: int = 0
    odd: list[str] = field(default_factory=list)

    def add(self, name: str, fault: str, rows: Sequence[Row], apart: Sequence[str]) -> None:
        """Count one log, its rows and what the population says of it."""
        doubted = any(row.verdict != "good" for row in rows)
        words = [word for row in rows for word in row.findings]
        self.planted += 1
        self.verdict += doubted
        self.note += bool(words) and not doubted
        self.population += bool(apart)
        self.alarmed += doubted or bool(apart)
        words += [row.status for row in rows if row.verdict == "refused"] + [*apart]
        right = any(wanted in word for wanted in RIGHT.get(fault, ()) for word in words)
        self.rightly += right
        if not right if fault else doubted or apart:
            self.odd.append(f"{name}: {words}")


def judged(
    fleet: SimulatedFleet, table: Population, source: Callable[[int], str]
) -> dict[str, Named]:
    """The faults by name ("" for good logs), with what named them.

    `source` gives the name under which the table has the log of that number. That the log of a
    good board is there twice is no false alarm.
    """
    rows: dict[str, list[Row]] = defaultdict(list)
    for row in table:
        rows[source_of(row)].append(row)
    apart, twice = standing_out(table)
    sums: dict[str, Named] = defaultdict(Named)
    for log in range(len(fleet)):
        fault, name = str(fleet.truth["fault"][log]), source(log)
        found = rows[name]
        said = [quantity for row in found for quantity in apart[row.sensor]]
        if fault == "duplicated" and name in twice:
            said.append("duplicated")
        sums[fault].add(name, fault, found, said)
    return dict(sums)


def source_of(row: Row) -> str:
    """The log of a row: the name of its file, or its sensor where one file holds all."""
    return Path(row.source).stem if row.source.endswith(".csv") else row.sensor


def standing_out(table: Population) -> tuple[dict[str, list[str]], set[str]]:
    """What the population says of each sensor, and the logs that are there twice."""
    said: dict[str, list[str]] = defaultdict(list)
    for found in find_outliers(table):
        said[found.sensor].append(found.quantity)
    names = [source_of(row) for row in table]
    return said, {names[row] for twice in find_duplicates(table) for row in twice.rows}


def of_logs(fleet: SimulatedFleet, folder: Path) -> dict[str, Named]:
    """The whole way through a folder of logs with acceleration."""
    write_logs(make_texts(fleet), folder / "logs")
    settings = FleetSettings(field_nT=FIELD, name=r"(board-\d+)")
    table = calibrate_fleet([folder / "logs"], folder / "out", settings=settings)
    return judged(fleet, table, lambda log: str(fleet.truth["source"][log]))


def of_dataset(fleet: SimulatedFleet, folder: Path) -> dict[str, Named]:
    """The whole way through one Parquet dataset: moments of the field alone."""
    from agonic.fleet.dataset import calibrate_dataset

    path = write_dataset(make_tables(fleet), folder / "readings.parquet")
    table = calibrate_dataset(path, FleetSettings(field_nT=FIELD))
    table = table if isinstance(table, Population) else Population.of(table)
    truth = fleet.truth
    return judged(
        fleet, table, lambda k: str(truth["source" if truth["original"][k] else "sensor"][k])
    )


def page(sums: Mapping[str, Named]) -> str:
    """The table of one way."""
    ordered = [name for name in RIGHT if name in sums]
    lines = [
        (
            name,
            str(one.planted),
            share(one.verdict, one),
            share(one.note, one),
            share(one.population, one),
            share(one.alarmed, one),
            share(one.rightly, one),
        )
        for name, one in ((name, sums[name]) for name in ordered)
    ]
    good = sums[""]
    lines.append(
        (
            "**good**",
            str(good.planted),
            share(good.verdict, good),
            share(good.note, good),
            share(good.population, good),
            share(good.alarmed, good),
            "",
        )
    )
    header = (
        "fault",
        "logs",
        "by verdict",
        "by a note",
        "by population",
        "alarmed",
        "for the right reason",
    )
    return pages.markdown(header, lines)


def share(count: int, of: Named) -> str:
    return f"{100 * count / of.planted:.4g} %"


def summary(sums: Mapping[str, Named]) -> str:
    """What the whole way reaches, on broken and swapped boards and on good logs."""
    ill = [sums[name] for name in (*BROKEN, *SWAPPED) if name in sums]
    planted, good = sum(one.planted for one in ill), sums[""]
    named, alarmed = (sum(getattr(one, what) for one in ill) for what in ("rightly", "alarmed"))
    return (
        f"Broken and swapped boards: {named} of {planted} named for the right reason "
        f"({100 * named / planted:.1f} %), {alarmed} by more than a note. Good logs: "
        f"{good.alarmed} of {good.planted} alarmed ({100 * good.alarmed / good.planted:.2f} %)."
    )


def main() -> None:
    asked = pages.arguments("planted faults of a fleet", draws=1000)
    sensors = min(asked.draws, 400) if asked.quick else asked.draws
    fleet = simulate_fleet(sensors, **SHARES, seed=1)
    parts = []
    for title, way in (
        ("A folder of CSV logs, with acceleration", of_logs),
        ("One Parquet dataset", of_dataset),
    ):
        pages.progress(f"{title}: running")
        begun = time.monotonic()
        try:
            with TemporaryDirectory() as folder:
                sums = way(fleet, Path(folder))
        except ImportError as error:
            pages.progress(f"{title}: left out, {error}")
            continue
        parts += [
            f"## {title}",
            f"{len(fleet)} logs of {sensors} boards, {time.monotonic() - begun:.0f} s in all. "
            f"{summary(sums)}",
            page(sums),
        ]
        for name, one in sums.items():
            for line in one.odd[:12]:
                pages.progress(f"  {name or 'good'}: {line[:300]}")
    print("\n\n".join(parts))


if __name__ == "__main__":
    main()
