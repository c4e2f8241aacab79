"""Whether the stations saw one field: swapped stations, a chamber that drifted, odd stations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.samples import Samples
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.maths.response import Response, compute_misfit, fit_response
from agonic.thermal.maths.stations import find_exchange
from agonic.thermal.names import name_stations

FEWEST = 8
"""Stations needed: 3 n readings against 9 of the response, 3 of the bias, 2 of the field."""
_WINDOW_C = 3.0
_MISFIT = 0.05
"""Share of the field that readings at the described turns may be off: fixture errors of 3°."""
_BETTER = 0.4
_EXPLAINED = 0.1
"""Share of the field that two stations exchanged may leave to be what was wrong."""
_DRIFT = 0.005
_TURNED_DEG = 3.0
_UNLIKELY = 18.0
"""Sum of squares of three numbers over their standard errors: by chance once in 2000 campaigns."""
_UNKNOWNS = 14


class Levels(NamedTuple):
    """Mean readings (k, 3) of a sensor at one temperature while cooling and while heating.

    `moments` (k, 2) are the times of both, s; NaN where a pass was not recorded.
    """

    cooling: Array
    heating: Array
    moments: Array

    @property
    def mean(self) -> Array:
        """Both; where only one of them was recorded, that one."""
        return _average_known(np.stack([self.cooling, self.heating]), 0)


def check_field(campaign: Campaign) -> list[Finding]:
    """What the readings at equal temperature say of the turns of the stations and of the field."""
    rotations = campaign.description.rotations
    order = [number for number in campaign.stations if rotations and number in rotations]
    if rotations is None or len(order) < FEWEST:
        return []
    rot_nb = np.array([rotations[number].as_matrix() for number in order])
    levels = {
        name: level
        for name in campaign.sensors
        if (level := _measure_levels(campaign, name, order))
    }
    if not levels:
        return []
    means = [level.mean for level in levels.values()]
    misfit = compute_misfit(means, rot_nb)
    if misfit > _MISFIT:
        return [_judge_misfit(means, rot_nb, order, misfit, assumed=campaign.description.assumed)]
    explained = {
        name: fit_response(level.mean[there], rot_nb[there])
        for name, level in levels.items()
        if (there := np.isfinite(level.mean[:, 0])).sum() >= FEWEST
    }
    unit = campaign.description.magnitude
    changes = _compare_passes(explained, levels, rot_nb)
    return [
        *_judge_drift(explained, levels, changes, order, unit),
        *_judge_fixture(explained, levels, order),
        *_judge_changes(changes, len(explained), unit),
    ]


def _measure_levels(campaign: Campaign, name: str, order: list[int]) -> Levels | None:
    """The readings of a sensor at the temperature in the middle of what all its stations saw."""
    by = {n: s for n, s in campaign.recordings[name].items() if n in order}
    ends = [
        (float(s.temperature.min()), float(s.temperature.max()))
        for s in by.values()
        if s.temperature is not None
    ]
    if len(ends) < FEWEST or len(ends) < len(by):
        return None
    lowest, highest = np.median(ends, axis=0)
    middle = (lowest + highest) / 2
    made = np.full((len(order), 2, 4), np.nan)
    for k, number in enumerate(order):
        if number in by:
            made[k] = _measure_passes(by[number], middle)
    levels = Levels(made[:, 0, :3], made[:, 1, :3], made[:, :, 3] + _find_starts(campaign, order))
    return levels if np.isfinite(levels.mean[:, 0]).sum() >= FEWEST else None


def _find_starts(campaign: Campaign, order: list[int]) -> Array:
    """What the clocks of the stations lack to one that went on (k, 1)."""
    starts = campaign.starts
    return np.array([[starts.get(number, 0.0)] for number in order])


def _measure_passes(samples: Samples, level: float) -> Array:
    """Field and time (2, 4) at a temperature while cooling and while heating."""
    assert samples.temperature is not None
    time = np.full(len(samples), np.nan) if samples.time is None else samples.time
    coldest = int(np.argmin(samples.temperature))
    halves = (slice(None, coldest + 1), slice(coldest + 1, None))
    both = np.column_stack([samples.field, time])
    return np.array([_interpolate(samples.temperature[h], both[h], level) for h in halves])


def _interpolate(temperature: Array, values: Array, level: float) -> Array:
    """Values (n, c) at a temperature (c,), by a line through 6 °C about it."""
    near = np.abs(temperature - level) <= _WINDOW_C
    if near.sum() < 10:
        return np.full(values.shape[1], np.nan)
    d, b = temperature[near] - level, values[near]
    drawn = np.clip(b, *np.percentile(b, (2.0, 98.0), axis=0))  # spikes
    centred = d - d.mean()
    slope = centred @ drawn / max(float(centred @ centred), 1e-12)
    return np.asarray(drawn.mean(axis=0) - slope * d.mean())


def _judge_misfit(
    means: list[Array], rot_nb: Array, order: list[int], misfit: float, *, assumed: bool
) -> Finding:
    """Readings that the described turns do not explain; perhaps those of two stations exchanged.

    Where nobody described the stations (`assumed`), others than the standard ones are no mistake.
    """
    i, j, left = find_exchange(rot_nb, lambda order: compute_misfit(means, order))
    if left < min(_BETTER * misfit, _EXPLAINED):
        return Finding(
            "swapped stations",
            "check",
            f"{name_stations([order[i], order[j]])} look swapped in the description: exchanged, "
            f"the readings fit the turns to {100 * left:.2g} % of the field, and as described only "
            f"to {100 * misfit:.2g} %",
            "exchange them in campaign.toml; until then only the magnitude is used",
        )
    if assumed:
        return Finding(
            "turns",
            "note",
            "nobody described how the stations stood, and they are not the standard ones: only the "
            "magnitude is used",
        )
    return Finding(
        "turns",
        "check",
        f"the readings do not fit the described turns of the stations: {100 * misfit:.2g} % of the "
        "field is left",
        "check how the box stood at each station; until then only the magnitude is used",
    )


def _find_common_mode(
    explained: Mapping[str, Response], levels: Mapping[str, Levels], count: int
) -> Array:
    """What the field of each station was more (k, 3), as a share of it: median over the sensors."""
    seen = np.full((len(explained), count, 3), np.nan)
    for row, (name, found) in zip(seen, explained.items(), strict=True):
        row[np.isfinite(levels[name].mean[:, 0])] = found.field_n - found.field
    there = np.isfinite(seen[:, :, 0]).any(axis=0)
    middle = np.zeros((count, 3))
    middle[there] = np.nanmedian(seen[:, there], axis=0)
    return middle


def _find_direction(explained: Mapping[str, Response]) -> Array:
    field = np.mean([found.field for found in explained.values()], axis=0)
    return np.asarray(field / np.linalg.norm(field))


def _judge_drift(
    explained: Mapping[str, Response],
    levels: Mapping[str, Levels],
    changes: Array,
    order: list[int],
    magnitude: float | None,
) -> list[Finding]:
    """A field that changed steadily from the first station to the last.

    Two estimates are weighed together: from station to station, where errors of the fixture look
    alike, and from cooling to heating within the stations, where they do not.
    """
    if not explained:
        return []
    moments = _average_known(np.array([levels[name].moments for name in explained]), 0)
    middle = _average_known(moments, 1)
    if not np.isfinite(middle).all() or not np.ptp(middle) > 0:
        return []
    pace = (middle - middle.mean()) / np.ptp(middle)
    common = _find_common_mode(explained, levels, len(order))
    estimates = [_fit_slope(pace, common)]
    apart = (moments[:, 1] - moments[:, 0]) / np.ptp(middle)
    known = np.isfinite(changes[:, 0]) & np.isfinite(apart)
    if known.sum() >= FEWEST:
        estimates.append(_fit_slope(-apart[known], changes[known], through_zero=True))
    weight = sum(1.0 / variance for _, variance in estimates)
    slope = sum((value / variance for value, variance in estimates), np.zeros(3)) / weight
    size = float(np.linalg.norm(slope))
    if size < _DRIFT or float(np.sum(slope**2 * weight)) < _UNLIKELY:
        return []
    return [
        Finding(
            "field drifted",
            "check",
            f"from {name_stations(order[:1])} to {name_stations(order[-1:])} the field "
            f"changed steadily, by some {_format_amount(size, magnitude)}",
            "keep iron, vehicles and currents away from the chamber: such a change is taken for an "
            "error of the sensors",
        )
    ]


def _average_known(values: Array, axis: int) -> Array:
    """The mean of what is known along an axis; NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _fit_slope(pace: Array, values: Array, through_zero: bool = False) -> tuple[Array, float]:
    """The slope (3,) of values (k, 3) over pace (k,), and its variance on an axis."""
    centred = pace if through_zero else pace - pace.mean()
    power = float(centred @ centred)
    slope = np.asarray(centred @ values / power)
    left = values - np.outer(centred, slope)
    freedom = 3 * len(pace) - (3 if through_zero else _UNKNOWNS)
    return slope, float(np.sum(left**2)) / freedom / power


