"""The coefficients of each temperature by themselves, their order, and their hysteresis.

The published way (Nikolaev et al. 2023): twelve means at one temperature lie on an ellipsoid. All
temperatures are solved at once, each by Gauss–Newton from a start near enough. Points are centred
and scaled to about one, the field has magnitude one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation import polynomial, temperature_model
from agonic.maths.equation.affine import model_basis, split
from agonic.maths.estimation.series import compute_running_mean
from agonic.thermal.fit.problem import LARGEST_AUTO, ChamberReadings
from agonic.thermal.fit.result import Bins, Hysteresis
from agonic.thermal.maths.station_residuals import StationProblem

_SMOOTH_C = 5.0
FEWEST = 9
"""Stations below which nine coefficients are not determined."""

_ROUNDS = 8
_LEAST = 1e-10  # smallest eigenvalue of the scaled information that still counts as determined
_DAMPING = 1e-12


class Coefficients(NamedTuple):
    """Nine coefficients at each temperature (t, 9), their covariance (t, 9, 9), and which hold."""

    values: Array
    covariance: Array
    determined: Mask


def fit_ellipsoids(points: Array, covariance: Array, there: Mask, start: Array) -> Coefficients:
    """bias x y z and matrix xx yy zz xy xz yz at each temperature, by maximum likelihood.

    Parameters: points (t, k, 3) and their covariance (t, k, 3, 3), which of them are there (t, k),
    and a start (t, 9).
    """
    basis = model_basis("full")
    t, k, _ = points.shape
    params, information = start.copy(), np.zeros((t, 9, 9))
    determined = there.sum(axis=1) >= FEWEST
    flat = points.reshape(-1, 3)
    for _ in range(_ROUNDS):
        bias, matrix = split(np.repeat(params @ basis.T, k, axis=0))
        r, jacobian = temperature_model.size_residual(flat, bias, matrix, np.ones(len(flat)))
        s = jacobian[:, :3]
        spread = np.einsum("ni,nij,nj->n", s, covariance.reshape(-1, 3, 3), s)
        weight = np.where(there.ravel(), 1 / np.sqrt(spread), 0.0)
        z = (r * weight).reshape(t, k)
        rows = (jacobian @ basis * weight[:, None]).reshape(t, k, 9)
        information = np.swapaxes(rows, 1, 2) @ rows
        size = np.sqrt(np.maximum(np.einsum("tii->ti", information), 1e-300))
        scaled = information / (size[:, :, None] * size[:, None, :])
        determined &= np.linalg.eigvalsh(scaled)[:, 0] > _LEAST
        scaled[~determined] = np.eye(9)
        scaled += _DAMPING * np.eye(9)
        gradient = np.einsum("tki,tk->ti", rows, z) / size
        step = np.linalg.solve(scaled, gradient[:, :, None])[:, :, 0] / size
        params = np.where(determined[:, None], params - step, params)
    found = np.linalg.inv(scaled) / (size[:, :, None] * size[:, None, :])
    return Coefficients(params, found, determined)


class EachTemperature(NamedTuple):
    """Normalised coefficients by temperature (t,), cooling and heating."""

    temperature: Array
    cooling: Coefficients
    heating: Coefficients


def fit_each_temperature(
    readings: ChamberReadings, problem: StationProblem, coefficients: Array
) -> EachTemperature:
    """Every temperature by itself, from the joint coefficients as a start.

    The mean temperature of a cell is not quite the middle of its bin, and not the same at all
    stations: each mean is carried to the middle along the joint model.
    """
    bins = np.unique(readings.cells.bin)
    middle = np.asarray((bins + 0.5) * readings.width_C, dtype=np.float64)
    place = np.searchsorted(bins, readings.cells.bin)
    points = _move_to_middles(readings, problem, coefficients, middle[place])
    start = _evaluate_nine(problem, coefficients, readings.scale.x(middle))
    made = [
        _fit_direction(readings, problem, points, place, len(bins), heating, start)
        for heating in (False, True)
    ]
    return EachTemperature(middle, *made)


def _move_to_middles(
    readings: ChamberReadings, problem: StationProblem, coefficients: Array, to: Array
) -> Array:
    """The normalised means as they would be at the middle of their bins."""
    onto = problem.layout
    bias, matrix = temperature_model.evaluate_local(coefficients, onto, problem.phi)
    u = np.einsum("mij,mj->mi", matrix, problem.points - bias)
    phi = temperature_model.build_covariates(
        readings.scale.x(to), 0.0, problem.degree, problem.phi[:, -1] if problem.rate else None
    )
    bias_to, matrix_to = temperature_model.evaluate_local(coefficients, onto, phi)
    there = bias_to + np.linalg.solve(matrix_to, u[:, :, None])[:, :, 0]
    return np.asarray(there)


def _evaluate_nine(problem: StationProblem, coefficients: Array, x: Array) -> Array:
    """The joint nine coefficients at temperatures that do not change, (t, 9)."""
    p = problem.degree + 1
    return np.asarray(polynomial.powers(x, problem.degree) @ coefficients[: 9 * p].reshape(9, p).T)


def _fit_direction(
    readings: ChamberReadings,
    problem: StationProblem,
    points: Array,
    place: Index,
    bins: int,
    heating: bool,
    start: Array,
) -> Coefficients:
    """One direction, a row a temperature and a column a station."""
    k = len(readings.numbers)
    rows = readings.cells.heating == heating
    at = (place[rows], problem.station[rows])
    table = np.zeros((bins, k, 3))
    spread = np.broadcast_to(np.eye(3), (bins, k, 3, 3)).copy()
    there = np.zeros((bins, k), dtype=bool)
    table[at], spread[at], there[at] = points[rows], problem.covariance[rows], True
    table[~there] = table[there].mean(axis=0) if there.any() else 0.0
    return fit_ellipsoids(table, spread, there, start)


def compute_variances(separate: EachTemperature, readings: ChamberReadings) -> Array | None:
    """Variances of the scaled residuals of the nine by order, (9, d); None where too few hold."""
    x, values, sd = _stack(separate, readings)
    if len(x) < 2 * (LARGEST_AUTO + 1):
        return None
    return polynomial.compute_variances(x, values, sd, LARGEST_AUTO)


def choose_degree(separate: EachTemperature, readings: ChamberReadings, otherwise: int = 3) -> int:
    """The smallest order after which no variance falls markedly."""
    found = compute_variances(separate, readings)
    return (
        otherwise
        if found is None
        else polynomial.choose_order(found, len(_stack(separate, readings)[0]))
    )


def _stack(separate: EachTemperature, readings: ChamberReadings) -> tuple[Array, Array, Array]:
    """All temperatures that hold, both directions: x (n,), values (n, 9), sd (n, 9)."""
    x = readings.scale.x(separate.temperature)
    parts = [
        (x[c.determined], c.values[c.determined], _compute_sd(c)[c.determined])
        for c in (separate.cooling, separate.heating)
    ]
    return tuple(np.concatenate(list(column)) for column in zip(*parts, strict=True))  # type: ignore[return-value]


def _compute_sd(found: Coefficients) -> Array:
    return np.asarray(np.sqrt(np.maximum(np.einsum("tii->ti", found.covariance), 0.0)))


def tabulate_bins(
    separate: EachTemperature, readings: ChamberReadings, factor: float, gain: float
) -> Bins:
    """In the units of the readings: bias by the size, matrix by `factor`/`gain`."""
    sizes = np.concatenate([np.full(3, readings.scale.size), np.full(6, factor / gain)])
    offset = np.concatenate([readings.scale.centre, np.zeros(6)])

    def physical(c: Coefficients) -> tuple[Array, Array]:
        holds = c.determined[:, None]
        return (
            np.where(holds, c.values * sizes + offset, np.nan),
            np.where(holds, _compute_sd(c) * sizes, np.nan),
        )

    cooling, cooling_sd = physical(separate.cooling)
    heating, heating_sd = physical(separate.heating)
    return Bins(
        temperature=separate.temperature,
        cooling=cooling,
        cooling_sd=cooling_sd,
        heating=heating,
        heating_sd=heating_sd,
    )


def compute_hysteresis(bins: Bins) -> Hysteresis | None:
    """Cooling less heating, weighted over the temperatures that have both."""
    both = np.isfinite(bins.cooling[:, 0]) & np.isfinite(bins.heating[:, 0])
    if both.sum() < 4:
        return None
    difference = bins.cooling[both] - bins.heating[both]
    variance = bins.cooling_sd[both] ** 2 + bins.heating_sd[both] ** 2
    weight = 1 / variance
    total = weight.sum(axis=0)
    step = float(np.median(np.diff(bins.temperature[both])))
    smooth = compute_running_mean(difference, max(round(_SMOOTH_C / max(step, 1e-9)), 1))
    return Hysteresis(
        difference=(weight * difference).sum(axis=0) / total,
        sd=1 / np.sqrt(total),
        largest=np.abs(smooth).max(axis=0),
    )
