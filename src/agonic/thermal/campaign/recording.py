"""`Campaign`: the recordings of all sensors at all stations, and what reading them showed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.health import Finding
from agonic.provenance import Input
from agonic.readable import Readable
from agonic.samples import Samples
from agonic.thermal.campaign.description import Description

_BETWEEN_S = 60.0
"""Seconds put between stations whose clocks start anew."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign(Readable):
    """What was recorded in the chamber.

    `recordings` holds the samples by sensor and by number of the station, as recorded;
    `description` what they are about; `findings` what the reader came across; `restarts` by sensor
    and station the seconds after the first reading at which its clock began anew.
    """

    recordings: Mapping[str, Mapping[int, Samples]]
    description: Description = field(default_factory=Description)
    inputs: tuple[Input, ...] = ()
    findings: tuple[Finding, ...] = ()
    restarts: Mapping[str, Mapping[int, tuple[float, ...]]] = field(default_factory=dict)

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of the sensors that have readings."""
        return tuple(self.recordings)

    @property
    def stations(self) -> tuple[int, ...]:
        """The numbers of the stations that any sensor has readings of."""
        return tuple(sorted({number for by in self.recordings.values() for number in by}))

    @property
    def rows(self) -> int:
        """Readings of all sensors at all stations."""
        return sum(len(samples) for by in self.recordings.values() for samples in by.values())

    def samples(self, sensor: str) -> Samples:
        """All readings of a sensor, station after station, with the `station` of each.

        Stations recorded by a clock that went on keep their times; where each starts anew they
        follow each other with a minute between, the same for all sensors.
        """
        if sensor not in self.recordings:
            raise AgonicError(f"no sensor {sensor!r}; there are {', '.join(self.sensors)}")
        by = self.recordings[sensor]
        start = self.starts
        order = sorted(by, key=lambda number: _find_first(by[number]) + start.get(number, 0.0))
        first = by[order[0]]
        parts = [by[number] for number in order]
        whole: dict[str, Array] = {"field": np.concatenate([part.field for part in parts])}
        if all(part.temperature is not None for part in parts):
            whole["temperature"] = np.concatenate(
                [part.temperature for part in parts if part.temperature is not None]
            )
        if start:
            times = [
                part.time + start[number]
                for number, part in zip(order, parts, strict=True)
                if part.time is not None
            ]
            whole["time"] = np.concatenate(times)
        lengths = [len(part) for part in parts]
        rejected: dict[str, int] = {}
        for part in parts:
            for why, count in part.rejected.items():
                rejected[why] = rejected.get(why, 0) + count
        return Samples(
            **whole,  # type: ignore[arg-type]
            station=np.repeat(np.array(order, dtype=np.float64), lengths),
            unit=first.unit,
            name=sensor,
            frame=first.frame,
            notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
            rejected=rejected,
            source=None if first.source is None else replace(first.source, count=sum(lengths)),
        )

    def files(self, sensor: str) -> tuple[Input, ...]:
        """The files that the readings of a sensor came from, with how many from each."""
        found: dict[tuple[str, str], Input] = {}
        for samples in self.recordings[sensor].values():
            if samples.source is None:
                continue
            own = replace(samples.source, count=len(samples))
            same = found.get((own.name, own.sha256))
            count = own.count + (0 if same is None else same.count)
            found[own.name, own.sha256] = replace(own, count=count)
        return tuple(found.values())

    @property
    def starts(self) -> dict[int, float]:
        """What to add to the clock of each station; empty where a recording has no clock."""
        spans: dict[int, list[float]] = {}
        for by in self.recordings.values():
            for number, part in by.items():
                if part.time is None:
                    return {}
                epoch = 0.0 if part.epoch is None else part.epoch.timestamp()
                low, high = part.time[0] + epoch, part.time[-1] + epoch
                old = spans.get(number, [low, high])
                spans[number] = [min(old[0], low), max(old[1], high)]
        order = sorted(spans, key=lambda number: (spans[number][0], number))
        apart = all(spans[a][1] < spans[b][0] for a, b in pairwise(order))
        clock: dict[int, float] = {}
        reached = 0.0
        for number in order if apart else sorted(spans):
            low, high = spans[number]
            offset = -spans[order[0]][0] if apart else reached - low
            clock[number] = offset + self._epoch(number)
            reached += high - low + _BETWEEN_S
        return clock

    def _epoch(self, number: int) -> float:
        epochs = (by[number].epoch for by in self.recordings.values() if number in by)
        return next((epoch.timestamp() for epoch in epochs if epoch is not None), 0.0)

    def without(self, left_out: Mapping[str, set[int]], *found: Finding) -> Campaign:
        """The campaign without some recordings, and with the findings that say why."""
        kept = {
            name: {n: s for n, s in by.items() if n not in left_out.get(name, set())}
            for name, by in self.recordings.items()
        }
        return replace(
            self,
            recordings={name: by for name, by in kept.items() if by},
            findings=(*self.findings, *found),
        )


def _find_first(samples: Samples) -> float:
    """The time of the first reading by its own clock; 0 without one."""
    return 0.0 if samples.time is None else float(samples.time[0])
