"""True north by a gyrotheodolite, carried to a magnetometer, and absolute measurements."""

from agonic.fitting.north.di_flux import DiFluxFit, fit_di_flux
from agonic.fitting.north.from_session import fit_north
from agonic.fitting.north.record import Azimuth, NorthFit

__all__ = ["Azimuth", "DiFluxFit", "NorthFit", "fit_di_flux", "fit_north"]
