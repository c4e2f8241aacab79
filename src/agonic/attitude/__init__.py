"""Calibrations aided by attitude: levelled, vector, and with the interference on board."""

from agonic.attitude.interference import fit_interference
from agonic.attitude.levelled import fit_levelled
from agonic.attitude.vector import fit_vector

__all__ = ["fit_interference", "fit_levelled", "fit_vector"]
