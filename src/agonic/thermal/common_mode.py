"""The common mode of the sensors of a campaign: what all saw alike was the chamber, not they."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.health import Finding, figure
from agonic.thermal.campaign.description import name_stations
from agonic.thermal.fit.result import Positions, ThermalFit
from agonic.thermal.maths.binned_sums import Cells
from agonic.units import RAW


class CommonMode(NamedTuple):
    """The `common` series (w, c), its standard deviation, and of each series its `own` (s,)."""

    common: Array
    common_sd: float
    own_sd: Array


def estimate_common_mode(series: Array) -> CommonMode:
    """The common mode of series (s, w, c), and the standard deviation of each one's own.

    With values y_i = common + own_i, own_i of variance q_i and all independent:

        E y_i y_j = common²,   E (y_i − y_j)² = q_i + q_j,

    averaged over all rows and columns. The common series is the mean weighted by 1/q. Needs at
    least two series, whose means are zero.

    Source: F. E. Grubbs, On estimating precision of measuring instruments and product variability,
    Journal of the American Statistical Association 43, 243–264, 1948.
    """
    s = len(series)
    flat = series.reshape(s, -1)
    product = flat @ flat.T / flat.shape[1]
    between = float((product.sum() - np.trace(product)) / (s * (s - 1)))
    size = np.diag(product)
    own = size - between  # of two, whose differences cannot be shared out
    if s > 2:
        apart = size[:, None] + size[None, :] - 2 * product
        own = (apart.sum(axis=1) - apart.sum() / (2 * (s - 1))) / (s - 2)
    least = max(float(np.max(own)) * 1e-3, np.finfo(float).tiny)
    weight = 1 / np.maximum(own, least)
    common = np.tensordot(weight / weight.sum(), series, axes=1)
    return CommonMode(common, float(np.sqrt(max(between, 0.0))), np.sqrt(np.maximum(own, 0.0)))


_DISAGREE_SD, _DISAGREE_DEG = 5.0, 0.5
"""Turns of two sensors in one fixture differ that are further apart: by chance one in a million,
and by what a box gives where it is set down."""


def combine_positions(fits: Sequence[ThermalFit]) -> tuple[Positions | None, list[Finding]]:
    """The turns that all sensors of a fixture show, and stations at which they do not agree.

    An angle between two directions is the same in the axes of every sensor; directions are those
    that the best-known sensor saw.
    """
    found = [fit.positions for fit in fits if fit.positions is not None]
    if not found:
        return None, []
    best = min(found, key=lambda one: max(one.turn_sd_deg.values()))
    turns, sds, odd = {}, {}, {}
    for number in best.turn_deg:
        seen = [one for one in found if number in one.turn_deg]
        turn = np.array([one.turn_deg[number] for one in seen])
        sd = np.maximum([one.turn_sd_deg[number] for one in seen], 1e-9)
        turns[number] = float(np.average(turn, weights=sd**-2))
        sds[number] = float(np.sum(sd**-2) ** -0.5)
        apart = np.abs(turn - best.turn_deg[number])
        limit = np.hypot(sd, best.turn_sd_deg[number]) * _DISAGREE_SD
        if (apart > np.maximum(limit, _DISAGREE_DEG)).any():
            odd[number] = float(apart.max())
    first = next(iter(turns))
    sds[first] = 0.0
    positions = Positions(direction=best.direction, turn_deg=turns, turn_sd_deg=sds)
    if not odd:
        return positions, []
    return positions, [
        Finding(
            "fixture",
            "check",
            f"the sensors do not agree how far the box was turned at {name_stations(odd)}: "
            f"{figure(max(odd.values()))}° lie between them",
            "see whether a sensor moved in the fixture between the stations",
        )
    ]


CHAMBER = ("back", "right", "down")
ALONG = ("along the field",)
WINDOWS = 20
"""Windows into which the recording of a station is cut: 12 min of four hours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Share:
    """What the corrected readings of a sensor at a station consist of, nT (one axis, windows).

    `total_sd` is how much they changed, `noise_sd` what the noise of its readings makes of a
    window's mean, `own_sd` what is its own beyond that: misfit of the polynomial, lag, rounding.
    `own` (w, c) are its changes without those common to all.
    """

    name: str
    total_sd: float
    noise_sd: float
    own_sd: float
    own: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ChamberField:
    """How the field changed while the stations were recorded, as several sensors saw it alike.

    `change` (w, c) nT by window of time, less its mean at each station, in the `axes` of the
    chamber where the turns are known and along the field otherwise; `time` (w,) s since the
    campaign began, `station` (w,). `common_sd` is its standard deviation on one axis, to which the
    noise of the sensors does not add; `shares` what each sensor saw besides.

    From one station to the next nothing is said: there the field, the fixture and the sensors
    cannot be told apart.
    """

    axes: tuple[str, ...]
    time: Array
    station: Index
    change: Array
    common_sd: float
    shares: tuple[Share, ...]


