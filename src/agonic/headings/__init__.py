"""True heading: from the readings of one or several magnetometers, with its standard error."""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
