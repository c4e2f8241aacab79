"""`agonic simulate fleet -o DIR`: the logs of many boards, with faults that are known."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from agonic.fleet.simulation.fleet import SimulatedFleet

T = TypeVar("T")


def fleet(
    out: Path, *, sensors: str, format: str, seed: int, as_json: bool, **settings: Any
) -> int:
    """Write the logs or the dataset, and beside them the truth."""
    from agonic.console.output import print_json, say
    from agonic.errors import check_choice
    from agonic.fleet.simulation.fleet import simulate_fleet
    from agonic.fleet.write_fleet import write_truth

    check_choice("format", format, ("csv", "parquet"))
    made = simulate_fleet(_count(sensors), seed=seed, **settings)
    where = _logs(made, out) if format == "csv" else _dataset(made, out)
    truth = write_truth(made.truth, out / "truth.csv")
    groups, faults = made.truth["group"], made.truth["fault"]
    there = sorted(set(faults[groups != ""]))
    planted = {str(fault): int((faults == fault).sum()) for fault in there}
    if as_json:
        print_json(
            "agonic/simulate-fleet@1",
            {
                "sensors": made.facts["n"],
                "logs": len(made),
                "files": [str(where), str(truth)],
                "faults": planted,
                "facts": made.facts,
            },
        )
    else:
        what = f"{len(made)} logs of {made.facts['n']} sensors"
        say(f"{what}: {where}\nThe truth, with {sum(planted.values())} faults: {truth}")
    return 0


def _count(sensors: str) -> int:
    from agonic.errors import AgonicError

    if not sensors.isdecimal():
        raise AgonicError(f"--sensors {sensors!r}: a fleet needs their number, such as 1000")
    return int(sensors)


def _logs(made: SimulatedFleet, out: Path) -> Path:
    """A folder of text tables."""
    from agonic.fleet.simulation.fleet_logs import texts
    from agonic.fleet.write_fleet import write_logs

    write_logs(_counted(texts(made), len(made), "Writing logs"), out / "logs")
    return out / "logs"


def _dataset(made: SimulatedFleet, out: Path) -> Path:
    """One Parquet file for all."""
    from agonic.fleet.simulation.fleet import CHUNK
    from agonic.fleet.simulation.fleet_logs import tables
    from agonic.fleet.write_fleet import write_dataset

    chunks = -(-int(made.draw.max() + 1) // CHUNK)
    return write_dataset(_counted(tables(made), chunks, "Writing"), out / "readings.parquet")


def _counted(items: Iterator[T], total: int, what: str) -> Iterator[T]:
    """The items, shown on a bar as they pass."""
    from agonic.console.progress import counting

    with counting(total) as told:
        for done, item in enumerate(items, start=1):
            yield item
            told(what, done)
