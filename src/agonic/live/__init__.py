"""Calibrating while a sensor is being turned: what is covered, how good it is, what to do next."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
