"""The simulation of Wang et al. (2020) from end to end, beside what was published."""

from agonic.network.paper.reproduce import Reproduction, reproduce_paper

__all__ = ["Reproduction", "reproduce_paper"]
