"""Calibrations kept over time: how a sensor drifts, when it stepped, whether it left the others."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
