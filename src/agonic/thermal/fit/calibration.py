"""The estimate back in the units of the readings, as what gets saved."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.maths.equation.affine import SYMMETRIC, model_basis, split
from agonic.provenance import Provenance
from agonic.thermal.fit.problem import ChamberReadings, Scale
from agonic.thermal.fit.readings import Facts
from agonic.thermal.maths.estimate import StationEstimate
from agonic.thermal.maths.station_residuals import StationProblem
from agonic.thermal.maths.thermometer import propagate_error


def make_chamber_calibration(
    estimate: StationEstimate,
    problem: StationProblem,
    readings: ChamberReadings,
    facts: Facts,
    largest: float,
    provenance: Provenance,
) -> Thermal:
    """The calibration from turned stations.

    Without a known magnitude the mean gain at the centre of the range is set to one.
    """
    scale, p = readings.scale, problem.degree + 1
    found, covariance = estimate.coefficients, estimate.covariance.copy()
    covariance[: 3 * p, : 3 * p] += propagate_error(
        found[: 3 * p].reshape(3, p), scale.half_C, readings.thermometer_C
    )
    if scale.magnitude is None:
        mean = float(found[[3 * p, 4 * p, 5 * p]].mean())
        found, covariance = _set_mean_gain_to_one(found, covariance, mean, p)
        gain, magnitude, unit_out = 1.0, scale.size / mean, facts.unit
    else:
        gain, magnitude, unit_out = scale.magnitude / scale.size, scale.magnitude, "nT"
    return make_calibration(
        found,
        covariance,
        scale,
        facts,
        degree=problem.degree,
        gauge=SYMMETRIC,
        gain=gain,
        magnitude=magnitude,
        unit_out=unit_out,
        frame_out=facts.frame,
        noise=float(np.sqrt(np.trace(readings.noise) / 3)),
        largest=largest,
        provenance=provenance,
    )


def make_calibration(
    coefficients: Array,
    covariance: Array,
    scale: Scale,
    facts: Facts,
    *,
    degree: int,
    gauge: str,
    gain: float,
    magnitude: float,
    unit_out: str,
    frame_out: str,
    noise: float,
    largest: float,
    provenance: Provenance,
) -> Thermal:
    """Normalised coefficients (a,) with their covariance (a, a) as a calibration.

    Parameters: those of `Thermal`; `gain` what one stands for in the matrix, `largest` the largest
    reading that was seen.
    """
    p, basis = degree + 1, model_basis("full", gauge)
    last = basis.shape[1] * p  # then follow the rates
    sizes = np.full(len(coefficients), gain)
    sizes[: 3 * p], sizes[last:] = scale.size, scale.size / scale.pace
    values, spread = coefficients * sizes, covariance * np.outer(sizes, sizes)
    if scale.sd and scale.magnitude:
        stretch = values * scale.sd / scale.magnitude  # all of the matrix errs alike
        stretch[: 3 * p] = stretch[last:] = 0.0
        spread = spread + np.outer(stretch, stretch)
    bias, matrix = split(values[:last].reshape(-1, p).T @ basis.T)
    bias = bias.copy()
    bias[0] += scale.centre
    return Thermal(
        bias=bias,
        matrix=matrix,
        centre_C=scale.centre_C,
        half_range_C=scale.half_C,
        rate=values[last:] if len(values) > last else None,
        covariance=spread,
        unit_in=facts.unit,
        unit_out=unit_out,
        gauge=gauge,
        magnitude=magnitude,
        noise=noise,
        sensor=facts.name,
        device_id=facts.device_id,
        frame_in=facts.frame,
        frame_out=frame_out,
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
