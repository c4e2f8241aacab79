"""agonic: magnetometer readings into a direction one can trust.

    import agonic as ag

    samples = ag.read("flight.bin", sensor="MAG2")
    fit = ag.fit_ellipsoid(samples, ag.Reference.constant(49_500))
    print(fit.status)
    field = fit.calibration.correct(samples.field)
    ag.save(fit.calibration, "mag2.json")

Conventions
-----------
Field       nanotesla (nT), everywhere inside; other units only at the doors (files, display).
            Readings of unknown scale are "raw"; then the input of a calibration is raw too.
Rows        a row is a sample: (n, 3), always. `None` is missing. Rows with NaN are left out at
            the door, counted and reported.
Time        float64 seconds since `epoch` (UTC), strictly increasing.
Names       quantities other than field and time end in their unit: `_deg`, `_rad`, `_C`, `_s`,
            `_m`, `_A`. Standard deviations and standard errors are `sd`.
Equation    field = matrix @ (raw − bias).
Frames      one letter: m magnetometer, b body (forward, right, down), c star camera,
            n north-east-down, e Earth-fixed, i inertial. `rot_nb` turns b into n.
Attitude    aerospace yaw-pitch-roll; heading clockwise from true north.
Quaternion  only on disk: `quat_wxyz`, Hamilton.
Heading     magnetic = compass + deviation(compass); true = magnetic + declination; east positive.

Modules
-------
samples, reference            what was measured, and what it should have been
fitting                       `fit_*(samples, reference, *, settings) -> Fit`
calibration                   what gets saved: `Affine`, `Interference`, `Alignment`, `Chain`,
                              `Deviation`, and the `Setup` of a vehicle
health, coverage, fit         what a result rests on, and what is wrong with it
verification, calibrated      named checks on data the fit has not seen
headings                      `heading(samples, setup)`: compass, magnetic, true, how sure
population, fleet, history    the calibrations of many sensors and logs, as one table
io                            readers by content, the calibration file, exports
field                         the world model: IGRF and WMM
simulation                    readings with known truth
report                        HTML and text
kernels                       the mathematics, on plain arrays
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from agonic.version import __version__

if TYPE_CHECKING:  # "as" tells type checkers that the names are public here
    from agonic.calibrated import Calibrated as Calibrated
    from agonic.calibrated import calibrate as calibrate
    from agonic.calibrated_campaign import CalibratedCampaign as CalibratedCampaign
    from agonic.calibrated_campaign import calibrate_campaign as calibrate_campaign
    from agonic.calibration.affine import Affine as Affine
    from agonic.calibration.alignment import Alignment as Alignment
    from agonic.calibration.base import apply as apply
    from agonic.calibration.chain import Chain as Chain
    from agonic.calibration.deviation import Deviation as Deviation
    from agonic.calibration.interference import Interference as Interference
    from agonic.calibration.interference import mean_of as mean_of
    from agonic.calibration.network import Network as Network
    from agonic.calibration.retraining import RetrainerParams as RetrainerParams
    from agonic.calibration.retraining import RetrainerState as RetrainerState
    from agonic.calibration.retraining import Retraining as Retraining
    from agonic.calibration.setup import Compass as Compass
    from agonic.calibration.setup import Setup as Setup
    from agonic.calibration.thermal import Thermal as Thermal
    from agonic.calibration.tracking import TrackerParams as TrackerParams
    from agonic.calibration.tracking import TrackerState as TrackerState
    from agonic.campaign import Campaign as Campaign
    from agonic.campaign import check_campaign as check_campaign
    from agonic.campaign import plan_thermal as plan_thermal
    from agonic.coverage import Coverage as Coverage
    from agonic.errors import (
        AgonicError as AgonicError,
    )
    from agonic.errors import (
        AgonicWarning as AgonicWarning,
    )
    from agonic.errors import (
        ConvergenceError as ConvergenceError,
    )
    from agonic.errors import (
        CoverageError as CoverageError,
    )
    from agonic.errors import (
        FrameError as FrameError,
    )
    from agonic.errors import (
        LogError as LogError,
    )
    from agonic.errors import (
        MissingExtraError as MissingExtraError,
    )
    from agonic.errors import (
        UnitError as UnitError,
    )
    from agonic.errors import (
        ValidityError as ValidityError,
    )
    from agonic.field import igrf as igrf
    from agonic.field import wmm as wmm
    from agonic.field import wmmhr as wmmhr
    from agonic.fit import Fit as Fit
    from agonic.fitting.alignment import AlignmentFit as AlignmentFit
    from agonic.fitting.alignment import AlignmentPlan as AlignmentPlan
    from agonic.fitting.alignment import error_budget as error_budget
    from agonic.fitting.alignment import fit_alignment as fit_alignment
    from agonic.fitting.alignment import plan_alignment as plan_alignment
    from agonic.fitting.attitude import fit_interference as fit_interference
    from agonic.fitting.attitude import fit_levelled as fit_levelled
    from agonic.fitting.attitude import fit_vector as fit_vector
    from agonic.fitting.coil import CoilFit as CoilFit
    from agonic.fitting.coil import fit_coil as fit_coil
    from agonic.fitting.deviation import DeviationFit as DeviationFit
    from agonic.fitting.deviation import SwingPlan as SwingPlan
    from agonic.fitting.deviation import fit_deviation as fit_deviation
    from agonic.fitting.deviation import plan_swing as plan_swing
    from agonic.fitting.ellipsoid import fit_ellipsoid as fit_ellipsoid
    from agonic.fitting.ellipsoid import fit_moments as fit_moments
    from agonic.fitting.ellipsoid import fit_recording as fit_recording
    from agonic.fitting.gravity import GravityFit as GravityFit
    from agonic.fitting.gravity import fit_gravity as fit_gravity
    from agonic.fitting.inflight import InflightFit as InflightFit
    from agonic.fitting.inflight import fit_inflight as fit_inflight
    from agonic.fitting.inflight import fit_mission as fit_mission
    from agonic.fitting.latency import LatencyFit as LatencyFit
    from agonic.fitting.latency import fit_latency as fit_latency
    from agonic.fitting.latency import undelayed as undelayed
    from agonic.fitting.network import NetworkChoice as NetworkChoice
    from agonic.fitting.network import NetworkFit as NetworkFit
    from agonic.fitting.network import choose_network as choose_network
    from agonic.fitting.network import fit_network as fit_network
    from agonic.fitting.north import DiFluxFit as DiFluxFit
    from agonic.fitting.north import NorthFit as NorthFit
    from agonic.fitting.north import fit_di_flux as fit_di_flux
    from agonic.fitting.north import fit_north as fit_north
    from agonic.fitting.thermal import ThermalFit as ThermalFit
    from agonic.fitting.thermal import fit_thermal as fit_thermal
    from agonic.fitting.tracking import WalkChoice as WalkChoice
    from agonic.fitting.tracking import choose_walk as choose_walk
    from agonic.fleet.run import calibrate_fleet as calibrate_fleet
    from agonic.fleet.settings import FleetSettings as FleetSettings
    from agonic.headings import Heading as Heading
    from agonic.headings import heading as heading
    from agonic.health import Finding as Finding
    from agonic.history import Drift as Drift
    from agonic.history import History as History
    from agonic.history import departures as departures
    from agonic.history import drift as drift
    from agonic.io.calfile import load as load
    from agonic.io.calfile import save as save
    from agonic.io.campaign import read_campaign as read_campaign
    from agonic.io.coil_file import read_coil as read_coil
    from agonic.io.firmware import DeclinationGrid as DeclinationGrid
    from agonic.io.firmware import declination_grid as declination_grid
    from agonic.io.firmware import write_firmware as write_firmware
    from agonic.io.log import Log as Log
    from agonic.io.north_file import read_north as read_north
    from agonic.io.pieces import Mission as Mission
    from agonic.io.pieces import open_mission as open_mission
    from agonic.io.read import open_log as open_log
    from agonic.io.read import read as read
    from agonic.io.read import sensors as sensors
    from agonic.io.read_di_flux import read_di_flux as read_di_flux
    from agonic.io.session_file import read_session as read_session
    from agonic.io.setupfile import load_setup as load_setup
    from agonic.io.setupfile import save_setup as save_setup
    from agonic.io.swing import read_swing as read_swing
    from agonic.io.tle import positions_from_tle as positions_from_tle
    from agonic.io.write_ardupilot import write_ardupilot as write_ardupilot
    from agonic.io.write_c import write_c as write_c
    from agonic.io.write_campaign import write_campaign as write_campaign
    from agonic.io.write_coil import write_coil as write_coil
    from agonic.io.write_csv import write_csv as write_csv
    from agonic.io.write_csv import write_sensors as write_sensors
    from agonic.io.write_matlab import write_matlab as write_matlab
    from agonic.io.write_motioncal import write_motioncal as write_motioncal
    from agonic.io.write_north import write_north as write_north
    from agonic.io.write_px4 import write_px4 as write_px4
    from agonic.io.write_ros import write_ros as write_ros
    from agonic.io.write_session import write_session as write_session
    from agonic.io.write_table import write_table as write_table
    from agonic.live import LiveFit as LiveFit
    from agonic.live import LiveParams as LiveParams
    from agonic.moments import Moments as Moments
    from agonic.population import Population as Population
    from agonic.population import read_population as read_population
    from agonic.population import write_population as write_population
    from agonic.provenance import Provenance as Provenance
    from agonic.reference import Reference as Reference
    from agonic.report.card import card_text as card_text
    from agonic.report.card_page import card_page as card_page
    from agonic.report.html import render as render
    from agonic.report.thermal_page import campaign_page as campaign_page
    from agonic.retrainer import Retrainer as Retrainer
    from agonic.samples import Samples as Samples
    from agonic.session import Session as Session
    from agonic.simulation import SimulatedVehicle as SimulatedVehicle
    from agonic.simulation import simulate as simulate
    from agonic.simulation import simulate_vehicle as simulate_vehicle
    from agonic.simulation.campaign import simulate_campaign as simulate_campaign
    from agonic.simulation.coil import simulate_coil as simulate_coil
    from agonic.simulation.kepler import Orbit as Orbit
    from agonic.simulation.north import simulate_north as simulate_north
    from agonic.simulation.orbit import SimulatedOrbit as SimulatedOrbit
    from agonic.simulation.orbit import simulate_orbit as simulate_orbit
    from agonic.simulation.session import simulate_session as simulate_session
    from agonic.tracker import Tracker as Tracker
    from agonic.verification import Verification as Verification
    from agonic.verification import verify as verify

_HOMES = {
    "calibrated": ("Calibrated", "calibrate"),
    "calibrated_campaign": ("CalibratedCampaign", "calibrate_campaign"),
    "calibration.affine": ("Affine",),
    "calibration.alignment": ("Alignment",),
    "calibration.base": ("apply",),
    "calibration.chain": ("Chain",),
    "calibration.deviation": ("Deviation",),
    "calibration.interference": ("Interference", "mean_of"),
    "calibration.network": ("Network",),
    "calibration.retraining": ("RetrainerParams", "RetrainerState", "Retraining"),
    "calibration.setup": ("Compass", "Setup"),
    "calibration.thermal": ("Thermal",),
    "calibration.tracking": ("TrackerParams", "TrackerState"),
    "campaign": ("Campaign", "check_campaign", "plan_thermal"),
    "coverage": ("Coverage",),
    "errors": (
        "AgonicError", "AgonicWarning", "ConvergenceError", "CoverageError", "FrameError",
        "LogError", "MissingExtraError", "UnitError", "ValidityError",
    ),
    "field": ("igrf", "wmm", "wmmhr"),
    "fit": ("Fit",),
    "fitting.alignment": (
        "AlignmentFit", "AlignmentPlan", "error_budget", "fit_alignment", "plan_alignment",
    ),
    "fitting.attitude": ("fit_interference", "fit_levelled", "fit_vector"),
    "fitting.coil": ("CoilFit", "fit_coil"),
    "fitting.gravity": ("GravityFit", "fit_gravity"),
    "fitting.north": ("DiFluxFit", "NorthFit", "fit_di_flux", "fit_north"),
    "fitting.deviation": ("DeviationFit", "SwingPlan", "fit_deviation", "plan_swing"),
    "fitting.ellipsoid": ("fit_ellipsoid", "fit_moments", "fit_recording"),
    "fitting.inflight": ("InflightFit", "fit_inflight", "fit_mission"),
    "fitting.latency": ("LatencyFit", "fit_latency", "undelayed"),
    "fitting.network": ("NetworkChoice", "NetworkFit", "choose_network", "fit_network"),
    "fitting.thermal": ("ThermalFit", "fit_thermal"),
    "fitting.tracking": ("WalkChoice", "choose_walk"),
    "fleet.run": ("calibrate_fleet",),
    "fleet.settings": ("FleetSettings",),
    "headings": ("Heading", "heading"),
    "health": ("Finding",),
    "history": ("Drift", "History", "departures", "drift"),
    "io.calfile": ("load", "save"),
    "io.coil_file": ("read_coil",),
    "io.north_file": ("read_north",),
    "io.read_di_flux": ("read_di_flux",),
    "io.write_coil": ("write_coil",),
    "io.write_north": ("write_north",),
    "io.firmware": ("DeclinationGrid", "declination_grid", "write_firmware"),
    "io.log": ("Log",),
    "io.campaign": ("read_campaign",),
    "io.write_campaign": ("write_campaign",),
    "io.pieces": ("Mission", "open_mission"),
    "io.read": ("open_log", "read", "sensors"),
    "io.session_file": ("read_session",),
    "io.setupfile": ("load_setup", "save_setup"),
    "io.swing": ("read_swing",),
    "io.tle": ("positions_from_tle",),
    "io.write_ardupilot": ("write_ardupilot",),
    "io.write_c": ("write_c",),
    "io.write_csv": ("write_csv", "write_sensors"),
    "io.write_matlab": ("write_matlab",),
    "io.write_motioncal": ("write_motioncal",),
    "io.write_px4": ("write_px4",),
    "io.write_ros": ("write_ros",),
    "io.write_session": ("write_session",),
    "io.write_table": ("write_table",),
    "live": ("LiveFit", "LiveParams"),
    "moments": ("Moments",),
    "population": ("Population", "read_population", "write_population"),
    "provenance": ("Provenance",),
    "reference": ("Reference",),
    "report.card": ("card_text",),
    "report.card_page": ("card_page",),
    "report.html": ("render",),
    "report.thermal_page": ("campaign_page",),
    "samples": ("Samples",),
    "session": ("Session",),
    "simulation": ("SimulatedVehicle", "simulate", "simulate_vehicle"),
    "simulation.campaign": ("simulate_campaign",),
    "simulation.coil": ("simulate_coil",),
    "simulation.north": ("simulate_north",),
    "simulation.session": ("simulate_session",),
    "simulation.kepler": ("Orbit",),
    "simulation.orbit": ("SimulatedOrbit", "simulate_orbit"),
    "retrainer": ("Retrainer",),
    "tracker": ("Tracker",),
    "verification": ("Verification", "verify"),
}  # fmt: skip
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = ["__version__", *sorted(_HOME_OF)]


def __getattr__(name: str) -> Any:
    """Public names are loaded when first used, so that a command pays only for what it needs."""
    if name not in _HOME_OF:
        raise AttributeError(f"module 'agonic' has no attribute {name!r}")
    value = getattr(import_module(f"agonic.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
