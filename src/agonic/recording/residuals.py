"""What is left after the correction: in each reading, and in each of the 80 directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.equation.affine import magnitude_residual
from agonic.maths.equation.coverage import find_cells, icosphere
from agonic.recording.calibrated import Calibrated
from agonic.report.digits import group_digits, quantity, show_sign
from agonic.report.labels import unit_label
from agonic.report.strips import robust_limit

FEWEST = 10
"""Readings in a cell below which their mean says nothing."""

_LEAST = 1e-9  # of a range, so that readings without any spread can be drawn


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Distances from the model and weights, (n,) each; means over the cells (80,), NaN where few.

    All in `unit`, that of the readings; `noise` is what the fit states.
    """

    values: Array
    weights: Array
    means: Array
    noise: float
    unit: str

    @property
    def limit(self) -> float:
        """Half the height of a strip: what counted in the fit, at least five times the noise."""
        return robust_limit(self.values, max(5.0 * self.noise, _LEAST), self.weights)

    @property
    def mean_limit(self) -> float:
        """The mean at which colour is full: the largest, but never less than the noise."""
        return max(self.noise, float(np.nanmax(np.abs(self.means), initial=0.0)), _LEAST)

    @property
    def worst(self) -> str:
        """The cell with the largest mean, in words."""
        if np.isnan(self.means).all():
            return f"No direction holds {FEWEST} readings."
        cell = int(np.nanargmax(np.abs(self.means)))
        x, y, z = (show_sign(group_digits(float(v), 2)) for v in icosphere()[0][cell])
        value = show_sign(quantity(float(self.means[cell]), self.unit, 2))
        return f"The largest is {value}, towards ({x}, {y}, {z})."


def compute_residuals(result: Calibrated) -> Residuals:
    """The residuals of the fit, worked out again where it kept none (a fit from moments)."""
    fit = result.fit
    values = _distances(result) if fit.residuals is None else fit.residuals
    weights = np.ones(len(values)) if fit.weights is None else fit.weights
    return Residuals(
        values=values,
        weights=weights,
        means=_cell_means(result, values, weights),
        noise=fit.noise,
        unit=unit_label(fit.calibration.unit_in),
    )


def find_held_out(result: Calibrated) -> Mask | None:
    """The rows held out of the fit (n,) where they are a part of it; `None` where every reading
    was judged in its turn, by a fit to others, and where the readings are others altogether."""
    held_out, weights = result.verification.held_out, result.fit.weights
    if held_out is None:
        return None
    counted = np.ones(len(held_out), dtype=bool) if weights is None else weights > 0
    return None if held_out[counted].all() else held_out


def find_level(result: Calibrated) -> float:
    """The magnitude that the calibrated readings lie around, in the unit of the field."""
    return result.fit.calibration.magnitude or float(np.mean(result.verification.magnitude_after))


def _distances(result: Calibrated) -> Array:
    calibration = result.fit.calibration
    level = find_level(result)
    here = (calibration.bias, calibration.matrix, level)
    return magnitude_residual(result.cleaned, *here, differentiate=False)[0]


def _cell_means(result: Calibrated, values: Array, weights: Array) -> Array:
    corrected = result.corrected
    if len(corrected) != len(values):  # a refused fit takes readings beyond what is a field
        return np.full(80, np.nan)
    cells = find_cells(corrected)
    total = np.bincount(cells, weights, minlength=80)
    sums = np.bincount(cells, weights * values, minlength=80)
    means = np.full(80, np.nan)
    np.divide(sums, total, out=means, where=total >= FEWEST)
    return means
