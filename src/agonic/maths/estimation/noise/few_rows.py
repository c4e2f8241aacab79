"""Noise with memory in few rows, where residuals are too few to show a correlation of their own.

A fit of m unknowns to some dozens of rows takes most of slow noise up, and what is left looks
white. So every correlation ρ of a first-order autoregression is asked how well it explains the
residuals, the fit's own share taken out, and all of them together say how the gradient Σ z J of
the fit scatters:

    B = Σ p(ρ | z) σ²(ρ) JᵀR(ρ)J,   R_ij = ρ^|i − j|,   σ²(ρ) = zᵀQz/(n − m),
    Q = R⁻¹ − R⁻¹J (JᵀR⁻¹J)⁻¹ JᵀR⁻¹,
    p(ρ | z) ∝ |R|^(−1/2) |JᵀR⁻¹J|^(−1/2) (zᵀQz)^(−(n − m)/2).

Source: restricted likelihood, H. D. Patterson, R. Thompson (1971), Biometrika 58, 545; averaged
over ρ as in D. A. Harville (1974), Biometrika 61, 383.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array

FEW = 150
"""Rows beyond which residuals tell their correlation themselves."""

_CORRELATIONS = np.linspace(0.0, 0.95, 20)


def scatter_of_few(residuals: Array, jacobian: Array) -> Array:
    """How the gradient of a fit to few rows scatters (m, m), memory of the noise as likely as its
    residuals make it.

    Parameters: residuals over their noise (n,), their Jacobian (n, m), in order of time.

    >>> rng = np.random.default_rng(0)
    >>> noise = rng.normal(size=100)
    >>> bool(80 < scatter_of_few(noise - noise.mean(), np.ones((100, 1)))[0, 0] < 200)
    True
    """
    n, m = jacobian.shape
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    likely, scatter = np.zeros(len(_CORRELATIONS)), np.zeros((len(_CORRELATIONS), m, m))
    for k, rho in enumerate(_CORRELATIONS):
        z, white = (_whiten(columns, rho) for columns in (residuals[:, None], jacobian))
        q, r = np.linalg.qr(white)
        left = float(np.sum((z - q @ (q.T @ z)) ** 2))
        shape = float(np.log(np.maximum(np.abs(np.diag(r)), 1e-300)).sum())
        likely[k] = -shape - 0.5 * (n - m) * np.log(max(left, 1e-300))
        likely[k] -= 0.5 * (n - 1) * np.log1p(-(rho**2))
        scatter[k] = left / (n - m) * jacobian.T @ rho**lag @ jacobian
    share = np.exp(likely - likely.max())
    return np.asarray(np.tensordot(share / share.sum(), scatter, axes=1))


def _whiten(columns: Array, rho: float) -> Array:
    """Columns (n, k) with noise of correlation ρ and variance one made white, of variance one."""
    inside = (columns[1:] - rho * columns[:-1]) / np.sqrt(1.0 - rho**2)
    return np.vstack([columns[:1], inside])
