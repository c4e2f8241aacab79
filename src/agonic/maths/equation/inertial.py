"""Dip and azimuth of the field by accelerometer and gyro, whose own errors all rows share.

An inertial unit tells down d, and a level direction e of steady but unknown heading. Errors of its
sensors (bias of the accelerometer, bias and scale of the gyro) and of the assumed dip are few
unknowns ν, each in units of its standard deviation, that all rows have in common:

    down d + D (ν − ν₀),   azimuth of the field from e: ψ_k + A (ν − ν₀),   dip I + c ν,

where d and e were worked out with ν₀ taken out. ψ_k is free in every stretch k of time and
eliminated at once (variable projection, Golub & Pereyra 1973, with Kaufman's 1975 Jacobian).
Inside, all runs component by component, (3, n) and (q, n), for long inner loops.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import (
    NO_SHARE,
    AttitudeShare,
    azimuth_residual,
    dip_residual,
)
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import median

_REWEIGHTINGS = 4  # of a stretch's azimuth
_LEAST = 1e-6  # weight, so that a stretch of outliers has an azimuth too


class Shared(NamedTuple):
    """What one standard deviation of each of q unknowns changes.

    `down_by` (n, 3, q) in the axes of the field, `azimuth_by` (n, q) rad, `dip_by` (q,) rad;
    `taken_out` (q,) is what down and the azimuth are already without. Rows are last in memory where
    they come from `of`.
    """

    down_by: Array
    azimuth_by: Array
    dip_by: Array
    taken_out: Array

    @classmethod
    def of(cls, down_by: Array, azimuth_by: Array, dip_by: Array, taken_out: Array) -> Shared:
        """The same, laid out for residuals that run over rows."""
        turned = np.asfortranarray(down_by), np.asfortranarray(azimuth_by)
        return cls(*turned, dip_by, taken_out)

    def subset(self, rows: Index | slice) -> Shared:
        """The same of some rows."""
        return self._replace(
            down_by=self.down_by.T[..., rows].T, azimuth_by=self.azimuth_by.T[..., rows].T
        )


class Relative(NamedTuple):
    """A level direction (n, 3) of steady unknown heading, and the number of each row's stretch."""

    ahead: Array
    stretch: Index

    def subset(self, rows: Index | slice) -> Relative:
        """The same of some rows, stretches numbered anew."""
        return Relative(self.ahead[rows], np.unique(self.stretch[rows], return_inverse=True)[1])


def compute_down(down: Array, shared: Shared, unknowns: Array) -> Array:
    """Down (3, n), from (n, 3), with the shared errors taken out."""
    moved = down.T + np.tensordot(unknowns - shared.taken_out, shared.down_by.T, 1)
    return np.asarray(moved / np.sqrt(_dot(moved, moved)))


def shared_dip_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    down: Array,
    intensities: tuple[Array, Array],
    shared: Shared,
    unknowns: Array,
    noise_sd: float = 0.0,
    share: AttitudeShare = NO_SHARE,
    *,
    differentiate: bool = True,
) -> tuple[Array, Array]:
    """`affine.dip_residual` with the shared errors, and its Jacobian (n, 12 + q).

    With g = (H z − Z h)/F: ∂g/∂d = (H + Z z/h) u/F and ∂g/∂I = −(H h + Z z)/F; what they do to the
    denominator of the distance is of second order. Parameters: `intensities` (1,) or (n,) each.
    """
    dip = float(shared.dip_by @ unknowns)
    level, below = intensities
    horizontal = level * np.cos(dip) - below * np.sin(dip)
    vertical = below * np.cos(dip) + level * np.sin(dip)
    true = compute_down(down, shared, unknowns)
    r, jacobian = dip_residual(
        raw,
        bias,
        matrix,
        true.T,
        horizontal,
        vertical,
        noise_sd,
        share,
        differentiate=differentiate,
    )
    if not differentiate:
        return r, jacobian
    u = matrix @ (raw - bias).T
    z = _dot(u, true)
    across = u - true * z
    h = np.maximum(np.sqrt(_dot(across, across)), np.finfo(float).tiny)
    f = np.hypot(horizontal, vertical)
    s = matrix.T @ (true * (horizontal / f) - across * (vertical / f / h))
    size = f * np.sqrt(_dot(s, s))
    if share.whole:
        size *= (share.gain * np.hypot(h, z) / size) ** share.whole
    by_shared = _along(((horizontal + vertical * z / h) / size) * across, shared.down_by)
    by_shared -= np.multiply.outer(shared.dip_by, (horizontal * h + vertical * z) / size)
    return r, np.concatenate([jacobian.T, by_shared]).T


