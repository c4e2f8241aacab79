"""Calibrating while a sensor is being turned: what is covered, how good it is, what to do next."""

from agonic.live.fit import LiveFit
from agonic.live.guidance import Guidance
from agonic.live.state import LiveParams, LiveState

__all__ = ["Guidance", "LiveFit", "LiveParams", "LiveState"]
