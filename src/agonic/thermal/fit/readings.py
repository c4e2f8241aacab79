"""From samples to sums by station, direction and temperature."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import CoverageError, LogError
from agonic.health import Finding, figure
from agonic.provenance import Input
from agonic.samples import Samples
from agonic.thermal.campaign.description import name_stations
from agonic.thermal.fit.each_temperature import FEWEST
from agonic.thermal.fit.problem import Settings
from agonic.thermal.maths.binned_sums import Binned, StationRecord
from agonic.thermal.maths.thermometer import CALM_C, Smoothed, smooth_thermometer

KELVIN = 273.15
NOISY_C = 0.2
"""Scatter of a thermometer that is told of."""
_HOTTEST_C = 150.0
"""No magnetometer works where it is hotter: such numbers are kelvin."""


class Facts(NamedTuple):
    """Whose readings they are: what a calibration takes over from the samples.

    `source` stands for all readings; `files` are those they came from, where there were several.
    """

    name: str = "mag"
    unit: str = "nT"
    frame: str = "m"
    device_id: int | None = None
    source: Input | None = None
    files: tuple[Input, ...] = ()

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Every file that went in, or the one source."""
        return self.files or (() if self.source is None else (self.source,))


def collect_facts(samples: Samples) -> Facts:
    """Those of samples."""
    whence = samples.source or Input.of_array(samples.name, samples.field)
    return Facts(samples.name, samples.unit, samples.frame, samples.device_id, whence)


def convert_to_celsius(temperature: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Temperatures in °C, and the finding that they were in kelvin."""
    if float(np.median(temperature)) < _HOTTEST_C:
        return temperature, ()
    low, high = float(temperature.min()), float(temperature.max())
    return temperature - KELVIN, (
        Finding(
            "kelvin",
            "check",
            f"the temperatures run from {low:.0f} to {high:.0f}: they were taken for kelvin, and "
            "273.15 was taken off",
            "have the logger write °C, or convert before the correction is applied: it takes °C",
        ),
    )


def judge_thermometer(parts: Iterable[tuple[Array, Smoothed]]) -> tuple[Finding, ...]:
    """Whether temperatures, recording after recording, scatter from reading to reading.

    A box has no such changes: second differences are those of the thermometer. Parameters: the
    temperatures of each recording as they were read, and after `smooth_thermometer`.
    """
    both = list(parts)
    squares = np.concatenate([np.zeros(1), *(np.diff(read, 2) ** 2 for read, _ in both)])
    noise = float(np.sqrt(squares.sum() / max(len(squares) - 1, 1) / 6))
    if noise < NOISY_C:
        return ()
    left = _find_left([calmed for _, calmed in both])
    return (
        Finding(
            "noisy thermometer",
            "check",
            f"the thermometer scatters by {figure(noise)} °C from reading to reading; its smoothed "
            f"course was used, which is known to {figure(left)} °C, and less well where the "
            "temperature begins or ceases to move: there standard errors are too small by up to "
            "three times",
            "log the mean of the thermometer over a minute, or that of a better one nearby",
        ),
    )


def _find_left(calmed: Sequence[Smoothed]) -> float:
    """What is left of the noise of thermometers that were smoothed, °C; 0 where none was."""
    left = [part.left_C if part.noise_C >= CALM_C else 0.0 for part in calmed]
    rows = [len(part.temperature) for part in calmed]
    return float(np.sqrt(np.average(np.square(left), weights=rows))) if rows else 0.0


def require_temperature(samples: Samples) -> Array:
    """The temperatures, or a clear error."""
    if samples.temperature is None:
        raise LogError(
            f"{samples.name}: the samples have no temperature; record the magnetometer's own "
            "(temperature_C) beside the readings"
        )
    return samples.temperature


def sum_readings(samples: Samples, width_C: float) -> tuple[Binned, tuple[Finding, ...]]:
    """The sums of all stations, and what was found on the way."""
    level, findings = convert_to_celsius(require_temperature(samples))
    if samples.station is None:
        raise LogError(
            f"{samples.name}: the samples have no station; give the number of the position "
            "(station) of each row, or a vector reference"
        )
    sums = Binned(width_C)
    edges = [0, *(np.flatnonzero(np.diff(samples.station)) + 1).tolist(), len(samples)]
    calmed: list[Smoothed] = []
    for start, stop in pairwise(edges):
        part = slice(start, stop)
        time = None if samples.time is None else samples.time[part]
        calmed.append(smooth_thermometer(level[part], time))
        sums.add(int(samples.station[start]), samples.field[part], calmed[-1].temperature, time)
    if not sums.stations:
        raise CoverageError("there are no readings at all", turns="record the twelve stations")
    sums.thermometer_C = _find_left(calmed)
    parts = (level[start:stop] for start, stop in pairwise(edges))
    return sums, (*findings, *judge_thermometer(zip(parts, calmed, strict=True)))


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
