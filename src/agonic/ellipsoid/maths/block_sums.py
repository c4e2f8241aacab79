"""The sums of one pass of a magnitude fit over readings that are not kept.

What `leastsq.accumulate` adds up over the blocks of `equation.channels`, for the full model, in
one sweep over the columns; the other models are linear in it (`reduced`). Where numba is installed
the sweep is compiled and lets other threads run; without it NumPy does the same by blocks.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import Loss, squares, tukey

Columns = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
Kernel = Callable[..., None]

TUKEY = 6.0
"""The reach of `tukey`, in standard deviations."""

_ROWS = 4096
_TILE = 256  # rows whose ten columns stay in the nearest cache
_BASIS = model_basis("full")


class Frame(NamedTuple):
    """point = (factor · reading − centre)/size, of magnitude one as in `equation.channels`."""

    centre: Array
    size: float
    factor: float = 1.0


class Assumed(NamedTuple):
    """The noise that a pass assumes: standard deviation of a residual, and whether Tukey's loss
    meets those that stand out."""

    sd: float
    robust: bool

    @property
    def loss(self) -> Loss:
        """The loss."""
        return tukey(TUKEY) if self.robust else squares()


class Sums(NamedTuple):
    """What a pass adds up, in units of the noise: `facts` holds Σρ, Σw, Σρ'', Σw²z², Σwz², the
    number of readings, how many of them weigh nothing, and the largest |z|; `curved` Σ ρ'' J Jᵀ, by
    which Newton's step goes; `score` (k, 9) Σ w z J of each of k stretches."""

    facts: Array
    curved: Array
    score: Array

    @classmethod
    def empty(cls, stretches: int) -> Sums:
        """Nothing added up yet."""
        return cls(np.zeros(8), np.zeros((9, 9)), np.zeros((stretches, 9)))

    def normal(self, sd: float, reduction: Array) -> leastsq.Normal:
        """The same as the solver takes it, for the model that a reduction (9, m) makes."""
        cost, weight, curvature, scatter, _, total, _, _ = self.facts.tolist()
        information = reduction.T @ self.curved @ reduction * (weight / curvature / sd**2)
        return leastsq.Normal(
            cost,
            self.score.sum(axis=0) @ reduction / sd,
            information,
            weight,
            curvature,
            scatter,
            np.empty(0),
            round(total),
        )


def reduction(model: str) -> Array:
    """The map (9, m) from a model's parameters to those of the full one.

    >>> reduction("sphere")[3:, 3].tolist()
    [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    """
    return np.asarray(np.linalg.lstsq(_BASIS, model_basis(model), rcond=None)[0].round(12))


def add(
    sums: Sums,
    stretch: int,
    columns: Columns,
    frame: Frame,
    params: Array,
    noise: Assumed,
    *,
    compiled: bool = True,
) -> None:
    """Add readings that belong to one stretch.

    Parameters: columns x, y, z (n,) of readings; params (9,) of the full model, and noise, both of
    the points; compiled asks for numba, used where it is installed.
    """
    sweep = (_compiled() if compiled else None) or _by_blocks
    sweep(
        *columns,
        frame.factor,
        frame.centre,
        frame.size,
        params,
        noise.sd,
        TUKEY if noise.robust else 0.0,
        sums.facts,
        sums.curved,
        sums.score[stretch],
    )


def _by_blocks(
    x: Array,
    y: Array,
    z: Array,
    factor: float,
    centre: Array,
    size: float,
    params: Array,
    sd: float,
    reach: float,
    facts: Array,
    curved: Array,
    score: Array,
) -> None:
    bias, matrix = split(_BASIS @ params)
    loss = tukey(reach) if reach else squares()

    def pieces(_: Array) -> object:
        for start in range(0, len(x), _ROWS):
            rows = slice(start, start + _ROWS)
            points = np.stack([x[rows], y[rows], z[rows]]).T * factor
            r, jacobian = magnitude_residual((points - centre) / size, bias, matrix, 1.0, sd)
            q = (r / sd) ** 2
            weights = loss.weight(q)
            facts[4] += float(weights @ q)
            facts[6] += np.count_nonzero(weights == 0.0)
            facts[7] = max(facts[7], float(np.sqrt(q.max(initial=0.0))))
            full = jacobian @ _BASIS
            curved[...] += (full * loss.curvature(q)[:, None]).T @ full
            yield r, full

    normal = leastsq.accumulate(pieces, params, loss, sd, keep=False)  # type: ignore[arg-type]
    facts[[0, 1, 2, 3, 5]] += (
        normal.cost,
        normal.weight,
        normal.curvature,
        normal.scatter,
        normal.total,
    )
    score += normal.gradient * sd


