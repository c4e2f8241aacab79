"""The map of a region: the field of a room or a coil from readings at known places."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
