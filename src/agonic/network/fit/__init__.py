"""Networks trained by Levenberg–Marquardt on top of an affine or thermal calibration."""

from agonic.network.fit.fit import fit_network
from agonic.network.fit.methods import Method, compare_methods
from agonic.network.fit.result import Comparison, NetworkFit
from agonic.network.fit.selection import NetworkChoice, choose_network

__all__ = [
    "Comparison",
    "Method",
    "NetworkChoice",
    "NetworkFit",
    "choose_network",
    "compare_methods",
    "fit_network",
]
