"""Calibrations beside raw accelerometer and gyro, in motion, or accelerometer alone, at rest."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
