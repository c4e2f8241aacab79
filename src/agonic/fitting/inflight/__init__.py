"""Calibration against the world model, in flight and in orbit."""

from agonic.fitting.inflight.from_samples import fit_inflight
from agonic.fitting.inflight.mission import fit_mission
from agonic.fitting.inflight.record import InflightFit
from agonic.fitting.inflight.scan import Recording

__all__ = ["InflightFit", "Recording", "fit_inflight", "fit_mission"]
