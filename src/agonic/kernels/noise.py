"""What residuals say of the noise: its size, how long it lasts, whether readings stand out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.kernels import leastsq

Array = NDArray[np.float64]


class Noise(NamedTuple):
    """The loss that the residuals call for, their standard deviation, and correlation length."""

    loss: leastsq.Loss
    sd: float
    correlation: float

    def settled(self, assumed: Noise) -> bool:
        """Noise and correlation are what a solution assumed, to one and five per cent."""
        lengths = self.correlation / assumed.correlation
        return abs(self.sd / assumed.sd - 1) < 0.01 and abs(lengths - 1) < 0.05


def noise_of(residuals: Array, robust: bool, parameters: int) -> Noise:
    """The noise of residuals in time order.

    Least squares unless a reading stands out: the largest of n Gaussian readings is expected below
    √(2 ln 2n) standard deviations; one beyond that brings in Tukey's loss.
    """
    scale = max(leastsq.robust_scale(residuals, parameters), 1e-9)
    largest = float(np.abs(residuals).max())
    stands_out = largest > scale * (np.sqrt(2 * np.log(2 * len(residuals))) + 1)
    loss = leastsq.tukey() if robust and stands_out else leastsq.squares()
    sd = max(leastsq.noise_scale(residuals, loss, scale, parameters), 1e-9)
    weights = loss.weight((residuals / sd) ** 2)
    return Noise(loss, sd, leastsq.correlation_length(residuals, weights))
