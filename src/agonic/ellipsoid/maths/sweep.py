"""The sums of `block_sums`, reading by reading in one sweep over the columns, for numba."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable

import numpy as np

from agonic.arrays import Array

Kernel = Callable[..., None]

_TILE = 256  # rows whose ten columns stay in the nearest cache


def run(
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
    grown: Array,
) -> None:
    """`magnitude_residual`, its weights and the sums, tile by tile, for the compiler.

    The names are those of `magnitude_residual`; the matrix is symmetric.
    """
    bx, by, bz, wxx, wyy, wzz, wxy, wxz, wyz = params
    square = wxx * wxx + wyy * wyy + wzz * wzz + 2 * (wxy * wxy + wxz * wxz + wyz * wyz)
    scale, half = factor / size, sd * sd / 2
    cx, cy, cz = centre[0] / size + bx, centre[1] / size + by, centre[2] / size + bz
    j, weighted = np.empty((9, _TILE)), np.empty((9, _TILE))
    pulls, bends, growing = np.empty(_TILE), np.empty(_TILE), np.empty(_TILE)
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
            growing[i] = -(r + half * bend * g) / sd
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
            total = gain = 0.0
            for i in range(n):
                weighted[a, i] = j[a, i] * bends[i]
                total += j[a, i] * pulls[i]
                gain += weighted[a, i] * growing[i]
            score[a] += total
            grown[a] += gain
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
def compile_sweep() -> Kernel | None:
    """`run` compiled by numba, or `None` without it."""
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
        kernel = numba.njit(cache=True, **options)(run)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(**options)(run)
    return kernel
