"""Calibration against the world model, in flight and in orbit."""

from agonic.fitting.inflight.from_samples import fit_inflight
from agonic.fitting.inflight.record import InflightFit

__all__ = ["InflightFit", "fit_inflight"]
