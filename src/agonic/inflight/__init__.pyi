"""Calibrate and track in flight and in orbit.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.calibration.tracking import TrackerParams as TrackerParams
from agonic.calibration.tracking import TrackerState as TrackerState
from agonic.inflight.fit import InflightFit as InflightFit
from agonic.inflight.fit import fit_inflight as fit_inflight
from agonic.inflight.fit import fit_mission as fit_mission
from agonic.inflight.simulation.kepler import Orbit as Orbit
from agonic.inflight.simulation.orbit import SimulatedOrbit as SimulatedOrbit
from agonic.inflight.simulation.orbit import simulate_orbit as simulate_orbit
from agonic.inflight.tracking import Tracker as Tracker
from agonic.inflight.tracking import WalkChoice as WalkChoice
from agonic.inflight.tracking import choose_walk as choose_walk
from agonic.logs.large.mission import Mission as Mission
from agonic.logs.large.mission import open_mission as open_mission
from agonic.logs.space.positions import positions_from_tle as positions_from_tle
