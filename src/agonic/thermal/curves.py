"""The numbers of a calibration over temperature as curves: coefficients, scale factors, angles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS
from agonic.calibration.decomposition import decompose_at
from agonic.calibration.thermal import Thermal
from agonic.report.labels import unit_label

LEVELS = 61
"""Temperatures at which a curve is drawn."""
_ENTRIES = {"x": 0, "y": 1, "z": 2}


class Curve(NamedTuple):
    """One coefficient over temperature: its `name` and unit, values and standard errors (t,)."""

    name: str
    unit: str
    temperature: Array
    value: Array
    sd: Array | None

    @property
    def label(self) -> str:
        """Name and unit as they stand at an axis."""
        return f"{self.name}, {self.unit}" if self.unit else self.name


def evaluate_coefficients(calibration: Thermal, temperature: Array | None = None) -> list[Curve]:
    """Every coefficient over the range that was seen, bias first.

    >>> flat = Thermal(bias=[[1, 2, 3]], matrix=[np.eye(3)], centre_C=20.0, half_range_C=30.0)
    >>> curves = evaluate_coefficients(flat)
    >>> [curve.name for curve in curves][:4], float(curves[1].value[0])
    (['bias x', 'bias y', 'bias z', 'matrix xx'], 2.0)
    """
    at = np.linspace(*calibration.range_C, LEVELS) if temperature is None else temperature
    names = FREE_PARAMETERS if calibration.gauge == "free" else PARAMETERS
    bias, matrix = calibration.bias_at(at), calibration.matrix_at(at)
    sd = None if calibration.covariance is None else calibration.sd_at(at)
    unit_in, unit_out = unit_label(calibration.unit_in), unit_label(calibration.unit_out)
    ratio = "" if unit_in == unit_out else f"{unit_out} per {unit_in.rstrip('s')}"
    made = []
    for k, name in enumerate(names):
        what, _, axes = name.partition("_")
        value = bias[:, k] if what == "bias" else matrix[:, _ENTRIES[axes[0]], _ENTRIES[axes[1]]]
        unit = unit_in if what == "bias" else ratio
        made.append(Curve(f"{what} {axes}", unit, at, value, None if sd is None else sd[:, k]))
    return made


def evaluate_decomposition(calibration: Thermal, temperature: Array | None = None) -> list[Curve]:
    """Scale factors and angles between the axes over the range that was seen; none where the
    matrix has no inverse.

    >>> flat = Thermal(bias=[[1, 2, 3]], matrix=[np.eye(3)], centre_C=20.0, half_range_C=30.0)
    >>> [curve.name for curve in evaluate_decomposition(flat)][::3]
    ['scale factor x', 'non-orthogonality xy']
    """
    at = np.linspace(*calibration.range_C, LEVELS) if temperature is None else temperature
    found = decompose_at(calibration, at)
    if not np.isfinite(found.scale_factors).all():
        return []
    unit_in, unit_out = unit_label(calibration.unit_in), unit_label(calibration.unit_out)
    ratio = "" if unit_in == unit_out else f"{unit_in} per {unit_out.rstrip('s')}"
    known = calibration.covariance is not None
    groups = (
        ("scale factor", "xyz", ratio, found.scale_factors, found.scale_factors_sd),
        (
            "non-orthogonality",
            ("xy", "xz", "yz"),
            "°",
            found.nonorthogonality_deg,
            found.nonorthogonality_sd_deg,
        ),
    )
    return [
        Curve(f"{what} {axes}", unit, at, values[:, k], sd[:, k] if known else None)
        for what, names, unit, values, sd in groups
        for k, axes in enumerate(names)
    ]
