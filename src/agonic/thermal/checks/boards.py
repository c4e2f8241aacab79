"""Whether the boards kept working: gaps in their recordings, clocks that began anew."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.samples import Samples
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.thermometers import MINUTE_S
from agonic.thermal.names import name_stations

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
    """The steps of a clock that are holes, s, and the usual step.

    >>> find_gaps(np.array([0.0, 1.0, 2.0, 60.0, 61.0]))[0].tolist()
    [58.0]
    """
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
