"""Compass deviation as a function of the compass heading: terms, eight-heading formulas, inverse.

    δ(ψ) = A + B sin ψ + C cos ψ + D sin 2ψ + E cos 2ψ
           + (roll_cos cos ψ + roll_sin sin ψ) roll + (pitch_cos cos ψ + pitch_sin sin ψ) pitch

ψ is what the compass reads and magnetic = ψ + δ(ψ), everything in degrees, east positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import cauchy
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise, robust_scale
from agonic.maths.rotations.angles import wrap_deg

LEVEL = ("A", "B", "C", "D", "E")
HEEL = ("roll_cos", "roll_sin", "pitch_cos", "pitch_sin")
ROSE_DEG = 45.0 * np.arange(8)
"""North, north-east, … north-west: the headings of a classical swing."""
TURN_DEG = 360.0


def wrap_360_deg(angle_deg: ArrayLike) -> Array:
    """An angle from 0 to 360, 360 left out even after rounding."""
    turned = np.asarray(angle_deg, dtype=np.float64) % 360.0
    return np.where(turned < 360.0, turned, 0.0)


def basis(compass_deg: ArrayLike, roll_deg: ArrayLike = 0.0, pitch_deg: ArrayLike = 0.0) -> Array:
    """What each coefficient is multiplied with, (…, 9) in the order `LEVEL`, `HEEL`."""
    psi, roll, pitch = np.broadcast_arrays(np.radians(compass_deg), roll_deg, pitch_deg)
    s, c = np.sin(psi), np.cos(psi)
    return np.stack(
        [np.ones_like(s), s, c, 2 * s * c, c * c - s * s, roll * c, roll * s, pitch * c, pitch * s],
        axis=-1,
    )


def slope(
    coefficients: Array, compass_deg: Array, roll_deg: ArrayLike, pitch_deg: ArrayLike
) -> Array:
    """dδ/dψ, degrees per degree: how fast the deviation changes with the compass heading."""
    _, b, c, d, e, rc, rs, pc, ps = coefficients
    psi = np.radians(compass_deg)
    along = c + rc * np.asarray(roll_deg) + pc * np.asarray(pitch_deg)
    across = b + rs * np.asarray(roll_deg) + ps * np.asarray(pitch_deg)
    turned = across * np.cos(psi) - along * np.sin(psi)
    return np.asarray(np.radians(turned + 2 * (d * np.cos(2 * psi) - e * np.sin(2 * psi))))


def compute_band(rows: Array, covariance: Array) -> Array:
    """Standard error of the curve at rows of `basis`, √(xᵀ C x)."""
    variance = np.einsum("...i,ij,...j->...", rows, covariance, rows)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def steer(
    coefficients: Array, magnetic_deg: ArrayLike, roll_deg: ArrayLike, pitch_deg: ArrayLike
) -> Array:
    """The compass heading ψ with ψ + δ(ψ) = magnetic, 0…360, by Newton steps kept in a bracket.

    The bracket is the magnetic heading plus and minus the largest deviation there can be, so a
    solution is always found; it is the only one where dδ/dψ > −1.
    """
    wanted, roll, pitch = (
        np.asarray(a, dtype=np.float64)
        for a in np.broadcast_arrays(magnetic_deg, roll_deg, pitch_deg)
    )
    constant, swing = float(coefficients[0]), np.abs(coefficients)
    reach = swing[1:5].sum() + (swing[5] + swing[6]) * np.abs(roll)
    reach = reach + (swing[7] + swing[8]) * np.abs(pitch)
    low, high = wanted - constant - reach, wanted - constant + reach
    psi = wanted - constant
    for _ in range(60):
        excess = psi + basis(psi, roll, pitch) @ coefficients - wanted
        if not np.any(np.abs(excess) > 1e-10):
            break
        low, high = np.where(excess < 0, psi, low), np.where(excess > 0, psi, high)
        gain = 1 + slope(coefficients, psi, roll, pitch)
        newton = psi - excess / np.where(np.abs(gain) > 1e-3, gain, 1.0)
        psi = np.where((low < newton) & (newton < high), newton, (low + high) / 2)
    return wrap_360_deg(psi)


def average_on_rose(
    compass_deg: Array, deviation_deg: Array, within_deg: float = 2.5
) -> Array | None:
    """Mean deviation at each of the eight headings, (8,); `None` where one was not steered."""
    near = np.abs(wrap_deg(compass_deg[:, None] - ROSE_DEG)) <= within_deg
    if not near.any(axis=0).all():
        return None
    first = deviation_deg[0]  # differences from one of them cannot wrap where the mean would
    mean = (near * wrap_deg(deviation_deg - first)[:, None]).sum(axis=0) / near.sum(axis=0)
    return wrap_deg(first + mean)


def solve_eight_headings(deviation_deg: Array) -> Array:
    """A, B, C, D, E by the eight-heading formulas, from deviations at `ROSE_DEG`, (8,).

    A is the mean; B, C half the difference of opposite headings on the axes; D, E a quarter of
    the difference of opposite pairs (Handbook of Magnetic Compass Adjustment, chapter V)."""
    n, ne, e, se, s, sw, w, nw = deviation_deg
    return np.array(
        [
            deviation_deg.mean(),
            (e - w) / 2,
            (n - s) / 2,
            ((ne + sw) - (se + nw)) / 4,
            ((n + s) - (e + w)) / 4,
        ]
    )


class DeviationSolution(NamedTuple):
    """Coefficients of the chosen columns with what the solver saw.

    `covariance` (k, k) deg²; `residuals` (n,) measured less modelled, deg; `weights` (n,) 0…1;
    `noise` their standard deviation, deg; `correlation` the correlation length, in readings.
    """

    params: Array
    covariance: Array
    residuals: Array
    weights: Array
    noise: float
    correlation: float
    condition: float


def solve(
    rows: Array, difference_deg: Array, *, robust: bool, noise_deg: float | None = None
) -> DeviationSolution:
    """Least squares on wrapped differences reference − compass, in the order they were taken.

    `rows` (n, k) are the chosen columns of `basis`, the first of them ones. `robust` brings in
    Tukey's loss where a reading stands out. The covariance is that of the residuals' own noise, or
    of `noise_deg` where it is given. No coefficient is thought to be much beyond a full turn: a
    prior that is felt only where the headings leave a term open.
    """

    def pieces(params: Array) -> list[tuple[Array, Array]]:
        return [(wrap_deg(rows @ params - difference_deg), rows)]

    def prior(params: Array) -> tuple[Array, Array]:
        return params / TURN_DEG, np.eye(len(params)) / TURN_DEG

    params = np.zeros(rows.shape[1])
    params[0] = circular_mean_deg(difference_deg)
    if robust:
        for _ in range(5):  # towards where gross errors do not reach
            scale = max(robust_scale(pieces(params)[0][0], len(params)), 1e-6)
            params = leastsq.solve(pieces, params, scale=scale, loss=cauchy(), prior=prior).params
    else:
        params = leastsq.solve(pieces, params, scale=1.0, prior=prior, tolerance=1e-9).params
    noise = estimate_noise(pieces(params)[0][0], robust, len(params))
    for _ in range(8):
        assumed = noise
        solution = leastsq.solve(
            pieces,
            params,
            scale=assumed.sd,
            loss=assumed.loss,
            correlation=assumed.correlation,
            prior=prior,
            tolerance=1e-6,
        )
        params = solution.params
        noise = estimate_noise(solution.residuals, robust, len(params))
        if noise.settled(assumed):
            break
    return _restate_noise(solution, assumed, noise_deg)


def _restate_noise(
    solution: leastsq.Solution, noise: Noise, noise_deg: float | None
) -> DeviationSolution:
    """The solution with the covariance that the residuals or the stated noise give it."""
    covariance = solution.covariance
    if noise_deg is not None:
        prior = np.eye(len(solution.params)) / TURN_DEG**2
        covariance = leastsq.inverse(solution.information * (noise.sd / noise_deg) ** 2 + prior)
    weights = noise.loss.weight((solution.residuals / noise.sd) ** 2)
    covariance = covariance * _slow(len(weights), len(solution.params), noise.correlation)
    return DeviationSolution(
        solution.params,
        covariance,
        -solution.residuals,
        weights,
        noise.sd,
        noise.correlation,
        solution.condition,
    )


def _slow(n: int, k: int, correlation: float) -> float:
    """How much larger variances are because k terms also follow correlated noise; 1 for white.

    With m = n/correlation independent readings the residuals are too small by (m − k)/m, and so is
    the correlation that they show.
    """
    m = n / correlation
    return float((m / max(m - k, 1.0) * max(n - k, 1) / n) ** 2) if correlation > 1.0 else 1.0


def circular_mean_deg(angle_deg: Array) -> float:
    """The circular mean of angles."""
    turns = np.exp(1j * np.radians(angle_deg))
    return float(np.degrees(np.angle(turns.mean())))
