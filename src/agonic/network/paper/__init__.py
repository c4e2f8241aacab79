"""The simulation of Wang et al. (2020) from end to end, beside what was published."""

from agonic.network.paper.reproduce import reproduce_paper

__all__ = ["reproduce_paper"]
