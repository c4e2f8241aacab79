"""Align with a star sensor, with north, with gravity, or a coil."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
