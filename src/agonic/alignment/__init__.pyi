"""Align with a star sensor, with north, with gravity, or a coil.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.alignment.coil.fit import fit_coil as fit_coil
from agonic.alignment.coil.result import CoilFit as CoilFit
from agonic.alignment.direction.compute import field_direction as field_direction
from agonic.alignment.direction.follow import Follower as Follower
from agonic.alignment.direction.follow import follow_direction as follow_direction
from agonic.alignment.direction.result import FieldDirection as FieldDirection
from agonic.alignment.files.read_di_flux import read_di_flux as read_di_flux
from agonic.alignment.files.sessions import read_coil as read_coil
from agonic.alignment.files.sessions import read_north as read_north
from agonic.alignment.files.sessions import read_session as read_session
from agonic.alignment.files.sessions import write_coil as write_coil
from agonic.alignment.files.sessions import write_north as write_north
from agonic.alignment.files.sessions import write_session as write_session
from agonic.alignment.gravity import GravityFit as GravityFit
from agonic.alignment.gravity import fit_gravity as fit_gravity
from agonic.alignment.north.di_flux import DiFluxFit as DiFluxFit
from agonic.alignment.north.di_flux import fit_di_flux as fit_di_flux
from agonic.alignment.north.fit import NorthFit as NorthFit
from agonic.alignment.north.fit import fit_north as fit_north
from agonic.alignment.remanence import RemanenceFit as RemanenceFit
from agonic.alignment.remanence import fit_remanence as fit_remanence
from agonic.alignment.session.session import Session as Session
from agonic.alignment.simulation.laboratory import simulate_coil as simulate_coil
from agonic.alignment.simulation.laboratory import simulate_north as simulate_north
from agonic.alignment.simulation.session import simulate_remanence as simulate_remanence
from agonic.alignment.simulation.session import simulate_session as simulate_session
from agonic.alignment.star_sensor.budget import error_budget as error_budget
from agonic.alignment.star_sensor.fit import fit_alignment as fit_alignment
from agonic.alignment.star_sensor.plan import AlignmentPlan as AlignmentPlan
from agonic.alignment.star_sensor.plan import plan_alignment as plan_alignment
from agonic.alignment.star_sensor.result import AlignmentFit as AlignmentFit
from agonic.calibration.alignment import Alignment as Alignment
