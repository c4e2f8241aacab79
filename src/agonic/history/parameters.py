"""The parameters of calibrations that can be followed over time, and which can be compared."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.population import Population
from agonic.population.population import AXES, PAIRS
from agonic.units import RAW

KINDS = ("bias", "gain", "cross")
"""Bias in the unit of the readings; gain, the diagonal of the matrix; cross, the symmetric part of
what is off it, which to first order is the same in every gauge."""
NAMES = (
    *(f"{kind} {axis}" for kind in KINDS[:2] for axis in AXES),
    *(f"cross {AXES[i]}{AXES[j]}" for i, j in PAIRS),
)


class Parameters(NamedTuple):
    """Values and standard errors (n, 9) in the order of `NAMES`, and their units; NaN for what the
    model of a row does not hold.
    """

    values: Array
    sd: Array
    units: tuple[str, ...]


def find_comparable(population: Population) -> Index:
    """The rows that can be compared with the last calibration: its channel, its units.

    Their biases are known, within bounds.

    >>> find_comparable(Population.of([])).tolist()
    []
    """
    known = np.isfinite(population.bias) & ~np.isinf(population.bias_sd)
    rows = np.flatnonzero(population.fitted & known.all(axis=1))
    if not len(rows):
        return rows
    same = np.ones(len(rows), dtype=bool)
    for name in ("channel", "unit_in", "unit_out"):
        same &= population[name][rows] == population[name][rows[-1]]
    return rows[same]


def extract_parameters(population: Population) -> Parameters:
    """The parameters of every row; those without bounds are not known.

    >>> extract_parameters(Population.of([])).values.shape
    (0, 9)
    """
    matrix, matrix_sd = population.matrix, np.nan_to_num(population.matrix_sd, posinf=np.inf)
    axes = np.arange(3)
    values = np.hstack([population.bias, matrix[:, axes, axes], population.cross])
    bias_sd = np.nan_to_num(population.bias_sd, posinf=np.inf)
    sd = np.hstack([bias_sd, matrix_sd[:, axes, axes], population.cross_sd])
    return Parameters(np.where(np.isfinite(sd), values, np.nan), sd, _name_units(population))


def _name_units(population: Population) -> tuple[str, ...]:
    if not len(population):
        return ("",) * 9
    into, out = (str(population[name][-1] or "") for name in ("unit_in", "unit_out"))
    bias = "raw units" if into == RAW else into
    gain = "" if into == out else f"{out} per {'count' if into == RAW else into}"
    return (bias,) * 3 + (gain,) * 6
