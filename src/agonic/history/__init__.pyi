"""Calibrations of a sensor over the years.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.history.departure import departures as departures
from agonic.history.fit import drift as drift
from agonic.history.result import Drift as Drift
from agonic.population import History as History
