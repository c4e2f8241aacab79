"""What an autopilot recorded beside a magnetometer, at its rows: what all readers share.

A heading may come from elsewhere than the magnetometer. A dual-antenna receiver measures it; an
estimator of yaw by velocities (EKF-GSF) finds it from GPS velocity and acceleration alone, once the
vehicle has moved. Both are true, not magnetic. Where none is known at a row, the autopilot's own
estimate stands there with an sd of 180°.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.logs.log import Readings
from agonic.logs.rows.auxiliary import PERIODS_DEG, measure_reach
from agonic.logs.rows.resample import ESTIMATED_ATTITUDE, resample
from agonic.provenance import Input
from agonic.samples import COLUMNS, Samples

UNKNOWN_SD_DEG = 180.0
SETTLED_DEG = 10.0
"""An estimate that states a larger sd has not settled."""
LEAST_SD_DEG = 0.1
REACH_S = 1.5
"""Messages come five times a second or once; a row farther from a known one has no heading."""
ENOUGH = 0.5
"""Share of the rows for which a source is known, to go before the autopilot's own estimate."""


class Candidate(NamedTuple):
    """What a source says: times (k,), s, heading (k,) and its sd (k,), degrees; NaN for unknown."""

    name: str
    time: Array
    heading_deg: Array
    sd_deg: Array


def choose_heading(
    candidates: Iterable[Candidate], time: Array | None, estimate: Array | None
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Heading, sd and source at the rows (n,) by the best of the sources, and notes. Nothing where
    no source is known for half of the rows. `estimate` (n,) is the autopilot's own heading,
    degrees, which stands where the source is not known."""
    if time is None:
        return {}, ()
    found: list[tuple[float, dict[str, Any], str]] = []
    notes: list[str] = []
    for one in candidates:
        settled = np.isfinite(one.heading_deg) & (one.sd_deg > 0) & (one.sd_deg <= SETTLED_DEG)
        at = one.time[settled]
        near = (
            np.zeros(len(time), dtype=bool) if len(at) < 2 else measure_reach(at, time) <= REACH_S
        )
        if near.mean() < ENOUGH:
            known = 100 * near.mean()
            notes.append(f"{one.name} was recorded and is known in {known:.0f} % of the rows")
            continue
        heading = resample(at, one.heading_deg[settled] % 360.0, time, period=360.0)
        sd = resample(at, np.maximum(one.sd_deg[settled], LEAST_SD_DEG), time)
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
