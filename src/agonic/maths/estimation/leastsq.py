"""Least squares: robust (Huber, Tukey) Levenberg–Marquardt on normal equations, piece by piece.

The model is a function from parameters to pieces (residuals, Jacobian). Only the sums are kept, so
data in memory, out of core and on several workers take the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.loss import Loss, squares

Pieces = Callable[[Array], Iterable[tuple[Array, ...]]]
"""From parameters to residuals (n,) and Jacobians (n, m); or few columns (n, l) and what makes them
the Jacobian, (l, m)."""
Prior = Callable[[Array], tuple[Array, Array]]

_TINY = float(np.finfo(float).tiny)


class Normal(NamedTuple):
    """What one pass over the pieces adds up, in units of the noise."""

    cost: float  # Σ ρ(z)
    gradient: Array  # Σ ρ'(z) J
    information: Array  # Σ w(z) JᵀJ
    weight: float  # Σ w(z)
    curvature: float  # Σ ρ''(z)
    scatter: float  # Σ ρ'(z)²
    residuals: Array  # all residuals, in their own units; none where they were not kept
    total: int  # how many there were

    @property
    def curved(self) -> float:
        """Σρ''/Σw, by which the cost curves less than the weights alone would have it; where nearly
        all readings are outliers it says nothing, and it must stay positive."""
        return max(self.curvature / max(self.weight, 1e-300), 0.1)


class Channel(NamedTuple):
    """Residuals of one kind: their standard deviation, loss, and the correlation length.

    `spread` is by how much more the gradient scatters than that supposes: it joins the covariance
    only. Without `keep` the residuals themselves are not kept: for more than memory holds.
    """

    pieces: Pieces
    scale: float
    loss: Loss
    correlation: float = 1.0
    keep: bool = True
    spread: float = 1.0


class Solution(NamedTuple):
    """The minimum: parameters, covariance, and what the solver saw on the way.

    `residuals` are those of all channels, one channel after the other.

    `information` is that of the readings alone, prior left out, in units of the parameters, and
    `condition` its condition number when scaled to a unit diagonal.
    """

    params: Array
    covariance: Array
    residuals: Array
    cost: float
    information: Array
    condition: float
    iterations: int
    converged: bool


def accumulate(
    pieces: Pieces, params: Array, loss: Loss, scale: float, keep: bool = True
) -> Normal:
    """One pass over the pieces: cost, gradient and information, and the sums of the loss."""
    m = len(params)
    sums, count = np.zeros(4), 0  # Σ ρ, Σ w, Σ ρ'', Σ ρ'²
    gradient, information, kept = np.zeros(m), np.zeros((m, m)), [np.empty(0)]
    for residuals, jacobian, *onto in pieces(params):
        z, n = residuals / scale, len(residuals)
        q, side = z * z, jacobian.T
        if loss is squares():  # all weights are one
            sums += (total := float(q.sum())) / 2, n, n, total
        else:
            w = loss.weight(q)
            sums += loss.value(q).sum(), w.sum(), loss.curvature(q).sum(), w * w @ q
            root = np.sqrt(w)
            z, side = z * root, side * root
        slope, square = side @ z, side @ side.T  # of a matrix by itself BLAS does one half
        for by in onto:
            slope, square = slope @ by, by.T @ square @ by
        gradient += slope
        information += square
        count += n
        if keep:
            kept.append(residuals)
    cost, weight, curvature, scatter = sums.tolist()
    return Normal(
        cost,
        gradient / scale,
        information / scale**2,
        weight,
        curvature,
        scatter,
        np.concatenate(kept),
        count,
    )


def solve(
    pieces: Pieces,
    start: Array,
    *,
    scale: float,
    loss: Loss | None = None,
    prior: Prior | None = None,
    correlation: float = 1.0,
    tolerance: float = 1e-3,
    max_iterations: int = 60,
) -> Solution:
    """`solve_together` for residuals of one kind.

    Parameters: `pieces(params)` yields residuals (n,) and Jacobians (n, m); `start` (m,); `scale`
    standard deviation of one residual; `prior(params)` gives residuals and Jacobian in units of
    their own standard deviation; `correlation` the correlation length, in residuals. It stops when
    the next step is below `tolerance` standard errors of the result.
    """
    channel = Channel(pieces, scale, loss or squares(), correlation)
    return solve_together(
        [channel], start, prior=prior, tolerance=tolerance, max_iterations=max_iterations
    )


def solve_together(
    channels: Sequence[Channel],
    start: Array,
    *,
    prior: Prior | None = None,
    tolerance: float = 1e-3,
    max_iterations: int = 60,
    move: Callable[[Array, Array], Array] = np.add,
) -> Solution:
    """The minimum that `minimise` finds, and how sure it is.

    The covariance is Huber's (1981) sandwich A⁻¹BA⁻¹; each channel gives A its curvature of the
    loss D = Σρ''/Σw · ΣwJᵀJ and B the scatter of its gradient, k D = Σρ'²/Σw · ΣwJᵀJ; the prior
    joins both as one more observation.
    """
    params, sums, iterations, converged = minimise(
        channels,
        start,
        prior=prior,
        tolerance=tolerance,
        max_iterations=max_iterations,
        move=move,
    )
    covariance, data = find_covariance(
        sums, [of.correlation for of in channels], [of.spread for of in channels]
    )
    return Solution(
        params,
        covariance,
        np.concatenate([normal.residuals for normal in sums.normals]),
        sums.cost,
        data,
        float(condition(data)),
        iterations,
        converged,
    )


class Sums(NamedTuple):
    """Channels and prior together at some parameters."""

    normals: list[Normal]
    cost: float
    gradient: Array
    information: Array
    known: Array  # the prior's part of the information


class Minimum(NamedTuple):
    """Parameters, the sums there, and how they were reached."""

    params: Array
    sums: Sums
    iterations: int
    converged: bool


def minimise(
    channels: Sequence[Channel],
    start: Array,
    *,
    prior: Prior | None = None,
    tolerance: float = 1e-3,
    max_iterations: int = 60,
    move: Callable[[Array, Array], Array] = np.add,
) -> Minimum:
    """Minimise Σ_c Σ ρ_c(r/scale_c)/correlation_c + |prior residuals|²/2 by Levenberg–Marquardt.

    `move(params, step)` are the parameters a step away, where that is not their sum.
    """
    params, damping = np.array(start, dtype=np.float64), 1e-6
    sums = _sums(channels, params, prior)
    converged, iterations = False, 0
    before: _Step | None = None
    while iterations < max_iterations and not converged:
        plain = _step(sums.information, sums.gradient, damping)
        square = float(plain @ sums.information @ plain)
        if square < tolerance**2:
            converged = True
            break
        iterations += 1
        shrinks = before is not None and square < min(before.square, 1.0)
        step = _mix(plain, before, sums.information) if before is not None and shrinks else plain
        there = move(params, step)
        trial = _sums(channels, there, prior)
        if np.isfinite(trial.cost) and trial.cost <= sums.cost:
            params, sums, before = there, trial, _Step(plain, step, square)
            damping = max(damping / 10, 1e-12)
        elif shrinks:
            before = None  # the plain step is left
        else:
            damping = max(damping * 10, 1e-4)
            converged = damping > 1e10
    return Minimum(params, sums, iterations, converged)


class _Step(NamedTuple):
    """A step of Gauss and Newton, what was taken of it, and its square in standard errors."""

    plain: Array
    taken: Array
    square: float


def _mix(step: Array, before: _Step, metric: Array) -> Array:
    """A step mixed with the one before, so that steps which shrink by a constant factor, as where
    outliers tell most of a direction, end at once (D. G. Anderson 1965, J. ACM 12, 547)."""
    apart = step - before.plain
    by = metric @ apart
    return step - float(step @ by) / max(float(apart @ by), _TINY) * (before.taken + apart)


def _sums(channels: Sequence[Channel], params: Array, prior: Prior | None) -> Sums:
    normals = [accumulate(of.pieces, params, of.loss, of.scale, of.keep) for of in channels]
    return join(normals, [of.correlation for of in channels], params, prior)


def join(
    normals: Sequence[Normal], correlations: Sequence[float], params: Array, prior: Prior | None
) -> Sums:
    """What the passes over all channels added up at these parameters, joined with the prior."""
    m = len(params)
    cost, gradient, known = 0.0, np.zeros(m), np.zeros((m, m))
    if prior is not None:
        residuals, jacobian = prior(params)
        cost, gradient = float(residuals @ residuals) / 2, residuals @ jacobian
        known = jacobian.T @ jacobian
    information = known.copy()
    for normal, correlation in zip(normals, correlations, strict=True):
        cost += normal.cost / correlation
        gradient = gradient + normal.gradient / correlation
        information += normal.information * (normal.curved / correlation)
    return Sums(list(normals), cost, gradient, information, known)


def _step(information: Array, gradient: Array, damping: float) -> Array:
    """The damped Gauss–Newton step, scaled so that units do not matter."""
    size = np.sqrt(np.maximum(information.diagonal(), _TINY))
    scaled = information / (size[:, None] * size)
    scaled.flat[:: len(size) + 1] += damping + 1e-13
    from scipy.linalg.lapack import dposv  # here, so that what only reads a log loads no SciPy

    _, step, failed = dposv(scaled, -gradient / size)
    if failed:
        raise np.linalg.LinAlgError("the information is not positive definite")
    return np.asarray(step / size)


def find_covariance(
    sums: Sums,
    correlations: Sequence[float],
    spreads: Sequence[float],
    scattered: Array | None = None,
) -> tuple[Array, Array]:
    """A⁻¹BA⁻¹ and ΣD in the units of the parameters, A = ΣD + H, B = ΣkD + H, prior H.

    With the smallest k taken out, B = kA + Σ(k_c − k)D_c + (1 − k)H, the variances stay positive
    where A is all but singular. A scatter (m, m) of the gradient that was measured takes the place
    of ΣkD.
    """
    parts, scatters = [], []
    for normal, correlation, spread in zip(sums.normals, correlations, spreads, strict=True):
        n, m = normal.total, len(sums.known)
        freedom = n / max(n - m, 1)
        parts.append(normal.information * (normal.curved / correlation))
        known = normal.weight > 0
        seen = normal.scatter / normal.weight / normal.curved if known else 1.0
        scatters.append(freedom * seen * spread if known else 1.0)
    data, least = np.sum(parts, axis=0), min(scatters)
    bread = inverse(data + sums.known)
    rest = (1 - least) * sums.known
    if scattered is not None:
        rest = rest + scattered - least * data
    else:
        for part, k in zip(parts, scatters, strict=True):
            rest = rest + (k - least) * part
    covariance = least * bread + bread @ rest @ bread
    return (covariance + covariance.T) / 2, data


def inverse(information: Array) -> Array:
    """The inverse of information matrices; directions without information get a huge variance."""
    size = np.sqrt(np.maximum(np.abs(np.diagonal(information, axis1=-2, axis2=-1)), 1e-100))
    outer = size[..., :, None] * size[..., None, :]
    values, vectors = np.linalg.eigh(information / outer)
    values = np.maximum(values, 1e-15 * np.maximum(values[..., -1:], 1.0))
    return np.asarray((vectors / values[..., None, :]) @ np.swapaxes(vectors, -1, -2) / outer)


def condition(information: Array) -> Array:
    """Condition number of information matrices scaled to a unit diagonal."""
    size = np.sqrt(np.maximum(np.abs(np.diagonal(information, axis1=-2, axis2=-1)), 1e-100))
    values = np.linalg.eigvalsh(information / (size[..., :, None] * size[..., None, :]))
    largest = np.maximum(values[..., -1], 1.0)
    return np.asarray(largest / np.maximum(values[..., 0], np.finfo(float).eps * largest))
