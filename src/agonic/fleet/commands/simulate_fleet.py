"""`agonic simulate fleet -o DIR`: the logs of many boards, with faults that are known."""

from __future__ import annotations

from collections.abc import Iterator
from shlex import quote
from typing import NamedTuple, TypeVar

from agonic.console.options import Folder, Format, Json, Noise, Seed

T = TypeVar("T")


class Boards(NamedTuple):
    """What is simulated, as for `simulate_fleet`.

    Options
    -------
    n --sensors ≥1 : How many.
    logs ≥1 : Logs of each sensor.
    rows ≥20 : Readings of a log.
    magnitude --field : Magnitude of the field, nT.
    broken SHARE : Broken sensors.
    swapped SHARE : Sensors with misnamed axes.
    duplicated SHARE : Logs that are there twice.
    damaged SHARE : Damaged files.
    """

    n: int = 1000
    logs: int = 1
    rows: int = 300
    noise: Noise = 120.0
    magnitude: float = 48_000.0
    broken: float = 0.03
    swapped: float = 0.02
    duplicated: float = 0.01
    damaged: float = 0.01


def fleet(
    out: Folder,
    boards: Boards,
    format: Format = "csv",
    seed: Seed = 0,
    as_json: Json = False,
) -> int:
    """Many boards of one design: their logs or one dataset, and the truth about each."""
    from agonic.console.output import finish_made
    from agonic.errors import check_choice
    from agonic.fleet.simulation.files import (
        make_tables,
        make_texts,
        write_dataset,
        write_logs,
        write_truth,
    )
    from agonic.fleet.simulation.simulate import CHUNK_LOGS, simulate_fleet

    check_choice("format", format, ("csv", "parquet"))
    made = simulate_fleet(**boards._asdict(), seed=seed)
    if format == "csv":
        where = out / "logs"
        write_logs(_show_progress(make_texts(made), len(made), "Writing logs"), where)
    else:
        chunks = -(-int(made.draw.max() + 1) // CHUNK_LOGS)
        tables = _show_progress(make_tables(made), chunks, "Writing")
        where = write_dataset(tables, out / "readings.parquet")
    truth = write_truth(made.truth, out / "truth.csv")
    groups, faults = made.truth["group"], made.truth["fault"]
    there = sorted(set(faults[groups != ""]))
    planted = {str(fault): int((faults == fault).sum()) for fault in there}
    record = {"sensors": made.facts["n"], "logs": len(made), "files": [where, truth]}
    return finish_made(
        len(made),
        f"logs of {made.facts['n']} sensors",
        where,
        f"The truth, with {sum(planted.values())} faults: {truth}",
        record=record | {"faults": planted, "facts": made.facts},
        as_json=as_json,
        next_step=f"agonic fleet {quote(str(where))} --field {made.facts['magnitude']:g} -o fleet",
        schema="agonic/simulate-fleet@1",
    )


def _show_progress(items: Iterator[T], total: int, what: str) -> Iterator[T]:
    """The items, shown on a bar as they pass."""
    from agonic.console.progress import counting

    with counting(total) as told:
        for done, item in enumerate(items, start=1):
            yield item
            told(what, done)
