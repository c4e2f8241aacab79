"""`Binned`: readings of turned stations added up by station, direction and temperature.

All that a temperature calibration needs is seventeen sums of each cell, so recordings of any length
can be fed piece by piece.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation import series

_SUMS = 17  # n, t, t², rate, time, raw (3), t·raw (3), raw rawᵀ (6)


class Cells(NamedTuple):
    """Every cell that holds readings, (m, …).

    `number` of the station, `heating`, `bin` (its lower end is bin × width); `n` of readings;
    means of the temperature, its `rate` of change, the `time` and the readings `mean` (m, 3);
    `variance` of the temperature, `shared` (m, 3) its covariance with the readings, and
    `covariance` (m, 3, 3) of the readings about their mean.
    """

    number: Index
    heating: Mask
    bin: Index
    n: Array
    temperature: Array
    variance: Array
    rate: Array
    time: Array
    mean: Array
    shared: Array
    covariance: Array

    def select(self, rows: Mask | Index) -> Cells:
        """Some of the cells."""
        return self._replace(**{name: values[rows] for name, values in self._asdict().items()})

    @property
    def about_line(self) -> Array:
        """Covariance (m, 3, 3) of the readings about their straight line in temperature."""
        outer = self.shared[:, :, None] * self.shared[:, None, :]
        return np.asarray(self.covariance - outer / np.maximum(self.variance, 1e-12)[:, None, None])

    def noise(self) -> Array:
        """Covariance (3, 3) of one reading about the line of its cell, from all cells."""
        enough = self.n > 3
        if not enough.any():
            raise ValueError("no cell holds enough readings to determine their noise")
        total = np.tensordot(self.n[enough], self.about_line[enough], axes=1)
        return np.asarray(total / (self.n[enough] - 2).sum())


class LeftOut(NamedTuple):
    """Readings that were left out at a station: their rows in the piece, and their times."""

    station: int
    rows: Index
    times: Array


class StationRecord(NamedTuple):
    """What was seen of a station: rows used and dropped, its temperatures, the largest reading."""

    rows: int
    dropped: int
    coldest: float
    warmest: float
    largest: float
    standing: float  # share of the rows in the longest stretch without any change of temperature
    heating: int  # rows

    def with_(self, other: StationRecord) -> StationRecord:
        """Both together."""
        return StationRecord(
            self.rows + other.rows,
            self.dropped + other.dropped,
            min(self.coldest, other.coldest),
            max(self.warmest, other.warmest),
            max(self.largest, other.largest),
            max(self.standing, other.standing),
            self.heating + other.heating,
        )


class Binned:
    """Sums of readings by station, direction and temperature; grows by `add`."""

    def __init__(self, width_C: float = 0.5) -> None:
        if not width_C > 0:
            raise ValueError(f"bins {width_C} °C wide cannot hold anything")
        self.width_C = float(width_C)
        self.thermometer_C = 0.0  # what is left of the noise of one that was smoothed
        self.stations: dict[int, StationRecord] = {}
        self.anomalies: list[LeftOut] = []
        self._keys: list[NDArray[np.int64]] = []
        self._sums: list[Array] = []

    def add(
        self,
        station: int,
        field: Array,
        temperature: Array,
        time: Array | None = None,
        *,
        heating: Mask | bool | None = None,
        keep_anomalies: bool = False,
    ) -> None:
        """Add readings of one station, in the order they were taken.

        Parameters
        ----------
        station : its number. field : (n, 3). temperature : (n,) °C. time : (n,) s; the same clock
            for all stations, or None.
        heating : which rows were taken while it grew warmer; by default found from the temperature,
            for which a piece should hold a station's whole recording.
        keep_anomalies : leave readings in that stand out of the running median.
        """
        outlier = (
            series.find_anomalies(field) if not keep_anomalies else np.zeros(len(field), dtype=bool)
        )
        if heating is None:
            heating = series.find_heating(temperature)
        rising = np.broadcast_to(np.asarray(heating, dtype=bool), temperature.shape)
        rate = np.zeros(len(field)) if time is None else series.compute_rates(time, temperature)
        clock = np.full(len(field), np.nan) if time is None else time
        seen = StationRecord(
            int((~outlier).sum()),
            int(outlier.sum()),
            float(temperature.min()),
            float(temperature.max()),
            float(np.abs(field[~outlier]).max(initial=0.0)),
            _measure_standstill(temperature),
            int(rising.sum()),
        )
        self.stations[station] = (
            self.stations[station].with_(seen) if station in self.stations else seen
        )
        if outlier.any():
            rows = np.flatnonzero(outlier)
            self.anomalies.append(LeftOut(station, rows, clock[rows]))
            kept = ~outlier
            field, temperature, rising = field[kept], temperature[kept], rising[kept]
            rate, clock = rate[kept], clock[kept]
        self._put(station, field, temperature, rising, rate, clock)

    def _put(
        self,
        station: int,
        field: Array,
        temperature: Array,
        rising: Mask,
        rate: Array,
        clock: Array,
    ) -> None:
        """Add rows to their cells."""
        bins = np.floor(temperature / self.width_C).astype(np.int64)
        low = int(bins.min())
        cell = (bins - low) * 2 + rising
        t = temperature - (bins + 0.5) * self.width_C  # about the middle of the bin
        x, y, z = np.ascontiguousarray(field.T)
        columns: Iterable[Array] = (
            t,
            t * t,
            rate,
            clock,
            x,
            y,
            z,
            t * x,
            t * y,
            t * z,
            x * x,
            y * y,
            z * z,
            x * y,
            x * z,
            y * z,
        )
        count = np.bincount(cell)
        there = np.flatnonzero(count)
        sums = np.empty((len(there), _SUMS))
        sums[:, 0] = count[there]
        for k, values in enumerate(columns, start=1):
            sums[:, k] = np.bincount(cell, weights=values)[there]
        keys = np.stack([np.full(len(there), station), there % 2, there // 2 + low], axis=1)
        self._keys.append(keys.astype(np.int64))
        self._sums.append(sums)

    def part(self, stations: Iterable[int], coarser: int = 1) -> Binned:
        """What was added of some stations, in bins `coarser` times as wide."""
        wanted = set(stations) & set(self.stations)
        made = Binned(self.width_C * coarser)
        made.thermometer_C = self.thermometer_C
        made.stations = {
            number: self.stations[number] for number in self.stations if number in wanted
        }
        made.anomalies = [left for left in self.anomalies if left.station in wanted]
        for keys, sums in zip(self._keys, self._sums, strict=True):
            rows = np.isin(keys[:, 0], sorted(wanted))
            if rows.any():
                old = keys[rows, 2]
                moved = (old + 0.5) * self.width_C - (old // coarser + 0.5) * made.width_C
                made._keys.append(np.column_stack([keys[rows, :2], old // coarser]))
                made._sums.append(_move_zero(sums[rows], moved))
        return made

    def __len__(self) -> int:
        return sum(seen.rows for seen in self.stations.values())

    def cells(self) -> Cells:
        """The cells with what they hold, by station, direction and temperature."""
        if not self._keys:
            raise ValueError("no readings were added")
        keys, place = np.unique(np.concatenate(self._keys), axis=0, return_inverse=True)
        total = np.zeros((len(keys), _SUMS))
        np.add.at(total, place.ravel(), np.concatenate(self._sums))
        count = total[:, 0]
        mean = total[:, 1:] / count[:, None]
        t, raw = mean[:, 0], mean[:, 4:7]
        second = unpack_symmetric(mean[:, 10:16])
        return Cells(
            number=keys[:, 0].astype(np.intp),
            heating=keys[:, 1].astype(bool),
            bin=keys[:, 2].astype(np.intp),
            n=count,
            temperature=t + (keys[:, 2] + 0.5) * self.width_C,
            variance=np.maximum(mean[:, 1] - t**2, 0.0),
            rate=mean[:, 2],
            time=mean[:, 3],
            mean=raw,
            shared=mean[:, 7:10] - t[:, None] * raw,
            covariance=second - raw[:, :, None] * raw[:, None, :],
        )


def _move_zero(sums: Array, by: Array) -> Array:
    """Sums (m, 17) with temperatures counted from a place that lies lower by `by` (m,)."""
    count, first = sums[:, 0], sums[:, 1]
    made = sums.copy()
    made[:, 1] += count * by
    made[:, 2] += 2 * by * first + count * by**2
    made[:, 8:11] += by[:, None] * sums[:, 5:8]
    return made


def _measure_standstill(temperature: Array) -> float:
    """The share of rows in the longest stretch in which the temperature never changes."""
    changes = np.flatnonzero(np.diff(temperature))
    edges = np.concatenate([[-1], changes, [len(temperature) - 1]])
    return float(np.diff(edges).max() / len(temperature))
