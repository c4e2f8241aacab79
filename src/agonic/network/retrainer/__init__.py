"""A network that is trained again while its sensor is in use."""

from agonic.network.retrainer.service import Corrected, Retrainer

__all__ = ["Corrected", "Retrainer"]
