"""`agonic simulate fleet -o DIR`: the logs of many boards, with faults that are known."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from agonic.fleet.simulation.simulate import SimulatedFleet

T = TypeVar("T")


def fleet(
    out: Path, *, sensors: str, format: str, seed: int, as_json: bool, **settings: Any
) -> int:
    """Write the logs or the dataset, and beside them the truth."""
    from agonic.console.output import print_json, say
    from agonic.errors import check_choice
    from agonic.fleet.simulation.files import write_truth
    from agonic.fleet.simulation.simulate import simulate_fleet

    check_choice("format", format, ("csv", "parquet"))
    made = simulate_fleet(_parse_count(sensors), seed=seed, **settings)
    where = _write_logs(made, out) if format == "csv" else _write_dataset(made, out)
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


def _parse_count(sensors: str) -> int:
    from agonic.errors import AgonicError

    if not sensors.isdecimal():
        raise AgonicError(f"--sensors {sensors!r}: a fleet needs their number, such as 1000")
    return int(sensors)


def _write_logs(made: SimulatedFleet, out: Path) -> Path:
    """A folder of text tables."""
    from agonic.fleet.simulation.files import write_logs
    from agonic.fleet.simulation.logs import make_texts

    write_logs(_show_progress(make_texts(made), len(made), "Writing logs"), out / "logs")
    return out / "logs"


def _write_dataset(made: SimulatedFleet, out: Path) -> Path:
    """One Parquet file for all."""
    from agonic.fleet.simulation.files import write_dataset
    from agonic.fleet.simulation.logs import make_tables
    from agonic.fleet.simulation.simulate import CHUNK

    chunks = -(-int(made.draw.max() + 1) // CHUNK)
    return write_dataset(
        _show_progress(make_tables(made), chunks, "Writing"), out / "readings.parquet"
    )


def _show_progress(items: Iterator[T], total: int, what: str) -> Iterator[T]:
    """The items, shown on a bar as they pass."""
    from agonic.console.progress import counting

    with counting(total) as told:
        for done, item in enumerate(items, start=1):
            yield item
            told(what, done)
