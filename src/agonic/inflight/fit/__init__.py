"""Calibration against the world model, in flight and in orbit."""

from agonic.inflight.fit.fit import fit_inflight
from agonic.inflight.fit.large_scan import Recording
from agonic.inflight.fit.mission import fit_mission
from agonic.inflight.fit.result import InflightFit

__all__ = ["InflightFit", "Recording", "fit_inflight", "fit_mission"]
