"""True north by a gyrotheodolite, carried to a magnetometer, and absolute measurements."""

from agonic.alignment.north.di_flux import DiFluxFit, fit_di_flux
from agonic.alignment.north.fit import NorthFit, fit_north

__all__ = ["DiFluxFit", "NorthFit", "fit_di_flux", "fit_north"]
