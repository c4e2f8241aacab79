"""Noise with memory: how it scatters the gradient of a fit, from the fit's own residuals.

A residual over its noise is white noise and slow errors e along a direction d that turns, one
Gauss–Markov process for each correlation time τ:

    z_i = ε_i + d_i·e(t_i),   E[e(t) e(t + Δ)ᵀ] = 1 Σ_τ a_τ exp(−|Δ|/τ).

Summed over stretches of time b, what is seen of them is u_b = Σ w z d, and

    u_b = W_b e_b − U_b Γ Σ_c U_cᵀ e_c + noise,   W_b = Σ w d dᵀ,   U_b = Σ w d Jᵀ,

for the fit has taken up what looks like its own parameters (θ moves by Γ Σ w J z), most of it where
errors are slow. The a_τ ≥ 0 are those that give the products Σ_b u_b·u_{b+l} of all lags l best.
The gradient Σ w z J then scatters by Σ_τ a_τ Σ_bc exp(−|b − c|/τ) U_bᵀU_c beside white noise.
Errors that outlast the record are among them: what cannot be told from a constant is not nothing.

Source: variance components from products of residuals, the fit's own share taken out, as in
restricted likelihood (Searle, Casella & McCulloch, Variance Components, 1992).
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.estimation.noise.student import compute_widening

STRETCHES = 256
"""Stretches of time that a record is summed up in, at most."""

FEWEST = 30
"""Stretches below which nothing is said."""

_CHANCE = 14.0  # χ² by which slow errors must explain the products better than white noise
_DOUBT = 2.5  # standard deviations of a product that ask for a look
_GROUPS = 14
_STEP = 2.0  # from one correlation time to the next
_LEAST_FREEDOM = 3.0

Spectrum = NDArray[np.complex128]


class Stretches(NamedTuple):
    """Sums over k stretches in order of time: `seen` (k, g) Σ w z d, `weight` (k, g, g) Σ w d dᵀ,
    `hold` (k, g, m) Σ w d Jᵀ."""

    seen: Array
    weight: Array
    hold: Array

    @classmethod
    def of(
        cls, residuals: Array, jacobian: Array, weights: Array, directions: Array, each: int
    ) -> Stretches:
        """Parameters: residuals over their noise (n,), Jacobian (n, m), weights (n,), directions
        (n, g), in order of time, and how many rows make a stretch; the last may have fewer."""
        columns = np.hstack([residuals[:, None], directions, jacobian])
        weighted = directions * weights[:, None]
        whole = len(columns) // each * each
        parts = [
            weighted[rows].reshape(-1, long, weighted.shape[1]).transpose(0, 2, 1)
            @ columns[rows].reshape(-1, long, columns.shape[1])
            for rows, long in ((slice(whole), each), (slice(whole, None), len(columns) - whole))
            if long and len(columns[rows])
        ]
        sums = np.concatenate(parts)
        g = directions.shape[1]
        return cls(sums[:, :, 0], sums[:, :, 1 : 1 + g], sums[:, :, 1 + g :])


class Memory(NamedTuple):
    """How slow errors scatter the gradient (m, m), what is left of white noise's variance, and
    correlation time, in stretches, columns and variance of each slow error, the last widened by
    what is not known of it."""

    scatter: Array
    white: float
    each: tuple[tuple[float, slice, float], ...] = ()


def find_memory(sums: Stretches, response: Array, geometries: tuple[slice, ...]) -> Memory | None:
    """The slow errors that products of residuals show; None where chance would do.

    Parameters: `response` Γ (m, m); `geometries`, columns of the directions whose errors are
    alike.
    """
    k = len(sums.seen)
    if k < FEWEST:
        return None
    lags = _Lags(sums, response, geometries)
    seen, sd = lags.seen / lags.sd, lags.sd
    if seen[lags.apart].max() < _DOUBT:
        return None
    from scipy.optimize import nnls  # slow to load

    constant = lags.white() / sd
    first = float(constant @ seen) / float(constant @ constant)
    taus = _STEP ** np.arange(-1.0, np.log2(k) + 0.5)
    slow = [(tau, at) for tau in taus for at in geometries]
    found = [lags.slow(tau, at) for tau, at in slow]
    design = np.column_stack([constant, *(products / sd for products, _ in found)])
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    amplitude, left = nnls(design / size, seen)
    if float(np.sum((seen - constant * max(first, 0.0)) ** 2)) - left**2 < _CHANCE:
        return None
    amplitude = amplitude / size
    scatter, each = np.zeros_like(response), []
    for (tau, at), (_, added), a in zip(slow, found, amplitude[1:], strict=True):
        if a > 0:
            freedom = max((at.stop - at.start) * k / (2 * tau), _LEAST_FREEDOM)
            widened = float(a * compute_widening(freedom) ** 2)
            scatter += widened * added
            each.append((float(tau), at, widened))
    return Memory(scatter, float(amplitude[0]), tuple(each))


def sum_scatter(hold: Array, slow: tuple[tuple[float, slice, float], ...]) -> Array:
    """How slow errors scatter a gradient (m, m) whose stretches have a hold (k, g, m) on them."""
    k, size = len(hold), 1 << (2 * len(hold) - 1).bit_length()
    lag = np.minimum(np.arange(size), size - np.arange(size))
    total = np.zeros((hold.shape[2], hold.shape[2]))
    for tau, at, variance in slow:
        gain = np.fft.rfft(np.where(lag < k, np.exp(-lag / tau), 0.0)).real
        spectrum = np.fft.rfft(hold[:, at], size, axis=0)
        followed = np.fft.irfft(gain[:, None, None] * spectrum, size, axis=0)[:k]
        total += variance * np.einsum("kgm,kgn->mn", hold[:, at], followed)
    return total


class _Lags:
    """Products of what stretches show at all lags, in groups of lags, one geometry after the other:
    what is seen, its standard deviation, and what white noise and slow errors would give."""

    def __init__(self, sums: Stretches, response: Array, geometries: tuple[slice, ...]) -> None:
        self.sums, self.response, self.geometries = sums, response, geometries
        k = len(sums.seen)
        self.size = 1 << (2 * k - 1).bit_length()
        edges = np.unique(np.geomspace(1, k // 2, _GROUPS).astype(int))
        self.starts = np.r_[0, edges[:-1]]
        self.longest = int(edges[-1])
        self.apart = np.arange(len(geometries) * len(self.starts)) % len(self.starts) > 0
        at = self._transform(sums.seen)
        self.seen = self._gather([np.abs(at[:, c]) ** 2 for c in geometries])
        weight = self._transform(sums.weight)
        self.weight = {
            (t, g): np.sum(np.abs(weight[:, c, d]) ** 2, axis=(1, 2))
            for t, c in enumerate(geometries)
            for g, d in enumerate(geometries)
        }
        square = [np.sum(np.abs(weight[:, c, c]) ** 2, axis=(1, 2))[:, None] for c in geometries]
        variance = self._gather(square)
        variance[:: len(self.starts)] *= 2
        self.sd = np.sqrt(np.maximum(variance, 1e-300))

    @cached_property
    def hold(self) -> Spectrum:
        """The transform of the hold that stretches have on the parameters."""
        return self._transform(self.sums.hold)

    def white(self) -> Array:
        """What white noise of unit variance gives."""
        bent = self.hold @ self.response
        parts = []
        for c in self.geometries:
            total = float(np.einsum("kii->", self.sums.weight[:, c, c]))
            own = -np.sum(np.conj(bent[:, c]) * self.hold[:, c], axis=(1, 2)).real
            parts.append((own + total)[:, None])
        return self._gather(parts)

    def slow(self, tau: float, at: slice) -> tuple[Array, Array]:
        """What errors of unit variance and this time give, and how they scatter the gradient."""
        k = len(self.sums.seen)
        lag = np.minimum(np.arange(self.size), self.size - np.arange(self.size))
        kernel = np.where(lag < k, np.exp(-lag / tau), 0.0)
        gain = np.fft.rfft(kernel).real
        hold = self.sums.hold[:, at]
        followed = np.fft.irfft(gain[:, None, None] * self.hold[:, at], self.size, axis=0)[:k]
        scatter = np.einsum("kgm,kgn->mn", hold, followed)
        taken = np.einsum("kig,kgm->kim", self.sums.weight[:, :, at], followed) @ self.response
        crossed = self._transform(taken)
        both = self.hold @ (self.response @ scatter @ self.response)
        parts, number = [], self.geometries.index(at)
        for t, c in enumerate(self.geometries):
            rest = np.sum(np.conj(both[:, c] - 2 * crossed[:, c]) * self.hold[:, c], axis=(1, 2))
            parts.append((self.weight[t, number], rest.real))
        lags = kernel[: self.longest]
        return np.concatenate(
            [
                np.add.reduceat(
                    np.fft.irfft(own, self.size)[: self.longest] * lags
                    + np.fft.irfft(rest, self.size)[: self.longest],
                    self.starts,
                )
                for own, rest in parts
            ]
        ), scatter

    def _transform(self, values: Array) -> Spectrum:
        return np.asarray(np.fft.rfft(values, self.size, axis=0))

    def _gather(self, spectra: list[Array]) -> Array:
        """Sums of the products over groups of lags, from their spectra (f, any)."""
        lags = [np.fft.irfft(s.sum(axis=1), self.size)[: self.longest] for s in spectra]
        return np.concatenate([np.add.reduceat(products, self.starts) for products in lags])
