"""A calibration followed in time, a reading after the other."""

from agonic.inflight.tracking.filter import Coefficients, start, update
from agonic.inflight.tracking.random_walk import WalkChoice, choose_walk

__all__ = ["Coefficients", "WalkChoice", "choose_walk", "start", "update"]
