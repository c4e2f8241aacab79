"""Dip and azimuth of the field by accelerometer and gyro, whose own errors all rows share.

An inertial unit tells down d, and a level direction e of steady but unknown heading. Errors of its
sensors (bias of the accelerometer, bias and scale of the gyro) and of the assumed dip are few
unknowns ν, each in units of its standard deviation, that all rows have in common:

    down d + D (ν − ν₀),   azimuth of the field from e: ψ_k + A (ν − ν₀),   dip I + c ν,

where d and e were worked out with ν₀ taken out. ψ_k is free in every stretch k of time and
eliminated at once (variable projection, Golub & Pereyra 1973, with Kaufman's 1975 Jacobian).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import (
    NO_SHARE,
    AttitudeShare,
    azimuth_residual,
    correct,
    dip_residual,
)
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.residuals import MAD_TO_SD

_ROUNDS = 4  # of reweighting a stretch's azimuth
_LEAST = 1e-6  # weight, so that a stretch of outliers has an azimuth too


class Shared(NamedTuple):
    """What one standard deviation of each of q unknowns changes.

    `down_by` (n, 3, q) in the axes of the field, `azimuth_by` (n, q) rad, `dip_by` (q,) rad;
    `taken_out` (q,) is what down and the azimuth are already without.
    """

    down_by: Array
    azimuth_by: Array
    dip_by: Array
    taken_out: Array

    def subset(self, rows: Index | slice) -> Shared:
        """The same of some rows."""
        return self._replace(down_by=self.down_by[rows], azimuth_by=self.azimuth_by[rows])


class Relative(NamedTuple):
    """A level direction (n, 3) of steady unknown heading, and the number of each row's stretch."""

    ahead: Array
    stretch: Index

    def subset(self, rows: Index | slice) -> Relative:
        """The same of some rows, stretches numbered anew."""
        return Relative(self.ahead[rows], np.unique(self.stretch[rows], return_inverse=True)[1])


def compute_down(down: Array, shared: Shared, unknowns: Array) -> Array:
    """Down (n, 3) with the shared errors taken out."""
    moved = down + shared.down_by @ (unknowns - shared.taken_out)
    return np.asarray(moved / np.sqrt((moved**2).sum(axis=1, keepdims=True)))


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
    r, jacobian = dip_residual(raw, bias, matrix, true, horizontal, vertical, noise_sd, share)
    u = correct(raw, bias, matrix)
    z = (u * true).sum(axis=1)
    across = u - true * z[:, None]
    h = np.maximum(np.sqrt((across**2).sum(axis=1)), np.finfo(float).tiny)
    f = np.hypot(horizontal, vertical)
    e = true * (horizontal / f)[:, None] - across * (vertical / f / h)[:, None]
    size = np.sqrt(((e @ matrix) ** 2).sum(axis=1))
    size = f * size * (share.gain * np.hypot(h, z) / (f * size)) ** share.whole
    along = ((horizontal + vertical * z / h) / size)[:, None] * across
    by_shared = np.einsum("nb,nbq->nq", along, shared.down_by)
    by_shared -= ((horizontal * h + vertical * z) / size)[:, None] * shared.dip_by
    return r, np.concatenate([jacobian, by_shared], axis=1)


def relative_azimuth_residual(
    raw: Array,
    bias: Array,
    matrix: Array,
    down: Array,
    relative: Relative,
    shared: Shared,
    unknowns: Array,
) -> tuple[Array, Array]:
    """`affine.azimuth_residual` beside the azimuth of each stretch, and its Jacobian (n, 12 + q).

    The azimuth of a stretch is the one that its own rows agree on, outliers down-weighted.
    """
    true = compute_down(down, shared, unknowns)
    ahead = relative.ahead - true * (relative.ahead * true).sum(axis=1, keepdims=True)
    ahead /= np.sqrt((ahead**2).sum(axis=1, keepdims=True))
    aside = np.cross(true, ahead)
    u = correct(raw, bias, matrix)
    x, y, z = ((u * axis).sum(axis=1) for axis in (ahead, aside, true))
    moved = shared.azimuth_by @ (unknowns - shared.taken_out)
    found, weights = _agree(np.arctan2(y, x) - moved, x * x + y * y, relative.stretch)
    azimuth = found[relative.stretch] + moved
    sine, cosine = np.sin(azimuth)[:, None], np.cos(azimuth)[:, None]
    across = cosine * aside - sine * ahead
    r, jacobian = azimuth_residual(raw, bias, matrix, across)
    size = np.sqrt(((across @ matrix) ** 2).sum(axis=1))
    by_azimuth = -(x * cosine[:, 0] + y * sine[:, 0]) / size
    tilted = np.einsum("nb,nbq->nq", across, shared.down_by) * (-z / size)[:, None]
    by_shared = tilted + by_azimuth[:, None] * shared.azimuth_by
    full = np.concatenate([jacobian, by_shared], axis=1)
    weights = weights / np.maximum(by_azimuth**2, 1e-300)  # as the mean direction has them
    return r, _project_out(full, by_azimuth, weights, relative.stretch)


def _agree(azimuth: Array, square: Array, stretch: Index) -> tuple[Array, Array]:
    """The azimuth of each stretch, a robust mean direction, and how much each row moves it."""
    count, loss = int(stretch.max()) + 1, tukey()
    turned = np.exp(1j * azimuth)
    q = np.zeros(len(azimuth))
    for _ in range(_ROUNDS):
        weights = square * np.maximum(loss.weight(q), _LEAST)
        real, imaginary = (
            np.bincount(stretch, weights * part, count) for part in (turned.real, turned.imag)
        )
        found = np.arctan2(imaginary, real)
        off = 2 * np.sqrt(square) * np.abs(np.sin((azimuth - found[stretch]) / 2))
        scale = max(MAD_TO_SD * float(np.median(off)), 1e-12)
        q = (off / scale) ** 2
    return found, square * np.maximum(loss.curvature(q), _LEAST)


def _project_out(jacobian: Array, along: Array, weights: Array, stretch: Index) -> Array:
    """What is left of the columns when `along` (n,) is free in every stretch."""
    count = int(stretch.max()) + 1
    weighted = weights * along
    size = np.maximum(np.bincount(stretch, weighted * along, count), 1e-300)
    order = np.argsort(stretch, kind="stable")
    starts = np.searchsorted(stretch[order], np.arange(count))
    shares = np.add.reduceat((weighted[:, None] * jacobian)[order], starts, axis=0) / size[:, None]
    return np.asarray(jacobian - along[:, None] * shares[stretch])
