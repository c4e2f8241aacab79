"""Calibrating many logs and sensors without anyone watching."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
