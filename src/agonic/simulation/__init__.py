"""Simulated magnetometers whose calibration is known, and the defects that real logs have."""

from agonic.simulation.defects import (
    Defect,
    clipped,
    delayed,
    drifting,
    duplicated,
    frozen,
    magnet_attached,
    mixed,
    quantised,
    with_correlated_noise,
    with_gap,
    with_nan,
    with_outliers,
)
from agonic.simulation.draws import random_calibration
from agonic.simulation.sensor import Simulated, kinds, simulate, with_inertial_unit
from agonic.simulation.vehicle import SimulatedVehicle, simulate_vehicle

__all__ = [
    "Defect",
    "Simulated",
    "SimulatedVehicle",
    "clipped",
    "delayed",
    "drifting",
    "duplicated",
    "frozen",
    "kinds",
    "magnet_attached",
    "mixed",
    "quantised",
    "random_calibration",
    "simulate",
    "simulate_vehicle",
    "with_correlated_noise",
    "with_gap",
    "with_inertial_unit",
    "with_nan",
    "with_outliers",
]
