"""A calibration followed in time, a reading after the other, by a Kalman filter."""

from agonic.inflight.tracking.filter import start, update
from agonic.inflight.tracking.random_walk import WalkChoice, choose_walk
from agonic.inflight.tracking.result import Coefficients
from agonic.inflight.tracking.tracker import Tracker

__all__ = ["Coefficients", "Tracker", "WalkChoice", "choose_walk", "start", "update"]
