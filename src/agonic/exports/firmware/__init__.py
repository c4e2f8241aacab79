"""C99 for a controller: from readings to true heading, and a calibration that runs there."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
