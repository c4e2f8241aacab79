"""The logs of a simulated fleet as files of text, and as tables for one dataset."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Mask
from agonic.fleet.simulation.faults import DAMAGED, damage
from agonic.fleet.simulation.simulate import RecordedLogs, SimulatedFleet

HEADER = (
    "time_s,mag_x_nT,mag_y_nT,mag_z_nT,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,temperature_C,epoch_unix_s"
)


def make_texts(fleet: SimulatedFleet) -> Iterator[tuple[str, bytes]]:
    """The name and the bytes of every file, copies beside what they repeat.

    >>> from agonic.fleet.simulation.simulate import simulate_fleet
    >>> name, content = next(make_texts(simulate_fleet(3)))
    >>> name, content.decode().splitlines()[0][:28]
    ('board-0-1.csv', 'time_s,mag_x_nT,mag_y_nT,mag')
    """
    holding = _group_logs(fleet)
    for recorded in fleet.readings():
        for k in range(len(recorded.field)):
            content = _make_text(fleet, recorded, k)
            for log in holding[recorded.first + k]:
                fault = fleet.truth["fault"][log]
                name = f"{fleet.truth['source'][log]}.csv"
                yield name, damage(fault, content, log) if fault in DAMAGED else content


def make_tables(
    fleet: SimulatedFleet, *, acceleration: bool = True
) -> Iterator[Mapping[str, NDArray[Any]]]:
    """The readings of some hundred logs at a time, as columns, each row with its sensor.

    A dataset has no files to be damaged: such a log is cut to five rows, or has lost half its
    values. A log that is there twice is one of a sensor of its own, named as the copy.
    """
    holding, truth = _group_logs(fleet), fleet.truth
    for recorded in fleet.readings():
        logs = [(k, log) for k in range(len(recorded.field)) for log in holding[recorded.first + k]]
        rows = np.array([k for k, _ in logs])
        names = [str(truth["source" if truth["original"][i] else "sensor"][i]) for _, i in logs]
        field = recorded.field[rows].astype(np.float32)
        whole = np.ones(field.shape[:2], dtype=bool)
        for k, (_, log) in enumerate(logs):
            if truth["group"][log] == "damaged":
                _damage(str(truth["fault"][log]), field[k], whole[k], log)
        count = field.shape[1]
        start_s = np.array([truth["start"][i].timestamp() for _, i in logs])
        time = (start_s[:, None] + recorded.time)[whole]
        table: dict[str, NDArray[Any]] = {"sensor": np.repeat(np.array(names, object), count)}
        table["sensor"] = table["sensor"][whole.ravel()]
        table["time_s"] = time
        _put_vectors(table, "mag_{}_nT", field, whole)
        if acceleration:
            force = recorded.acceleration[rows].astype(np.float32)
            _put_vectors(table, "acc_{}_m_s2", force, whole)
        table["temperature_C"] = recorded.temperature[rows].astype(np.float32)[whole]
        yield table


def _put_vectors(
    table: dict[str, NDArray[Any]], name: str, vectors: NDArray[Any], whole: Mask
) -> None:
    """Put the three components of vectors (k, m, 3) into a table."""
    for axis, component in zip("xyz", np.moveaxis(vectors, -1, 0), strict=True):
        table[name.format(axis)] = component[whole]


def _damage(fault: str, field: NDArray[Any], whole: Mask, seed: int) -> None:
    """Lose values or rows of one log."""
    if fault == "missing values":
        lost = np.random.default_rng([seed, 11]).uniform(size=len(field)) < 0.5
        field[lost, 0] = np.nan
    else:
        whole[5:] = False


def _group_logs(fleet: SimulatedFleet) -> Mapping[int, list[int]]:
    """The logs that hold each drawn one: itself, and its copy."""
    holding: dict[int, list[int]] = defaultdict(list)
    for log, drawn in enumerate(fleet.draw.tolist()):
        holding[drawn].append(log)
    return holding


def _make_text(fleet: SimulatedFleet, recorded: RecordedLogs, k: int) -> bytes:
    """One log as a table of text, written by one format for all its rows."""
    log = recorded.first + k
    start = fleet.truth["start"][log].timestamp()
    row = f"%.2f,%.0f,%.0f,%.0f,%.3f,%.3f,%.3f,%.2f,{start:.0f}\n"
    columns = (
        recorded.time,
        recorded.field[k],
        recorded.acceleration[k],
        recorded.temperature[k],
    )
    values = np.column_stack(columns).ravel().tolist()
    return f"{HEADER}\n{row * len(recorded.time) % tuple(values)}".encode()
