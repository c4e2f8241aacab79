"""Calibrations kept over time: how a sensor drifts, when it stepped, whether it left the others."""

from agonic.history.departure import Departure, beside, departures
from agonic.history.drift_fit import Drift, Event, Moved, drift
from agonic.history.listing import drifting
from agonic.history.trend import Band, Trend

__all__ = [
    "Band",
    "Departure",
    "Drift",
    "Event",
    "Moved",
    "Trend",
    "beside",
    "departures",
    "drift",
    "drifting",
]
