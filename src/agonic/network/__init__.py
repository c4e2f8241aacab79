"""Networks for sensors that are not affine, and their retraining."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
