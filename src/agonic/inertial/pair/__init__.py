"""An accelerometer and a magnetometer calibrated together, from attitudes at rest."""

from agonic.inertial.pair.check import PairCheck, check_pair
from agonic.inertial.pair.fit import fit_pair
from agonic.inertial.pair.result import PairFit

__all__ = ["PairCheck", "PairFit", "check_pair", "fit_pair"]
