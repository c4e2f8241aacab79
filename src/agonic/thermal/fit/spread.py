"""What temperature does to the readings of each station, before and after the correction."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.maths.equation import polynomial
from agonic.thermal.fit.result import Spread
from agonic.thermal.maths.binned_sums import Cells
from agonic.units import RAW


def compute_spread(cells: Cells, calibration: Thermal) -> Spread:
    """Standard deviations over all readings of each station, from the sums of its cells.

    Within a cell the correction is linear in reading and temperature,

        u − ū = W (raw − mean) + g (T − mean),   g = W′ (raw − b) − W b′,

    so the variance follows from the cell's covariances; raw counts are multiplied by the mean gain
    so that before and after have one unit.
    """
    gain = 1.0
    if calibration.unit_in == RAW and calibration.unit_out != RAW:
        gain = calibration.mean_gain
    mean, within = _correct_cells(cells, calibration)
    stations = np.unique(cells.number)
    before, after = [], []
    for number in stations:
        rows = cells.number == number
        count = cells.n[rows]
        before.append(gain * _sum_up(count, cells.mean[rows], cells.covariance[rows]))
        after.append(_sum_up(count, mean[rows], within[rows]))
    return Spread(stations=tuple(stations.tolist()), before=np.array(before), after=np.array(after))


def _correct_cells(cells: Cells, calibration: Thermal) -> tuple[Array, Array]:
    """Mean (m, 3) and covariance (m, 3, 3) of the corrected readings of each cell."""
    x = polynomial.scale(cells.temperature, calibration.centre_C, calibration.half_range_C)
    over = cells.variance / calibration.half_range_C**2
    phi = polynomial.mean_powers(x, over, calibration.degree)
    slope = polynomial.derivative(x, calibration.degree) / calibration.half_range_C
    bias, matrix = phi @ calibration.bias, np.tensordot(phi, calibration.matrix, axes=1)
    if calibration.rate is not None:
        bias = bias + cells.rate[:, None] * calibration.rate
    left = cells.mean - bias
    mean = np.einsum("mij,mj->mi", matrix, left)
    turning = np.tensordot(slope, calibration.matrix, axes=1)
    g = np.einsum("mij,mj->mi", turning, left)
    g -= np.einsum("mij,mj->mi", matrix, slope @ calibration.bias)
    cross = np.einsum("mij,mj,mk->mik", matrix, cells.shared, g)
    within = matrix @ cells.covariance @ np.swapaxes(matrix, 1, 2)
    within = within + cross + np.swapaxes(cross, 1, 2)
    within = within + cells.variance[:, None, None] * g[:, :, None] * g[:, None, :]
    return mean, within


def _sum_up(count: Array, mean: Array, within: Array) -> Array:
    """Standard deviation of x, y, z and of the magnitude over all cells of a station, (4,)."""
    size = np.linalg.norm(mean, axis=1)
    unit = mean / np.maximum(size, 1e-300)[:, None]
    along = np.einsum("mi,mij,mj->m", unit, within, unit)
    across = np.einsum("mii->m", within) - along
    values = np.column_stack([mean, size + across / (2 * np.maximum(size, 1e-300))])
    variance = np.column_stack([np.einsum("mii->mi", within), along])
    middle = np.average(values, axis=0, weights=count)
    total = np.average(variance + (values - middle) ** 2, axis=0, weights=count)
    return np.asarray(np.sqrt(np.maximum(total, 0.0)))
