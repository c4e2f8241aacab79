"""A calibration followed in time, a reading after the other."""

from agonic.fitting.tracking.filter import Coefficients, start, update
from agonic.fitting.tracking.walk import WalkChoice, choose_walk

__all__ = ["Coefficients", "WalkChoice", "choose_walk", "start", "update"]
