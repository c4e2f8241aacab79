"""What residuals say of the noise: its size, correlation length, and whether it has outliers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.estimation.loss import Loss, expected_square, squares, tukey
from agonic.maths.one_pass import median

MAD_TO_SD = 1.482602218505602  # 1/Φ⁻¹(3/4)
_FEW_LAGS = 32  # so many products take less time than a transform


class Noise(NamedTuple):
    """The loss that the residuals call for, their standard deviation, and correlation length."""

    loss: Loss
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
    scale = max(robust_scale(some, parameters), least)
    largest = float(np.abs(residuals).max())
    stands_out = largest > scale * (np.sqrt(2 * np.log(2 * len(residuals))) + 1)
    loss = tukey() if robust and stands_out else squares()
    sd = max(noise_scale(some, loss, scale, parameters), least)
    weights = loss.weight((residuals / sd) ** 2)
    return Noise(loss, sd, correlation_length(residuals, weights))


def is_like_gaussian(residuals: Array, sd: float, parameters: int) -> bool:
    """Whether residuals of so many fitted parameters and of this rms look like Gaussian noise.

    None stands out, and their median size (sampling error 0.93/√n) and kurtosis (4.9/√n) are what
    the rms makes them: two populations or a bias that moved make the median larger and the kurtosis
    smaller, outliers the other way round.
    """
    n = len(residuals)
    z = residuals / sd
    typical = robust_scale(z, parameters) - 1
    tails = float(np.mean(z**4)) - 3
    near = abs(typical) < min(2.5 / np.sqrt(n), 0.2) and -11 < tails * np.sqrt(n) < 20
    return bool(near and np.abs(z).max() < np.sqrt(2 * np.log(2 * n)) + 1)


def robust_scale(residuals: Array, parameters: int = 0) -> float:
    """Standard deviation from the median absolute residual, less the freedom of the fit."""
    n = len(residuals)
    freedom = np.sqrt(n / (n - parameters)) if n > parameters else 1.0
    return float(MAD_TO_SD * median(np.abs(residuals)) * freedom)


def noise_scale(residuals: Array, loss: Loss, scale: float, parameters: int) -> float:
    """The standard deviation that makes Σ w(z) z² what it would be for Gaussian noise.

    Uses every reading that the loss lets through, so it is as sharp as the plain rms on clean
    readings and deaf to gross ones.
    """
    expected = expected_square(loss)
    freedom = len(residuals) / max(len(residuals) - parameters, 1)
    for _ in range(20):
        q = (residuals / scale) ** 2
        w = loss.weight(q)
        updated = scale * np.sqrt(float((w * q).sum() / w.sum()) / expected * freedom)
        if abs(updated - scale) <= 1e-4 * scale or updated == 0.0:
            return float(updated)
        scale = updated
    return float(scale)


def correlation_length(residuals: Array, weights: Array) -> float:
    """The correlation length 1 + 2 Σ ρ_k: so many successive residuals tell as much as one.

    The sum of autocorrelations runs up to the first that does not stand out of the noise (two
    standard errors), so white residuals give 1.
    """
    z = residuals * weights
    n, power = len(z), float(z @ z)
    if n < 20 or power == 0.0:
        return 1.0
    quiet, total = 2 / np.sqrt(n), 0.0
    for k in range(1, min(_FEW_LAGS, n // 4)):
        rho = float(z[k:] @ z[:-k]) / power
        if rho < quiet:
            return 1 + 2 * total
        total += rho
    spectrum = np.abs(np.fft.rfft(z, 1 << (2 * n - 1).bit_length())) ** 2
    rhos = np.fft.irfft(spectrum)[1 : n // 4] / power
    ends = np.flatnonzero(rhos < quiet)
    return float(1 + 2 * rhos[: ends[0] if len(ends) else len(rhos)].sum())
