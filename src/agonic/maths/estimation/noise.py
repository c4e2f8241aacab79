"""What residuals say of the noise: its size, correlation length, and whether it has outliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.estimation import leastsq


class Noise(NamedTuple):
    """The loss that the residuals call for, their standard deviation, and correlation length."""

    loss: leastsq.Loss
    sd: float
    correlation: float

    def settled(self, assumed: Noise) -> bool:
        """Noise and correlation are what a solution assumed, to one and five per cent."""
        lengths = self.correlation / assumed.correlation
        return abs(self.sd / assumed.sd - 1) < 0.01 and abs(lengths - 1) < 0.05


def estimate_noise(
    residuals: Array,
    robust: bool,
    parameters: int,
    typical: Index | None = None,
    least: float = 1e-9,
) -> Noise:
    """The noise of residuals in time order; its size is that of the `typical` rows, if given.

    It is no less than `least`, what rounding alone makes of readings.

    Least squares unless a reading stands out: the largest of n Gaussian readings is expected below
    √(2 ln 2n) standard deviations; one beyond that brings in Tukey's loss.
    """
    some = residuals if typical is None else residuals[typical]
    scale = max(leastsq.robust_scale(some, parameters), least)
    largest = float(np.abs(residuals).max())
    stands_out = largest > scale * (np.sqrt(2 * np.log(2 * len(residuals))) + 1)
    loss = leastsq.tukey() if robust and stands_out else leastsq.squares()
    sd = max(leastsq.noise_scale(some, loss, scale, parameters), least)
    weights = loss.weight((residuals / sd) ** 2)
    return Noise(loss, sd, leastsq.correlation_length(residuals, weights))


def is_like_gaussian(residuals: Array, sd: float, parameters: int) -> bool:
    """Whether residuals of so many fitted parameters and of this rms look like Gaussian noise.

    None stands out, and their median size (sampling error 0.93/√n) and kurtosis (4.9/√n) are what
    the rms makes them: two populations or a bias that moved make the median larger and the kurtosis
    smaller, outliers the other way round.
    """
    n = len(residuals)
    z = residuals / sd
    typical = leastsq.robust_scale(z, parameters) - 1
    tails = float(np.mean(z**4)) - 3
    near = abs(typical) < min(2.5 / np.sqrt(n), 0.2) and -11 < tails * np.sqrt(n) < 20
    return bool(near and np.abs(z).max() < np.sqrt(2 * np.log(2 * n)) + 1)
