"""Calibrations kept over time: how a sensor drifts, when it stepped, whether it left the others."""

from agonic.history.departure import Departure, add_departures, departures
from agonic.history.drifting_sensors import find_drifting
from agonic.history.fit import Drift, Event, ParameterChange, drift
from agonic.history.trend import Band, Trend

__all__ = [
    "Band",
    "Departure",
    "Drift",
    "Event",
    "ParameterChange",
    "Trend",
    "add_departures",
    "departures",
    "drift",
    "find_drifting",
]
