"""Whether the boards kept working: gaps in their recordings, clocks that began anew."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.samples import Samples
from agonic.thermal.campaign.description import name_stations
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
    """The mean temperature of each minute since `start_s`; NaN in gaps and before the first."""
    assert samples.time is not None
    assert samples.temperature is not None
    minute = ((samples.time - start_s) / MINUTE_S).astype(np.intp)
    counts = np.bincount(minute)
    sums = np.bincount(minute, weights=samples.temperature)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def find_still_stretches(level: Array, quiet_C: float = 1e-9) -> list[tuple[int, int]]:
    """First minute and the one after the last of the stretches in which nothing changes."""
    same = np.concatenate([[False], np.abs(np.diff(level)) <= quiet_C, [False]])
    edges = np.flatnonzero(same[1:] != same[:-1])
    return [(int(a), int(b) + 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def find_stuck(level: Array, course: Array, moved_C: float = 5.0) -> tuple[int, int] | None:
    """The minutes in which a thermometer stood still while the temperature moved by `moved_C`."""
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
        course = max(guides, key=lambda level: float(np.nanmax(level) - np.nanmin(level)))
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


_GAP_S = 5.0


class Board(NamedTuple):
    """How sensors that share a clock were recorded, over all stations.

    `missing` is how many readings of each sensor the gaps cost; `longest_s` the longest gap, at
    station `longest_at`; `gaps` and `restarts` are counts by station; `rejected` readings were no
    numbers, or had no place in time.
    """

    name: str
    sensors: tuple[str, ...]
    stations: tuple[int, ...]
    readings: int
    missing: int
    rejected: int
    gaps: Mapping[int, int]
    longest_s: float
    longest_at: int
    restarts: Mapping[int, int]


def list_boards(campaign: Campaign) -> list[Board]:
    """The boards of a campaign, by the description, else by clocks that are the same."""
    return [_describe_board(campaign, name, own) for name, own in _group_sensors(campaign).items()]


def _group_sensors(campaign: Campaign) -> dict[str, list[str]]:
    """Sensors by the board that they are on."""
    given = {sensor.name: sensor.board for sensor in campaign.description.sensors}
    groups: list[tuple[str, list[str]]] = []
    for name in campaign.sensors:
        board = given.get(name, "")
        for other, own in groups:
            if other == board and (board or _share_clock(campaign, own[0], name)):
                own.append(name)
                break
        else:
            groups.append((board, [name]))
    if len(groups) == 1 and len(campaign.sensors) > 1:
        return {groups[0][0] or "all sensors": groups[0][1]}
    return {board or ", ".join(own): own for board, own in groups}


def _share_clock(campaign: Campaign, one: str, other: str) -> bool:
    """Whether two sensors were read at the same moments at the first station of both."""
    a, b = campaign.recordings[one], campaign.recordings[other]
    both = sorted(set(a) & set(b))
    if not both:
        return False
    first, second = a[both[0]].time, b[both[0]].time
    return first is not None and second is not None and np.array_equal(first, second)


def _describe_board(campaign: Campaign, name: str, sensors: list[str]) -> Board:
    recorded: defaultdict[int, list[Samples]] = defaultdict(list)
    for sensor in sensors:
        for number, samples in campaign.recordings[sensor].items():
            recorded[number].append(samples)
    gaps: dict[int, int] = {}
    missing, longest_s, longest_at = 0, 0.0, 0
    for number, own in sorted(recorded.items()):
        found, usual = max((find_gaps(s.time) for s in own), key=lambda pair: len(pair[0]))
        if len(found):
            gaps[number] = len(found)
            missing += round(float(found.sum() / usual)) - len(found)
            if float(found.max()) > longest_s:
                longest_s, longest_at = float(found.max()), number
    restarts = [campaign.restarts.get(sensor, {}) for sensor in sensors]
    everything = [samples for own in recorded.values() for samples in own]
    return Board(
        name=name,
        sensors=tuple(sensors),
        stations=tuple(sorted(recorded)),
        readings=sum(map(len, everything)),
        missing=missing,
        rejected=sum(sum(samples.rejected.values()) for samples in everything),
        gaps=gaps,
        longest_s=longest_s,
        longest_at=longest_at,
        restarts={
            n: max(len(at.get(n, ())) for at in restarts)
            for n in sorted({n for at in restarts for n in at})
        },
    )


def find_gaps(time: Array | None) -> tuple[Array, float]:
    """The steps of a clock that are holes, s, and the usual step."""
    if time is None or len(time) < 3:
        return np.zeros(0), 1.0
    steps = np.diff(time)
    usual = float(np.median(steps))
    return np.asarray(steps[steps > max(20 * usual, _GAP_S)]), usual


def judge_boards(campaign: Campaign) -> list[Finding]:
    """Holes in the recordings, and clocks that began anew, each board's once."""
    boards = list_boards(campaign)
    return [*_judge_gaps(boards), *_judge_restarts(boards)]


def _judge_gaps(boards: list[Board]) -> list[Finding]:
    holed = [board for board in boards if board.gaps]
    if not holed:
        return []
    worst = max(holed, key=lambda board: board.longest_s)
    total = sum(sum(board.gaps.values()) for board in holed)
    long = worst.longest_s > 10 * MINUTE_S
    whose = "" if len(boards) == 1 else f" {', '.join(board.name for board in holed)},"
    return [
        Finding(
            "recording gaps",
            "check" if long else "note",
            f"{total} gap{'s' if total > 1 else ''} in the recordings of{whose} "
            f"{name_stations(n for board in holed for n in board.gaps)}, the longest "
            f"{figure(worst.longest_s, 3)} s at station {worst.longest_at}",
            "look at the logger, and whether the board keeps working over the whole range"
            if long
            else "",
        )
    ]


def _judge_restarts(boards: list[Board]) -> list[Finding]:
    begun = [board for board in boards if board.restarts]
    if not begun:
        return []
    count = sum(sum(board.restarts.values()) for board in begun)
    times = "once" if count == 1 else f"{count} times"
    whose = "" if len(boards) == 1 else f" of {', '.join(board.name for board in begun)}"
    return [
        Finding(
            "clock restarts",
            "check",
            f"the clock{whose} started again {times}, at "
            f"{name_stations(n for board in begun for n in board.restarts)}: the board or its "
            "logger was reset, and how long it was off is not known; all readings are used",
            "look at its supply, and whether the board keeps working over the whole range",
        )
    ]
