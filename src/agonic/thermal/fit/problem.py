"""From the cells of stations to the problem that the solver takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding, figure
from agonic.maths.equation import temperature_model
from agonic.reference import Reference
from agonic.thermal.maths.binned_sums import Binned, Cells
from agonic.thermal.maths.gaussian_process import make_time_basis
from agonic.thermal.maths.station_residuals import StationProblem
from agonic.thermal.maths.stations import list_standard_rotations

Stations = Literal["known", "unknown", "found"] | Mapping[int, Rotation]

LARGEST_DEGREE = 9
LARGEST_AUTO = 5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The settings of a fit; see `fit_thermal`."""

    bin_width_C: float = 0.5
    degree: int | Literal["auto"] = 3
    stations: Stations = "unknown"
    fixture_sd_deg: float = 1.0
    fixture_known: bool = False
    rate: bool | Literal["auto"] = "auto"
    drift: bool | Literal["auto"] = "auto"
    soft_iron_sd: float = 0.1
    faults: bool = True
    unseen_change_sd: float = 0.0
    robust: bool = True

    def __post_init__(self) -> None:
        for name in ("bin_width_C", "fixture_sd_deg", "soft_iron_sd"):
            if not getattr(self, name) > 0:
                raise AgonicError(f"{name} is {getattr(self, name)}; it must be above zero")
        if not self.unseen_change_sd >= 0:
            raise AgonicError(
                f"unseen_change_sd is {self.unseen_change_sd}; it is a share of the field from 0"
            )
        whole = isinstance(self.degree, int) and 0 <= self.degree <= LARGEST_DEGREE
        if self.degree != "auto" and not whole:
            raise AgonicError(
                f"degree {self.degree!r} is not possible; give 0 to {LARGEST_DEGREE}, or 'auto'"
            )
        for name in ("rate", "drift"):
            given = getattr(self, name)
            if given not in (True, False, "auto"):
                raise AgonicError(f"{name} {given!r} is neither True, False nor 'auto'")
        if isinstance(self.stations, str) and self.stations not in ("known", "unknown", "found"):
            raise AgonicError(
                f"stations {self.stations!r} is not known; give 'known' for the standard twelve, "
                "'unknown', 'found', or a rotation for each number"
            )

    @property
    def orientations(self) -> dict[int, Array] | None:
        """The described rotation (3, 3), box to chamber, by number; `None` where unknown."""
        if isinstance(self.stations, str):
            if self.stations != "known":
                return None
            return dict(enumerate(list_standard_rotations(), start=1))
        return {int(number): turn.as_matrix() for number, turn in self.stations.items()}

    def recorded(self) -> Mapping[str, Any]:
        """The settings for the provenance."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        if not isinstance(self.stations, str):
            values["stations"] = {
                str(number): np.roll(turn.as_quat(), 1).round(9).tolist()
                for number, turn in self.stations.items()
            }
        return values


NO_LAG = "no sign that the bias depends on how fast the temperature changes"
_NARROWEST_C = 1.0
_NARROW_C = 10.0


class Scale(NamedTuple):
    """From normalised numbers back to readings.

    reading = centre + size · point, x = (T − centre_C)/half_C, dT/dt = pace · normalised rate;
    `magnitude` is the known magnitude that one stands for, or None, `sd` its uncertainty.
    """

    centre: Array
    size: float
    low_C: float
    high_C: float
    pace: float
    magnitude: float | None
    sd: float = 0.0

    @property
    def centre_C(self) -> float:
        """The middle of the range."""
        return (self.low_C + self.high_C) / 2

    @property
    def half_C(self) -> float:
        """Half of the range."""
        return (self.high_C - self.low_C) / 2

    def x(self, temperature: Array) -> Array:
        """Temperatures as −1…1."""
        return (temperature - self.centre_C) / self.half_C

    def describe_lag(self, term: Array, unit: str) -> str:
        """The normalised term in dT/dt in words."""
        lag = figure(float(np.linalg.norm(term)) * self.size)
        return (
            f"the bias lags by {lag} {unit} while the temperature changes at "
            f"{figure(self.pace * 60)} °C/min"
        )


def require_range(low: float, high: float, move: str) -> None:
    """Raise `CoverageError` where the temperature hardly changes."""
    if high - low < _NARROWEST_C:
        raise CoverageError(
            f"the temperature only runs from {low:.1f} to {high:.1f} °C: nothing can be said of "
            "its influence",
            turns=move,
        )


def find_narrow_range(low: float, high: float, verb: str) -> list[Finding]:
    """A range of temperatures outside of which the correction will often be used."""
    if high - low >= _NARROW_C:
        return []
    return [
        Finding(
            "small range",
            "check",
            f"the temperature only runs from {low:.1f} to {high:.1f} °C",
            f"{verb} over the range of use; beyond it the correction is a guess",
        )
    ]


_MISSING = 3  # stations that may be missing at a temperature that still counts as seen


class ChamberReadings(NamedTuple):
    """The cells that are used, the numbers of their stations, the noise of a reading, the scale.

    `width_C` is that of the bins, `unit` that of the readings, `thermometer_C` what is left of the
    noise of a thermometer that was smoothed.
    """

    cells: Cells
    numbers: tuple[int, ...]
    noise: Array
    scale: Scale
    width_C: float
    unit: str
    thermometer_C: float = 0.0

    @property
    def station(self) -> Index:
        """The place of each cell's station in `numbers`."""
        return np.searchsorted(np.array(self.numbers), self.cells.number)