def _sweep(
    x: Array,
    y: Array,
    z: Array,
    factor: float,
    centre: Array,
    size: float,
    params: Array,
    sd: float,
    reach: float,
    facts: Array,
    curved: Array,
    score: Array,
) -> None:
    """`magnitude_residual`, its weights and the sums, tile by tile, for the compiler.

    The names are those of `magnitude_residual`; the matrix is symmetric.
    """
    bx, by, bz, wxx, wyy, wzz, wxy, wxz, wyz = params
    square = wxx * wxx + wyy * wyy + wzz * wzz + 2 * (wxy * wxy + wxz * wxz + wyz * wyz)
    scale, half = factor / size, sd * sd / 2
    cx, cy, cz = centre[0] / size + bx, centre[1] / size + by, centre[2] / size + bz
    j, weighted = np.empty((9, _TILE)), np.empty((9, _TILE))
    pulls, bends = np.empty(_TILE), np.empty(_TILE)
    outer = 1.0 / (reach * reach) if reach > 0 else 0.0
    cost = weight = curvature = scatter = power = outliers = largest = 0.0
    for start in range(0, len(x), _TILE):
        n = min(_TILE, len(x) - start)
        for i in range(n):
            dx = x[start + i] * scale - cx
            dy = y[start + i] * scale - cy
            dz = z[start + i] * scale - cz
            ux = wxx * dx + wxy * dy + wxz * dz
            uy = wxy * dx + wyy * dy + wyz * dz
            uz = wxz * dx + wyz * dy + wzz * dz
            f = np.sqrt(ux * ux + uy * uy + uz * uz)
            inverse = 1.0 / f
            ex, ey, ez = ux * inverse, uy * inverse, uz * inverse
            sx = wxx * ex + wxy * ey + wxz * ez
            sy = wxy * ex + wyy * ey + wyz * ez
            sz = wxz * ex + wyz * ey + wzz * ez
            s2 = sx * sx + sy * sy + sz * sz
            g = 1.0 / np.sqrt(s2)
            nx, ny, nz = sx * g, sy * g, sz * g
            tx = wxx * nx + wxy * ny + wxz * nz
            ty = wxy * nx + wyy * ny + wyz * nz
            tz = wxz * nx + wyz * ny + wzz * nz
            along = ex * tx + ey * ty + ez * tz
            px, py, pz = (
                (tx - ex * along) * inverse,
                (ty - ey * along) * inverse,
                (tz - ez * along) * inverse,
            )
            r = (f - 1.0) * g
            ax, ay, az = (ex - px * r) * g, (ey - py * r) * g, (ez - pz * r) * g
            t = r * g
            hx, hy, hz = ex * t, ey * t, ez * t
            j[0, i] = -(wxx * ax + wxy * ay + wxz * az)
            j[1, i] = -(wxy * ax + wyy * ay + wyz * az)
            j[2, i] = -(wxz * ax + wyz * ay + wzz * az)
            j[3, i] = ax * dx - hx * nx
            j[4, i] = ay * dy - hy * ny
            j[5, i] = az * dz - hz * nz
            j[6, i] = ax * dy + ay * dx - hx * ny - hy * nx
            j[7, i] = ax * dz + az * dx - hx * nz - hz * nx
            j[8, i] = ay * dz + az * dy - hy * nz - hz * ny
            bend = (square - s2) * inverse - 4.0 * (tx * px + ty * py + tz * pz)
            pulls[i] = (r - half * bend * g) / sd
        for i in range(n):
            q = pulls[i] * pulls[i]
            left = max(1.0 - q * outer, 0.0)
            w = left * left
            pulls[i] *= w
            weight += w
            scatter += w * w * q
            power += w * q
            if reach > 0:
                cost += (1.0 - left * left * left) / (6.0 * outer)
                bends[i] = left * (1.0 - 5.0 * q * outer)
            else:
                cost += q / 2
                bends[i] = 1.0
            curvature += bends[i]
            outliers += w == 0.0
            largest = max(largest, q)
        for a in range(9):
            total = 0.0
            for i in range(n):
                weighted[a, i] = j[a, i] * bends[i]
                total += j[a, i] * pulls[i]
            score[a] += total
            for b in range(a + 1):
                product = 0.0
                for i in range(n):
                    product += weighted[a, i] * j[b, i]
                curved[a, b] += product
                if b < a:
                    curved[b, a] += product
    facts[0] += cost
    facts[1] += weight
    facts[2] += curvature
    facts[3] += scatter
    facts[4] += power
    facts[5] += len(x)
    facts[6] += outliers
    facts[7] = max(facts[7], np.sqrt(largest))


@functools.cache
def _compiled() -> Kernel | None:
    """`_sweep` compiled by numba, or `None` without it."""
    try:
        numba = importlib.import_module("numba")
    except ImportError:
        return None
    # sums may be taken in any order, so that they go several at a time; NaN stays NaN
    options = {
        "nogil": True,
        "fastmath": {"reassoc", "contract", "nsz", "arcp"},
        "error_model": "numpy",
    }
    kernel: Kernel
    try:
        kernel = numba.njit(cache=True, **options)(_sweep)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(**options)(_sweep)
    return kernel
