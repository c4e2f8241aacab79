"""Noise with memory: an autoregression that makes residuals white."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array

MOST_LAGS = 12
ROWS_PER_LAG = 10
PRICE = 6.0
"""Of a lag, in twice the log-likelihood: so that one white log in a hundred gets one."""
WHITE = np.ones(1)


def fit_filter(residuals: Array) -> Array:
    """The filter (1, −a₁, …, −a_p) that whitens residuals (n,), its order by likelihood less
    `PRICE` a lag (Levinson's recursion on the autocovariances).

    >>> rng = np.random.default_rng(0)
    >>> len(fit_filter(rng.normal(size=2000)))
    1
    >>> walk = rng.normal(size=2000)
    >>> for k in range(1, 2000):
    ...     walk[k] += 0.9 * walk[k - 1]
    >>> bool(abs(fit_filter(walk)[1] + 0.9) < 0.05)
    True
    """
    n = len(residuals)
    most = min(MOST_LAGS, n // ROWS_PER_LAG)
    covariances = np.array([residuals[: n - k] @ residuals[k:] for k in range(most + 1)]) / n
    if not covariances[0] > 0.0:
        return WHITE
    weights, left = np.empty(0), float(covariances[0])
    best, cost = WHITE, n * np.log(left)
    for k in range(1, most + 1):
        reflection = (covariances[k] - weights @ covariances[k - 1 : 0 : -1]) / left
        weights = np.append(weights - reflection * weights[::-1], reflection)
        left *= 1.0 - reflection**2
        if not left > 0.0:
            break
        price = n * np.log(left) + PRICE * k
        if price < cost:
            best, cost = np.append(1.0, -weights), price
    return best


def whiten(rows: Array, by: Array) -> Array:
    """Rows (k, n) of time filtered by (p + 1,); as they are where it is white."""
    if len(by) == 1:
        return rows
    white = np.empty_like(rows)
    for row, out in zip(rows, white, strict=True):  # one by one they stay in the cache
        out[:] = np.convolve(row, by)[: len(row)]
    return white