def select_readings(
    sums: Binned, left_out: set[int], reference: Reference | None, unit: str = "nT"
) -> ChamberReadings:
    """What is used of the sums, and how it is scaled."""
    cells = sums.cells()
    cells = cells.select(~np.isin(cells.number, sorted(left_out)))
    if not len(cells.n):
        raise CoverageError(
            "no station has a temperature that moves: the thermometer stands still",
            turns="check the sensor's temperature, or take that of its neighbour",
        )
    noise = cells.noise() if (cells.n > 3).any() else np.cov(cells.mean.T)
    low, high = _find_range(cells, sums)
    require_range(low, high, "cool and heat over the range of use, or fit with fit_ellipsoid")
    numbers = tuple(np.unique(cells.number).tolist())
    centre = np.array([cells.mean[cells.number == n].mean(axis=0) for n in numbers]).mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((cells.mean - centre) ** 2, axis=1))))
    if not size > 0:
        raise CoverageError(
            "the readings are the same at all stations: the sensor is stuck",
            turns="check the sensor and its wiring",
        )
    pace = float(np.sqrt(np.average(cells.rate**2, weights=cells.n)))
    magnitude, sd = _find_magnitude(reference)
    scale = Scale(centre, size, low, high, pace or 1.0, magnitude, sd)
    return ChamberReadings(cells, numbers, noise, scale, sums.width_C, unit, sums.thermometer_C)


def _find_range(cells: Cells, sums: Binned) -> tuple[float, float]:
    """The temperatures that nearly all stations saw."""
    bins, where = np.unique(cells.bin, return_inverse=True)
    seen = np.zeros((len(bins), int(cells.number.max()) + 1), dtype=bool)
    seen[where, cells.number] = True
    stations = len(np.unique(cells.number))
    enough = seen.sum(axis=1) >= min(stations, max(stations - _MISSING, 1))
    if not enough.any():
        return 0.0, 0.0
    kept = enough[where]
    low, high = float(cells.temperature[kept].min()), float(cells.temperature[kept].max())
    seen_by = [sums.stations[int(number)] for number in np.unique(cells.number)]
    spare = min(_MISSING, len(seen_by) // 4)
    coldest = sorted((s.coldest for s in seen_by), reverse=True)[spare]
    warmest = sorted(s.warmest for s in seen_by)[spare]
    return max(low - sums.width_C / 2, coldest), min(high + sums.width_C / 2, warmest)


def _find_magnitude(reference: Reference | None) -> tuple[float | None, float]:
    """The magnitude of the chamber's field, or None, and its uncertainty."""
    if reference is None:
        return None, 0.0
    return float(reference.magnitudes(len(reference.values)).mean()), reference.sd


def make_problem(
    readings: ChamberReadings, degree: int, settings: Settings, *, rate: bool, drift: bool
) -> StationProblem:
    """The problem of the solver, without orientations of the stations."""
    cells, scale = readings.cells, readings.scale
    x, spread = scale.x(cells.temperature), cells.variance / scale.half_C**2
    phi = temperature_model.build_covariates(
        x, spread, degree, cells.rate / scale.pace if rate else None
    )
    clock = cells.time
    timed = bool(np.isfinite(clock).all())
    pace = (clock - (clock.min() + clock.max()) / 2) / max(float(np.ptp(clock)), 1e-9)
    return StationProblem(
        points=(cells.mean - scale.centre) / scale.size,
        covariance=readings.noise / scale.size**2 / cells.n[:, None, None],
        phi=phi,
        station=readings.station,
        pace=pace if drift else None,
        drifting=settings.drift is True,
        degree=degree,
        rate=rate,
        soft_iron_sd=settings.soft_iron_sd,
        course=make_time_basis(clock, readings.station) if timed else None,
    )
