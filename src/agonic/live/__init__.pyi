"""Calibrate while the sensor is turned.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.live.fit import LiveFit as LiveFit
from agonic.live.state import LiveParams as LiveParams
