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
from agonic.thermal.maths.binned_sums import Binned
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

    >>> t = np.linspace(50.0, -10.0, 900)
    >>> noisy = t + 0.5 * np.random.default_rng(0).normal(size=900)
    >>> found = [judge_thermometer([(level, smooth_thermometer(level))]) for level in (t, noisy)]
    >>> [[finding.name for finding in each] for each in found]
    [[], ['noisy thermometer']]
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
