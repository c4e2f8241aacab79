"""Bias and matrix over temperature, from stations in a climatic chamber or a known field."""

from agonic.thermal.fit.binning import Facts
from agonic.thermal.fit.fit import fit_binned, fit_thermal
from agonic.thermal.fit.result import (
    COEFFICIENTS,
    Anomaly,
    Bins,
    Fixture,
    Hysteresis,
    Spread,
    ThermalFit,
)

__all__ = [
    "COEFFICIENTS",
    "Anomaly",
    "Bins",
    "Facts",
    "Fixture",
    "Hysteresis",
    "Spread",
    "ThermalFit",
    "fit_binned",
    "fit_thermal",
]
