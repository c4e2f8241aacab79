"""From normalised numbers back to readings: sizes, centre, and the range of temperatures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import CoverageError
from agonic.health import Finding, figure

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