class FittedSensor(NamedTuple):
    """The fit of a sensor and the cells of its readings."""

    fit: ThermalFit
    cells: Cells


class _Windows(NamedTuple):
    """Means (w, c) of windows and the variance of their noise (w,); `key` is station × `WINDOWS` +
    place."""

    key: Index
    mean: Array
    variance: Array


def find_chamber_field(
    sensors: Mapping[str, FittedSensor], rotations: Mapping[int, Rotation] | None
) -> ChamberField | None:
    """The changes of the chamber's field that all sensors saw, and what each saw besides.

    Parameters: fits in nT with their cells by the name of the sensor; how the box stood at each
    station, where that is known. Returns `None` with fewer than two sensors or without clocks.

    Source: Grubbs 1948 for what is common and what is one's own.
    """
    clocked = {
        name: seen
        for name, seen in sensors.items()
        if np.isfinite(seen.cells.time).all() and seen.fit.calibration.unit_out != RAW
    }
    if len(clocked) < 2:
        return None
    known = rotations is not None and all(seen.fit.fixture is not None for seen in clocked.values())
    turns = rotations if known else None
    begun, width = _find_clock([seen.cells for seen in clocked.values()])
    made = [_average_windows(seen, turns, begun, width) for seen in clocked.values()]
    shared, times = np.unique(np.concatenate([one.key for one in made]), return_counts=True)
    keys = shared[times == len(made)]
    if not len(keys):
        return None
    station = keys // WINDOWS
    rows = [np.searchsorted(windows.key, keys) for windows in made]
    series = np.array(
        [_centre(windows.mean[at], station) for windows, at in zip(made, rows, strict=True)]
    )
    found = estimate_common_mode(series)
    noise = [windows.variance[at].mean() for windows, at in zip(made, rows, strict=True)]
    start = np.array([begun[int(number)] for number in station]) - min(begun.values())
    return ChamberField(
        axes=ALONG if turns is None else CHAMBER,
        time=start + (keys % WINDOWS + 0.5) * width,
        station=station,
        change=found.common,
        common_sd=found.common_sd,
        shares=tuple(
            Share(
                name=name,
                total_sd=float(np.sqrt(np.mean(values**2))),
                noise_sd=float(np.sqrt(variance)),
                own_sd=float(np.sqrt(max(own**2 - variance, 0.0))),
                own=values - found.common,
            )
            for name, values, variance, own in zip(
                clocked, series, noise, found.own_sd, strict=True
            )
        ),
    )


def _find_clock(cells: list[Cells]) -> tuple[dict[int, float], float]:
    """When the recording of each station began, and the width of a window, s."""
    number = np.concatenate([one.number for one in cells])
    time = np.concatenate([one.time for one in cells])
    begun = {int(n): float(time[number == n].min()) for n in np.unique(number)}
    longest = max(float(time[number == n].max()) - first for n, first in begun.items())
    return begun, max(longest, 1e-9) / WINDOWS


def _average_windows(
    seen: FittedSensor,
    turns: Mapping[int, Rotation] | None,
    begun: Mapping[int, float],
    width: float,
) -> _Windows:
    """The corrected readings of a sensor by window: in the chamber's axes, or their magnitude."""
    calibration = seen.fit.calibration
    cells = seen.cells.select(~calibration.outside(seen.cells.temperature))
    field = calibration.correct(
        cells.mean, temperature=cells.temperature, temperature_rate=cells.rate
    )
    values = np.linalg.norm(field, axis=1)[:, None]
    if turns is not None:
        assert seen.fit.fixture is not None
        stood = Rotation.concatenate([turns[number] for number in cells.number.tolist()])
        values = (stood * seen.fit.fixture.mounting).apply(field)
    since = cells.time - np.array([begun[int(number)] for number in cells.number])
    place = np.minimum((since / width).astype(np.int64), WINDOWS - 1)
    key, where = np.unique(cells.number * WINDOWS + place, return_inverse=True)
    count = np.bincount(where, cells.n)
    sums = np.stack([np.bincount(where, cells.n * column) for column in values.T], axis=1)
    gain = calibration.mean_gain
    return _Windows(key, sums / count[:, None], (gain * seen.fit.noise) ** 2 / count)


def _centre(values: Array, station: Index) -> Array:
    """Values less their mean at each station."""
    made = values.copy()
    for number in np.unique(station):
        made[station == number] -= values[station == number].mean(axis=0)
    return made
