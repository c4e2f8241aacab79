"""What is believed before the flight: the ground calibration, and how far things may have moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.kernels import leastsq
from agonic.kernels.gauge import entries

Array = NDArray[np.float64]

FIXED = 1e-9
"""Standard deviation of what is not solved for, as a share of the gain: as good as fixed."""


def matrix_sd(ground: Calibration | None, solve: str, gain_sd: float) -> Array:
    """Standard deviations (6,) of xx yy zz xy xz yz of the change about identity.

    With a ground calibration: what it was uncertain by and `gain_sd`, by which gains may have moved
    since. Diagonal and other entries that are not solved for are held.
    """
    sd = np.full(6, gain_sd)
    if isinstance(ground, Affine) and ground.covariance is not None:
        gain = float(np.trace(ground.matrix)) / 3
        sd = np.hypot(sd, np.sqrt(np.diag(ground.covariance)[3:9]) / gain)
    free = {"bias": 0, "gains": 3, "full": 6}[solve]
    sd[free:] = FIXED
    return sd


def prior(sd: Array, terms: int, term_sd: float) -> leastsq.Prior:
    """Gaussian prior on the nine numbers of the change, bias free, and on the terms.

    Residuals (matrix − identity)/sd over the six entries, coefficients/term_sd.
    """
    wanted = entries(np.eye(3))
    jacobian = np.zeros((6 + terms, 9 + terms))
    jacobian[:6, 3:9] = np.diag(1 / sd)
    jacobian[6:, 9:] = np.eye(terms) / term_sd

    def residuals(params: Array) -> tuple[Array, Array]:
        return np.concatenate([(params[3:9] - wanted) / sd, params[9:] / term_sd]), jacobian

    return residuals
