"""Calibration against the world model, in flight and in orbit."""

from agonic.inflight.fit.fit import fit_inflight
from agonic.inflight.fit.mission import fit_mission
from agonic.inflight.fit.result import InflightFit

__all__ = ["InflightFit", "fit_inflight", "fit_mission"]
