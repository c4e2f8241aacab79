"""From the cells of stations to what the kernel takes, and from its coefficients back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.errors import CoverageError
from agonic.maths.equation import model
from agonic.maths.equation.affine import SYMMETRIC, model_basis, split
from agonic.reference import Reference
from agonic.thermal.fit.readings import Facts
from agonic.thermal.maths import estimate as chamber
from agonic.thermal.maths import gaussian_process, station_residuals
from agonic.thermal.maths.binned_sums import Binned, Cells

_NARROWEST_C = 1.0
_MISSING = 3  # stations that may be missing at a temperature that still counts as seen


class Scale(NamedTuple):
    """From normalised numbers back to readings.

    reading = centre + size · point, x = (T − centre_C)/half_C, dT/dt = pace · normalised rate;
    `magnitude` is the known magnitude that one stands for, or None, `sd` its uncertainty.
    """

    centre: Array
    size: float
    centre_C: float
    half_C: float
    low_C: float
    high_C: float
    pace: float
    magnitude: float | None
    sd: float

    def x(self, temperature: Array) -> Array:
        """Temperatures as −1…1."""
        return (temperature - self.centre_C) / self.half_C


class ChamberReadings(NamedTuple):
    """The cells that are used, the numbers of their stations, the noise of a reading, the scale.

    `width_C` is that of the bins, `unit` that of the readings.
    """

    cells: Cells
    numbers: tuple[int, ...]
    noise: Array
    scale: Scale
    width_C: float
    unit: str

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
    if high - low < _NARROWEST_C:
        raise CoverageError(
            f"the temperature only runs from {low:.1f} to {high:.1f} °C: nothing can be said of "
            "its influence",
            turns="cool and heat over the range of use, or fit with fit_ellipsoid",
        )
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
    scale = Scale(
        centre, size, (low + high) / 2, (high - low) / 2, low, high, pace or 1.0, magnitude, sd
    )
    return ChamberReadings(cells, numbers, noise, scale, sums.width_C, unit)


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
    of: ChamberReadings, degree: int, *, rate: bool, drift: bool, sure: bool, soft_iron_sd: float
) -> station_residuals.StationProblem:
    """The kernel's problem, without turns."""
    cells, scale = of.cells, of.scale
    x, spread = scale.x(cells.temperature), cells.variance / scale.half_C**2
    phi = model.build_covariates(x, spread, degree, cells.rate / scale.pace if rate else None)
    clock = cells.time
    pace = (clock - (clock.min() + clock.max()) / 2) / max(float(np.ptp(clock)), 1e-9)
    return station_residuals.StationProblem(
        points=(cells.mean - scale.centre) / scale.size,
        covariance=of.noise / scale.size**2 / cells.n[:, None, None],
        phi=phi,
        station=of.station,
        pace=pace if drift else None,
        drifting=sure,
        degree=degree,
        rate=rate,
        soft_iron_sd=soft_iron_sd,
        course=gaussian_process.make_time_basis(clock, of.station)
        if np.isfinite(clock).all()
        else None,
    )


def make_calibration(
    estimate: chamber.StationEstimate,
    problem: station_residuals.StationProblem,
    of: ChamberReadings,
    facts: Facts,
    largest: float,
    provenance: Any,
) -> Thermal:
    """The calibration in the units of the readings, scale and gauge made explicit.

    Without a known magnitude the mean gain at the centre of the range is set to one.
    """
    scale, p = of.scale, problem.degree + 1
    found, covariance = estimate.coefficients, estimate.covariance
    gain = float(found.reshape(-1)[[3 * p, 4 * p, 5 * p]].mean())
    if scale.magnitude is None:
        found, covariance = _set_mean_gain_to_one(found, covariance, gain, p)
        factor, magnitude, unit_out = 1.0, scale.size / gain, facts.unit
    else:
        factor, magnitude, unit_out = scale.magnitude / scale.size, scale.magnitude, "nT"
    sizes = np.concatenate(
        [
            np.full(3 * p, scale.size),
            np.full(6 * p, factor),
            np.full(3 if problem.rate else 0, scale.size / scale.pace),
        ]
    )
    values = found * sizes
    spread = covariance * np.outer(sizes, sizes)
    if scale.magnitude is not None:
        stretch = np.where(np.arange(len(values)) < 3 * p, 0.0, values) * scale.sd / scale.magnitude
        stretch[9 * p :] = 0.0
        spread = spread + np.outer(stretch, stretch)
    bias, matrix = split((values[: 9 * p].reshape(9, p).T) @ model_basis("full").T)
    bias = bias.copy()
    bias[0] += scale.centre
    return Thermal(
        bias=bias,
        matrix=matrix,
        centre_C=scale.centre_C,
        half_range_C=scale.half_C,
        rate=values[9 * p :] if problem.rate else None,
        covariance=spread,
        unit_in=facts.unit,
        unit_out=unit_out,
        gauge=SYMMETRIC,
        magnitude=magnitude,
        noise=float(np.sqrt(np.trace(of.noise) / 3)),
        sensor=facts.name,
        device_id=facts.device_id,
        frame_in=facts.frame,
        frame_out=facts.frame,
        validity=Validity(largest_reading=largest, temperature_C=(scale.low_C, scale.high_C)),
        provenance=provenance,
    )


def _set_mean_gain_to_one(
    found: Array, covariance: Array, gain: float, p: int
) -> tuple[Array, Array]:
    """The coefficients with the matrix over its mean gain at the centre, and their covariance."""
    entries = slice(3 * p, 9 * p)
    change = np.eye(len(found))
    toward = np.zeros(len(found))
    toward[[3 * p, 4 * p, 5 * p]] = 1 / 3
    scaled = found.copy()
    scaled[entries] /= gain
    change[entries] = (change[entries] - np.outer(scaled[entries], toward)) / gain
    return scaled, change @ covariance @ change.T
