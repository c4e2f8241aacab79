"""The messages of an autopilot's log as tables, and what they tell beside a magnetometer, which are
rows of `dialects.toml`: what all readers of such logs share.

A heading may come from elsewhere than the magnetometer: a dual-antenna receiver measures it, and an
estimator of yaw by velocities (EKF-GSF) finds it once the vehicle has moved. Both are true, not
magnetic. Where none is known at a row, the autopilot's own estimate stands there, its sd 180°.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.logs.headers.columns import read_dialects
from agonic.logs.log import Readings
from agonic.logs.rows.auxiliary import ESTIMATED_ATTITUDE, PERIODS_DEG, measure_reach, resample
from agonic.provenance import Input
from agonic.samples import COLUMNS, Samples

LONGEST_RUN_S = 1e8
"""Three years: a clock since boot that reads more is damaged, or counts from 1970."""
GPS_YAW_SD_DEG = 2.0
"""Of two antennas half a metre apart, where the receiver does not say."""
SHORTEST_PULSE_US = 800.0
"""Of an output that drives something."""


@dataclass(frozen=True, eq=False)
class Table:
    """All messages of one name in the order of the file, a row a message. `position` (n,) tells
    where in the file each stood; `columns` are numbers, or bytes for texts; `integer` names those
    that the log holds as whole numbers without a scale of their own."""

    position: Index
    columns: Mapping[str, NDArray[Any]]
    integer: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.position)

    def get(self, *names: str) -> Array | None:
        """The first of these columns that is there."""
        return next((self.columns[name] for name in names if name in self.columns), None)

    def select(self, rows: Mask | Index) -> Table:
        """Some of the rows."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return Table(self.position[rows], columns, self.integer)

    def stack(self, *names: str) -> Array | None:
        """These columns side by side, (n, k), one alone as (n,), if all are there."""
        if not {*names} <= self.columns.keys():
            return None
        columns = [self.columns[name] for name in names]
        return np.stack(columns, axis=1) if len(columns) > 1 else columns[0]

    @property
    def time_s(self) -> Array | None:
        """Seconds since boot, if logged; `TimeMS` of an old GPS message is that of the week. Of PX4
        when it was sampled where that is logged, else when it was published."""
        if (sampled := self.get("timestamp_sample", "timestamp")) is not None:
            own = self.columns["timestamp"]
            return np.asarray((sampled if sampled.all() else own).astype(np.float64) / 1e6)
        if (microseconds := self.get("TimeUS")) is not None:
            return microseconds / 1e6
        milliseconds = self.get("T") if "Week" in self.columns else self.get("TimeMS")
        return None if milliseconds is None else milliseconds / 1e3


Tables = Mapping[str, Table]
Quantity = tuple[str, Table, Array]
"""The name of a column or of what disturbs, the messages that tell it, and its values at them."""


def find_first(tables: Tables, *names: str) -> Table | None:
    """The messages of the first instance, of the first of these names that is there."""
    table = next((tables[name] for name in names if name in tables), None)
    instance = None if table is None else table.get("I", "Inst", "Instance")
    if table is None or instance is None:
        return table
    return table.select(instance == instance.min())


def list_quantities(dialect: str, tables: Tables) -> Iterator[Quantity]:
    """What single messages tell as it is, by the rows of a dialect, and the place; numbers that are
    whole count so many of a unit."""
    rows = read_dialects()["beside"][dialect]
    for row in rows["messages"]:
        table = find_first(tables, *row["message"].split())
        if table is not None and row.get("unless") not in tables:
            for name, values in _read_row(table, row):
                yield name, table, values
    for message in rows["place"]["message"].split():
        table = find_first(tables, message)
        place = {} if table is None else _read_place(table, rows["place"])
        if table is None or not {"latitude_deg", "longitude_deg"} <= place.keys():
            continue
        latitude, longitude = place["latitude_deg"], place["longitude_deg"]
        fixed = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180) & (latitude != 0)
        if (fix := table.get(rows["place"]["fix"])) is not None:
            fixed &= fix >= 3
        if fixed.any():
            at = table.select(fixed)
            yield from ((name, at, values[fixed]) for name, values in place.items())
            return


def _read_row(table: Table, row: Mapping[str, Any]) -> Iterator[tuple[str, Array]]:
    """The quantities that a row tells of its messages; braces are each number that is there."""
    for name, columns in row["columns"].items():
        for number in range(16) if "{}" in name else range(1):
            values = table.stack(*columns.format(number).split())
            if values is None:
                continue
            if columns in table.integer:
                values = values / row.get("whole", 1)
            if "clip" in row:
                values = values.astype(np.float64)
                if np.nanmax(values, initial=0.0) <= row.get("above", -1.0):
                    continue
                values = np.clip(
                    values * row.get("factor", 1.0) + row.get("offset", 0.0), *row["clip"]
                )
            yield name.format(number + 1), values


