"""Networks trained by Levenberg–Marquardt on top of an affine or thermal calibration."""

from agonic.fitting.network.from_samples import fit_network
from agonic.fitting.network.result import Comparison, Errors, NetworkFit
from agonic.fitting.network.selection import NetworkChoice, choose_network

__all__ = ["Comparison", "Errors", "NetworkChoice", "NetworkFit", "choose_network", "fit_network"]