def _judge_fixture(
    explained: Mapping[str, Response], levels: Mapping[str, Levels], order: list[int]
) -> list[Finding]:
    """Stations that stand elsewhere than described."""
    if not explained:
        return []
    common = _find_common_mode(explained, levels, len(order))
    across = np.cross(_find_direction(explained), common)
    away = np.degrees(np.linalg.norm(across, axis=1))
    if away.max() < _TURNED_DEG:
        return []
    least = max(_TURNED_DEG, 0.8 * float(away.max()))  # one askew draws the others along
    odd = [number for number, angle in zip(order, away, strict=True) if angle >= least]
    return [
        Finding(
            "fixture",
            "check",
            f"{name_stations(odd)} stood {away.max():.0f}° or more from where described, or the "
            f"field there "
            "had another direction",
            "seat the box against the stops of the fixture",
        )
    ]


def _compare_passes(
    explained: Mapping[str, Response], levels: Mapping[str, Levels], rot_nb: Array
) -> Array:
    """Cooling minus heating of the chamber's field (k, 3), as a share of it; NaN where unknown.

    What a sensor has by itself (hysteresis) is the same in its own axes at every station; what is
    left, in the chamber's axes and alike for all sensors, is the chamber's.
    """
    sums, counts = np.zeros((len(rot_nb), 3)), np.zeros((len(rot_nb), 1))
    for name, found in explained.items():
        difference = levels[name].cooling - levels[name].heating
        known = np.isfinite(difference[:, 0])
        if known.sum() < FEWEST:
            continue
        own = difference[known] - difference[known].mean(axis=0)
        seen = own @ np.linalg.pinv(found.response).T
        sums[known] += np.einsum("kij,kj->ki", rot_nb[known], seen)
        counts[known] += 1
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _judge_changes(changes: Array, sensors: int, magnitude: float | None) -> list[Finding]:
    """How much the field changes within a station, common to all sensors."""
    known = np.isfinite(changes[:, 0])
    if sensors < 2 or known.sum() < FEWEST:
        return []
    size = float(np.sqrt(np.mean(changes[known] ** 2) * 1.5))
    return [
        Finding(
            "field changes",
            "check" if size > _DRIFT else "note",
            f"between cooling and heating the chamber's field changed by "
            f"{_format_amount(size, magnitude)} "
            f"(one standard deviation, alike for {sensors} sensors)",
            "this, not the sensors, limits the accuracy" if size > _DRIFT else "",
        )
    ]


def _format_amount(share: float, magnitude: float | None) -> str:
    if magnitude is None:
        return f"{figure(100 * share)} % of itself"
    return f"{figure(share * magnitude)} nT"
