"""The temperatures of a campaign, put on one grid of minutes since the start of each station."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.samples import Samples
from agonic.thermal.campaign.recording import Campaign

MINUTE_S = 60.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """The temperature of one station over time, a value a minute.

    `level_C` (m,) is the median of the thermometers that work; `start_s` the time of the first
    row, and `lengths_s` how long each sensor was recorded.
    """

    level_C: Array
    lengths_s: Mapping[str, float]

    @property
    def length_s(self) -> float:
        """The length of the longest recording."""
        return max(self.lengths_s.values())

    @property
    def turn(self) -> int:
        """The minute of the lowest temperature: the middle of those within 0.5 °C of it."""
        cold = np.flatnonzero(self.level_C <= np.nanmin(self.level_C) + 0.5)
        return int(np.median(cold))


def average_minutes(samples: Samples, start_s: float) -> Array:
    """The temperature of each minute since `start_s`, its mean; NaN in gaps and before the first.

    >>> s = Samples(field=np.ones((4, 3)), time=[0.0, 30.0, 60.0, 90.0],
    ...             temperature=[1.0, 3.0, 5.0, 7.0])
    >>> average_minutes(s, 0.0).tolist()
    [2.0, 6.0]
    """
    assert samples.time is not None
    assert samples.temperature is not None
    minute = ((samples.time - start_s) / MINUTE_S).astype(np.intp)
    counts = np.bincount(minute)
    sums = np.bincount(minute, weights=samples.temperature)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def find_still_stretches(level: Array, quiet_C: float = 1e-9) -> list[tuple[int, int]]:
    """First minute and the one after the last of the stretches in which nothing changes.

    >>> find_still_stretches(np.array([1.0, 1.0, 1.0, 2.0, 3.0]))
    [(0, 3)]
    """
    same = np.concatenate([[False], np.abs(np.diff(level)) <= quiet_C, [False]])
    edges = np.flatnonzero(same[1:] != same[:-1])
    return [(int(a), int(b) + 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def find_stuck(level: Array, course: Array, moved_C: float = 5.0) -> tuple[int, int] | None:
    """The minutes in which a thermometer stood still while the temperature moved by `moved_C`.

    >>> find_stuck(np.full(90, 21.0), np.linspace(50.0, -10.0, 90))
    (0, 90)
    """
    n = min(len(level), len(course))
    for first, last in find_still_stretches(level[:n]):
        went = course[first:last]
        if np.isfinite(went).any() and np.nanmax(went) - np.nanmin(went) >= moved_C:
            return first, last
    return None


def find_courses(
    campaign: Campaign,
) -> tuple[dict[int, Course], dict[str, dict[int, tuple[int, int]]]]:
    """The course of each station, and the minutes in which thermometers of sensors stood still.

    What stood still is told by the others: at the same station first, then at the same minute of
    all stations, then by the profile that was planned.
    """
    levels: dict[int, dict[str, Array]] = {}
    lengths: dict[int, dict[str, float]] = {}
    for name, by in campaign.recordings.items():
        for number, samples in by.items():
            if samples.time is None or samples.temperature is None:
                continue
            others = (campaign.recordings[n].get(number) for n in campaign.sensors)
            start = min(float(o.time[0]) for o in others if o is not None and o.time is not None)
            levels.setdefault(number, {})[name] = average_minutes(samples, start)
            lengths.setdefault(number, {})[name] = float(samples.time[-1] - start)
    usual = _take_median([level for own in levels.values() for level in own.values()])
    profile = campaign.description.profile
    planned = None if profile is None else profile.at(MINUTE_S * np.arange(len(usual)) + 30.0)
    made: dict[int, Course] = {}
    still: dict[str, dict[int, tuple[int, int]]] = {}
    for number, here in levels.items():
        guides = [*here.values(), usual, *([] if planned is None else [planned])]
        course = _choose_liveliest(guides)
        at_rest = {
            name: span for name, level in here.items() if (span := find_stuck(level, course))
        }
        for name, span in at_rest.items():
            still.setdefault(name, {})[number] = span
        working = [level for name, level in here.items() if name not in at_rest]
        if working:
            made[number] = Course(level_C=_take_median(working), lengths_s=lengths[number])
    return made, still


def _take_median(levels: list[Array]) -> Array:
    """The median of each minute over courses of different length."""
    if not levels:
        return np.zeros(0)
    table = np.full((len(levels), max(map(len, levels))), np.nan)
    for row, level in zip(table, levels, strict=True):
        row[: len(level)] = level
    known = np.isfinite(table).any(axis=0)
    middle = np.full(table.shape[1], np.nan)
    middle[known] = np.nanmedian(table[:, known], axis=0)
    return middle


def _choose_liveliest(levels: list[Array]) -> Array:
    """The course with the largest range: one that stands still tells nothing of the others."""
    return max(levels, key=lambda level: float(np.nanmax(level) - np.nanmin(level)))
