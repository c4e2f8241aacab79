"""By how much a score Σ J z scatters whose residuals z are correlated."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.noise.student import compute_widening

_BATCHES = (6, 12, 40)  # of time, in which scores scatter


def compute_score_variance(z: Array, fall: Array, trust: Array) -> float:
    """The variance of Σ J z: by the correlation of z, or by batches of time, whichever is larger.

    Parameters: z, fall (the derivative J) (n, 3), in units of the noise; trust (n, 1).
    """
    return max(
        _scatter(z, trust * fall), *(_compute_batch_variance(z, fall, count) for count in _BATCHES)
    )


def _scatter(z: Array, fall: Array) -> float:
    """The variance of Σ s, s = J·z: Σ s² (1 + 2 Σ_k ρ_k c_k), lags up to where ρ is lost in noise.

    ρ is the correlation of the residuals and c that of J, which are independent of each other.
    """
    rho, along = _correlations(z), _correlations(fall)
    quiet = np.flatnonzero(rho < 2 / np.sqrt(z.size))
    last = int(quiet[0]) if len(quiet) else len(rho)
    scores = (fall * z).sum(axis=1)
    return float(scores @ scores) * max(1 + 2 * float(rho[1:last] @ along[1:last]), 0.0)


def _compute_batch_variance(z: Array, fall: Array, count: int) -> float:
    """The variance of Σ s by the scatter of the sums of batches of time, widened by Student's t.

    Batches count by their information: a log with three turns has three, however long it is. No
    batch is left out or trusted less, since a turn that disagrees is what errors in turns look
    like. The widening is that of the interval of 95 %.
    """
    batches = np.array_split(np.arange(len(z)), count)
    g = np.array([(z[rows] * fall[rows]).sum() for rows in batches])
    h = np.array([(fall[rows] ** 2).sum() for rows in batches])
    freedom = max(h.sum() ** 2 / max((h**2).sum(), 1e-300) - 1.0, 1.0)
    g = g - h * (g.sum() / max(h.sum(), 1e-300))
    return float((g @ g) * (freedom + 1.0) / freedom * compute_widening(freedom) ** 2)


def _correlations(rows: Array) -> Array:
    """Σ_i x_i · x_{i+k} / Σ_i x_i · x_i of rows (n, 3), for k up to a quarter of them."""
    size = 1 << (2 * len(rows) - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(rows, size, axis=0)) ** 2
    sums = np.fft.irfft(spectrum.sum(axis=1), size)[: max(len(rows) // 4, 1)]
    return np.asarray(sums / max(sums[0], 1e-300))
