"""Bias and matrix over temperature, from stations in a climatic chamber or a known field."""

from agonic.fitting.thermal.from_samples import fit_binned, fit_thermal
from agonic.fitting.thermal.gathered import Facts
from agonic.fitting.thermal.result import (
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
