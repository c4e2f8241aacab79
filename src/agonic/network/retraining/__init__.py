"""A network that is trained again while its sensor is in use: candidates, acceptance, schedule."""

from agonic.network.retraining.retrainer import Retrainer

__all__ = ["Retrainer"]
