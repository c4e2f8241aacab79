"""What the recordings alone give away: missing stations, stuck thermometers, files cut short."""

from __future__ import annotations

import numpy as np

from agonic.health import Finding
from agonic.thermal.fit.settings import Settings
from agonic.thermal.maths.binned_sums import Binned, StationRecord
from agonic.thermal.maths.ellipsoids import FEWEST
from agonic.thermal.names import name_stations

STANDARD = 12
STANDING = 0.4  # of a recording: a thermometer that stands still for so long while others move
SHORT = 0.8  # of the usual range of temperatures


def find_still_thermometers(sums: Binned) -> set[int]:
    """Stations whose thermometer stood still while that of the others moved, or was expected to."""
    spans = {n: seen.warmest - seen.coldest for n, seen in sums.stations.items()}
    usual = float(np.median(list(spans.values())))
    return {
        number
        for number, seen in sums.stations.items()
        if spans[number] < 0.05 * max(usual, 1.0) or (seen.standing > STANDING and usual > 1.0)
    }


def judge_recordings(sums: Binned, left_out: set[int], settings: Settings) -> list[Finding]:
    """What the recordings alone say, before any fit."""
    used = sorted(set(sums.stations) - left_out)
    found = []
    if left_out:
        found.append(
            Finding(
                "stuck thermometer",
                "check",
                f"the thermometer stands still at {name_stations(left_out)}, which "
                f"{'were' if len(left_out) > 1 else 'was'} left out",
                "check the temperature sensor, or take the temperature of a neighbour",
            )
        )
    found += _find_missing(sums, settings, left_out)
    spans = {n: sums.stations[n].warmest - sums.stations[n].coldest for n in used}
    usual = float(np.median(list(spans.values()))) if spans else 0.0
    short = [n for n in used if spans[n] < SHORT * usual]
    one_way = [n for n in used if n not in short and _goes_one_way(sums.stations[n])]
    if short:
        found.append(
            Finding(
                "short recording",
                "check",
                f"{name_stations(short)} cover{'s' if len(short) == 1 else ''} only part of the "
                "range of temperatures",
                "a file may have ended in the middle: record again, or use the rest as it is",
            )
        )
    whole = [n for n in used if not _goes_one_way(sums.stations[n])]
    if one_way and whole:
        found.append(
            Finding(
                "one direction",
                "check",
                f"{name_stations(one_way)} {'was' if len(one_way) == 1 else 'were'} recorded "
                f"only while {'cooling' if sums.stations[one_way[0]].heating == 0 else 'heating'}",
                "the file may have ended in the middle: record again, or use the rest as it is",
            )
        )
    return found


def _goes_one_way(seen: StationRecord) -> bool:
    rows = seen.rows + seen.dropped
    return seen.heating < 0.05 * rows or seen.heating > 0.95 * rows


def _find_missing(sums: Binned, settings: Settings, left_out: set[int]) -> list[Finding]:
    """Stations that were described and are not there."""
    described = settings.orientations
    used = set(sums.stations) - left_out
    expected = set(described) if described is not None else set(range(1, STANDARD + 1))
    absent = expected - set(sums.stations)
    if described is None and len(used) >= STANDARD:
        return []
    if described is not None and set(sums.stations) - expected:
        odd = set(sums.stations) - expected
        return [
            Finding(
                "turns",
                "check",
                f"how {name_stations(odd)} stood is not described, so only the magnitude is used",
                "describe every station that was recorded",
            )
        ]
    if not absent:
        return []
    count = len(used)
    words = (
        name_stations(absent)
        if described is not None or max(used) <= STANDARD
        else f"{len(absent)}"
    )
    return [
        Finding(
            "missing stations",
            "check" if count >= FEWEST or described is not None else "refuse",
            f"{words} {'are' if len(absent) > 1 else 'is'} missing, {count} left",
            "record them, or read on for what remains determined",
        )
    ]
