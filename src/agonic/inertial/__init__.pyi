"""Beside accelerometer and gyro.

The public names of this wing, a line each; see `agonic.public`.
"""

from agonic.inertial.pair import PairCheck as PairCheck
from agonic.inertial.pair import PairFit as PairFit
from agonic.inertial.pair import check_pair as check_pair
from agonic.inertial.pair import fit_pair as fit_pair
from agonic.inertial.pair.simulate import simulate_shots as simulate_shots