def _read_place(table: Table, row: Mapping[str, Any]) -> dict[str, Array]:
    """Latitude, longitude and height: of several names the first that holds anything."""
    place = {}
    for quantity, written in row["columns"].items():
        names = [name for name in written.split() if name in table.columns]
        used = next((n for n in names if " " not in written or table.columns[n].any()), None)
        if used is not None:
            whole = table.columns[used].dtype.kind in "iu"
            per_unit = row["whole"][quantity] if whole else 1.0
            place[quantity] = table.columns[used].astype(np.float64) / per_unit
    return place


UNKNOWN_SD_DEG = 180.0


class Candidate(NamedTuple):
    """What a source says: times (k,), s, heading (k,) and its sd (k,), degrees; NaN for unknown."""

    name: str
    time: Array
    heading_deg: Array
    sd_deg: Array


def choose_heading(
    candidates: Iterable[Candidate], time: Array | None, estimate: Array | None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Heading, sd and source at the rows (n,) by the best of the sources, and notes. Nothing
    where no source is known for half of the rows. An estimate with an sd above 10° has not
    settled; messages come once a second at least, and a row 1.5 s from a known one has no
    heading. `estimate` (n,) is the autopilot's own heading, degrees, which stands where the
    source is not known."""
    if time is None:
        return {}, ()
    found: list[tuple[float, dict[str, Any], str]] = []
    notes: list[str] = []
    for one in candidates:
        settled = np.isfinite(one.heading_deg) & (one.sd_deg > 0) & (one.sd_deg <= 10.0)
        at = one.time[settled]
        near = np.zeros(len(time), dtype=bool) if len(at) < 2 else measure_reach(at, time) <= 1.5
        if near.mean() < 0.5:
            known = 100 * near.mean()
            notes.append(f"{one.name} was recorded and is known in {known:.0f} % of the rows")
            continue
        heading = resample(at, one.heading_deg[settled] % 360.0, time, period=360.0)
        sd = resample(at, np.maximum(one.sd_deg[settled], 0.1), time)
        assert heading is not None
        assert sd is not None
        sd = np.where(near, sd, UNKNOWN_SD_DEG)
        if estimate is not None:
            heading = np.where(near, heading, estimate % 360.0)
        columns = {"heading_deg": heading, "heading_sd_deg": sd, "heading_source": one.name}
        first = float(at.min() - one.time.min())
        late = f"; it had settled after {first:.0f} s" if first > 1.0 else ""
        said = f"the heading is by {one.name}, which does not follow the magnetometer{late}"
        found.append((float(np.median(sd)), columns, said))
    if not found:
        return {}, tuple(notes)
    _, columns, said = min(found, key=lambda one: one[0])
    return columns, (said, *notes)


class Track(NamedTuple):
    """A quantity by the name of its column, or of what disturbs: values (k,) or (k, 3) at `at`.
    `at` (k,) and the rows of the magnetometer `rows` (n,) are times, or places in the file."""

    name: str
    at: Array
    values: Array
    rows: Array


def resample_tracks(tracks: Iterable[Track]) -> dict[str, Any]:
    """The columns at the rows of the magnetometer; of disturbers those that ever change."""
    columns: dict[str, Any] = {"disturbers": {}}
    for name, at, values, rows in tracks:
        found = resample(at, values, rows, period=PERIODS_DEG.get(name))
        if name in COLUMNS:
            columns[name] = found
        elif found is not None and np.ptp(found) > 0:
            columns["disturbers"][name] = found
    return columns


def build_samples(
    name: str,
    found: Readings,
    tracks: Iterable[Track],
    *,
    time: Array | None,
    epoch: datetime | None,
    source: Input,
    rejected: Mapping[str, int],
    headings: Iterable[Candidate] = (),
) -> Samples:
    """One magnetometer of an autopilot, with everything else at its rows. `rejected` counts the
    rows that are gone already, by the reason; `headings` are what tells one without a magnetometer,
    which goes before the autopilot's own estimate."""
    columns = resample_tracks(tracks)
    estimate = columns.get("heading_deg")
    chosen, said = choose_heading(headings, time, estimate)
    estimated = estimate is not None and not chosen
    if estimate is not None:
        columns["heading_deg"] = estimate % 360.0
    return Samples(
        field=found.field,
        unit=found.unit,
        time=time,
        epoch=epoch,
        **{**columns, **chosen},
        name=name,
        frame=found.frame,
        device_id=found.device_id,
        heading_estimated=estimated,
        corrected=found.corrected,
        logged=found.logged,
        notes=(*found.notes, *said, *((ESTIMATED_ATTITUDE,) if estimated else ())),
        source=replace(source, count=len(found.field)),
        rejected={why: count for why, count in rejected.items() if count},
    )