def relative_azimuth_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    down: Array,
    relative: Relative,
    shared: Shared,
    unknowns: Array,
    *,
    differentiate: bool = True,
) -> tuple[Array, Array]:
    """`affine.azimuth_residual` beside the azimuth of each stretch, and its Jacobian (n, 12 + q).

    The azimuth of a stretch is the one that its own rows agree on, outliers down-weighted.
    """
    true = compute_down(down, shared, unknowns)
    ahead = relative.ahead.T - true * _dot(relative.ahead.T, true)
    ahead /= np.sqrt(_dot(ahead, ahead))
    aside = _cross(true, ahead)
    u = matrix @ (raw - bias).T
    x, y = _dot(u, ahead), _dot(u, aside)
    moved = (unknowns - shared.taken_out) @ shared.azimuth_by.T
    found, weights = _agree(np.arctan2(y, x) - moved, x * x + y * y, relative.stretch)
    azimuth = found[relative.stretch] + moved
    sine, cosine = np.sin(azimuth), np.cos(azimuth)
    across = cosine * aside - sine * ahead
    r, jacobian = azimuth_residual(raw, bias, matrix, across.T, differentiate=differentiate)
    if not differentiate:
        return r, jacobian
    s = matrix.T @ across
    size = np.sqrt(_dot(s, s))
    by_azimuth = -(x * cosine + y * sine) / size
    by_shared = _along(across * (-_dot(u, true) / size), shared.down_by)
    by_shared += by_azimuth * shared.azimuth_by.T
    full = np.concatenate([jacobian.T, by_shared])
    weights = weights / np.maximum(by_azimuth**2, 1e-300)  # as the mean direction has them
    return r, _project_out(full, by_azimuth, weights, relative.stretch).T


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Array, b: Array) -> Array:
    """The cross product of vectors (3, n)."""
    return np.stack([a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))])


def _along(direction: Array, by: Array) -> Array:
    """What vectors (n, 3, q) have along directions (3, n), (q, n)."""
    return np.asarray(np.einsum("bn,nbq->qn", direction, by))


def _agree(azimuth: Array, square: Array, stretch: Index) -> tuple[Array, Array]:
    """The azimuth of each stretch, a robust mean direction, and how much each row moves it."""
    count, loss = int(stretch.max()) + 1, tukey()
    cosine, sine, size = np.cos(azimuth), np.sin(azimuth), 2 * np.sqrt(square)
    q = np.zeros(len(azimuth))
    for _ in range(_REWEIGHTINGS):
        weights = square * np.maximum(loss.weight(q), _LEAST)
        real, imaginary = (np.bincount(stretch, weights * part, count) for part in (cosine, sine))
        found = np.arctan2(imaginary, real)
        off = size * np.abs(np.sin((azimuth - found[stretch]) / 2))
        scale = max(MAD_TO_SD * median(off), 1e-12)
        q = (off / scale) ** 2
    return found, square * np.maximum(loss.curvature(q), _LEAST)


def _project_out(jacobian: Array, along: Array, weights: Array, stretch: Index) -> Array:
    """What is left of the rows (m, n) when `along` (n,) is free in every stretch."""
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    weighted = weights * along
    size = np.maximum(np.add.reduceat(weighted * along, starts), 1e-300)
    shares = np.add.reduceat(weighted * jacobian, starts, axis=1) / size
    jacobian -= along * np.repeat(shares, np.diff(starts, append=len(along)), axis=1)
    return jacobian
