"""The Kalman filter of `kalman` in UD factors, one source for lists and for numba.

Python is faster on lists than NumPy on arrays this small. Every function works in place; `columns`
has the columns of U, `room` is a place for ten numbers.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from math import exp, sqrt
from pathlib import Path
from typing import Any, cast

MEMORY_ROWS = 50
"""Readings over which innovations are gathered to see a jump."""
CLIPPED_SQUARE = 0.97756
"""Mean square of a standard normal number clipped at 2.5."""
SCALE, TIME, USUAL, WATCHED = 9, 10, 11, 12
"""Places in `watch`, after nine sums of the jump test, and how many there are: mean square of the
clipped innovations, time of the last reading, and what the jump test usually comes to."""
SEEN = 14
"""Numbers that are kept of each reading: residual, sd, used, clipped innovation, Jacobian."""

CLIP = 2.5
"""Standard deviations: what one innovation may say for a jump."""
SCALE_ROWS = 1000.0
"""Readings over which the size of innovations is averaged."""
FREEDOM = 3.0
"""Mean of the jump test where nothing jumps."""


def run(
    rows: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    watch: Any,
    model: tuple[float, ...],
    about: Any,
    linearised: bool,
    seen: Any,
    room: Any,
) -> tuple[int, bool]:
    """`advance` in place, on lists or arrays; gives the rows done and whether a jump was seen.

    `seen` takes a line a row; `room` is three lines of ten numbers to work in.
    """
    noise, _, _, _, _, gate, level, jump_sd = model
    h, f, gain = room[0], room[1], room[2]
    m = len(diagonal)
    for done in range(len(rows)):
        row, out = rows[done], seen[done]
        pass_time(row[0] - watch[TIME], model, x, columns, diagonal, f)
        watch[TIME] = row[0]
        r, steepness = _residual(about if linearised else x, row, noise, h, m)
        if linearised:
            for i in range(m):
                r += h[i] * (x[i] - about[i])
        variance = predict(h, noise, columns, diagonal, f)
        sd = sqrt(variance)
        z = -r / sd
        used = row[5] > 0.0 and z * z <= gate * gate * max(1.0, watch[SCALE])
        out[0], out[1], out[2] = r * steepness, sd * steepness, 1.0 if used else 0.0
        clipped = min(max(z, -CLIP), CLIP)
        out[3] = clipped
        for i in range(m):
            out[4 + i] = h[i] / sd
        if used:
            absorb(noise, columns, diagonal, f, gain)
            for i in range(m):
                x[i] -= gain[i] * r
        if level > 0.0 and row[5] > 0.0:
            watch[SCALE] += (clipped * clipped - watch[SCALE]) / SCALE_ROWS
            shown = _watch_for_jump(out, watch, jump_sd)
            if shown > level * max(1.0, watch[SCALE]) * max(1.0, watch[USUAL]):
                return done + 1, True
            watch[USUAL] += (min(shown, level) / FREEDOM - watch[USUAL]) / SCALE_ROWS
    return len(rows), False


def _residual(x: Any, row: Any, noise: float, h: Any, m: int) -> tuple[float, float]:
    """r and its Jacobian by the first m numbers (into h), and |s|; see `magnitude_residual`."""
    xx, yy, zz, xy, xz, yz = x[4], x[5], x[6], x[7], x[8], x[9]
    dx, dy, dz = row[1] - x[1], row[2] - x[2], row[3] - x[3]
    ux, uy, uz = (
        xx * dx + xy * dy + xz * dz,
        xy * dx + yy * dy + yz * dz,
        xz * dx + yz * dy + zz * dz,
    )
    size = max(sqrt(ux * ux + uy * uy + uz * uz), 1e-300)
    ex, ey, ez = ux / size, uy / size, uz / size
    sx, sy, sz = (
        xx * ex + xy * ey + xz * ez,
        xy * ex + yy * ey + yz * ez,
        xz * ex + yz * ey + zz * ez,
    )
    square = sx * sx + sy * sy + sz * sz
    steep = max(sqrt(square), 1e-300)
    nx, ny, nz = sx / steep, sy / steep, sz / steep
    tx, ty, tz = (
        xx * nx + xy * ny + xz * nz,
        xy * nx + yy * ny + yz * nz,
        xz * nx + yz * ny + zz * nz,
    )
    along = ex * tx + ey * ty + ez * tz
    px, py, pz = (tx - ex * along) / size, (ty - ey * along) / size, (tz - ez * along) / size
    r = (size - row[4] - x[0]) / steep
    ax, ay, az = (ex - px * r) / steep, (ey - py * r) / steep, (ez - pz * r) / steep
    h[0] = -1.0 / steep
    h[1] = -(xx * ax + xy * ay + xz * az)
    h[2] = -(xy * ax + yy * ay + yz * az)
    h[3] = -(xz * ax + yz * ay + zz * az)
    if m > 4:
        q = r / steep
        ex, ey, ez = ex * q, ey * q, ez * q
        h[4] = ax * dx - ex * nx
        h[5] = ay * dy - ey * ny
        h[6] = az * dz - ez * nz
        h[7] = ax * dy + ay * dx - ex * ny - ey * nx
        h[8] = ax * dz + az * dx - ex * nz - ez * nx
        h[9] = ay * dz + az * dy - ey * nz - ez * ny
    whole = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)
    bend = (whole - square) / size - 4.0 * (tx * px + ty * py + tz * pz)
    return r - noise * noise * 0.5 * bend / steep, steep


def pass_time(elapsed: float, model: Any, x: Any, columns: Any, diagonal: Any, room: Any) -> None:
    """What `elapsed` seconds do: g decays and is stirred, bias and matrix walk."""
    external, external_time, walk, matrix_walk = model[1], model[2], model[3], model[4]
    m = len(diagonal)
    if external > 0.0:
        decay = exp(-elapsed / external_time)
        x[0] *= decay
        for j in range(1, m):
            columns[j][0] *= decay
        decay *= decay
        diagonal[0] = decay * diagonal[0] + (1.0 - decay) * external * external
    if walk > 0.0:
        for i in range(1, 4):
            add_variance(i, walk * walk * elapsed, columns, diagonal, room)
    if matrix_walk > 0.0:
        for i in range(4, m):
            add_variance(i, matrix_walk * matrix_walk * elapsed, columns, diagonal, room)


def add_variance(i: int, variance: float, columns: Any, diagonal: Any, a: Any) -> None:
    """A variance added to number i of the state (Agee and Turner 1972); `a` is room for ten."""
    for j in range(i):
        a[j] = 0.0
    a[i] = 1.0
    for k in range(i, -1, -1):
        known, part = diagonal[k], a[k]
        total = known + variance * part * part
        if total > 0.0:
            diagonal[k] = total
            share = variance * part / total
            column = columns[k]
            for j in range(k):
                entry = column[j]
                rest = a[j] - part * entry
                a[j], column[j] = rest, entry + share * rest
            variance *= known / total


def predict(h: Any, noise: float, columns: Any, diagonal: Any, f: Any) -> float:
    """The variance of a residual, h P hᵀ + noise², and f = Uᵀ h."""
    variance = noise * noise
    for j in range(len(diagonal)):
        column = columns[j]
        total = h[j]
        for i in range(j):
            total += column[i] * h[i]
        f[j] = total
        variance += diagonal[j] * total * total
    return variance


def absorb(noise: float, columns: Any, diagonal: Any, f: Any, gain: Any) -> None:
    """U and D after a reading, and its gain (Bierman 1977, V.3.2), from f = Uᵀ h."""
    variance = noise * noise
    for j in range(len(diagonal)):
        v = diagonal[j] * f[j]
        total = variance + v * f[j]
        diagonal[j] *= variance / total
        share = f[j] / variance
        column = columns[j]
        for i in range(j):
            entry = column[i]
            column[i] = entry - share * gain[i]
            gain[i] += v * entry
        gain[j] = v
        variance = total
    for j in range(len(diagonal)):
        gain[j] /= variance


def _watch_for_jump(seen: Any, watch: Any, jump_sd: float) -> float:
    """The jump statistic with one more reading: χ² of the bias step that recent innovations show.

    Sums C = Σ w wᵀ and y = Σ w z, forgotten over `MEMORY_ROWS` readings, of the normalised Jacobian
    w and innovation z; the statistic is yᵀ (C + 1/jump_sd²)⁻¹ y.
    """
    wx, wy, wz, z = seen[5], seen[6], seen[7], seen[3]
    keep = 1.0 - 1.0 / MEMORY_ROWS
    watch[0] = keep * watch[0] + wx * wx
    watch[1] = keep * watch[1] + wy * wy
    watch[2] = keep * watch[2] + wz * wz
    watch[3] = keep * watch[3] + wx * wy
    watch[4] = keep * watch[4] + wx * wz
    watch[5] = keep * watch[5] + wy * wz
    watch[6] = keep * watch[6] + wx * z
    watch[7] = keep * watch[7] + wy * z
    watch[8] = keep * watch[8] + wz * z
    return compute_statistic(watch, jump_sd)


def compute_statistic(watch: Any, jump_sd: float) -> float:
    """yᵀ (C + 1/jump_sd²)⁻¹ y of the sums, C xx yy zz xy xz yz and y x y z."""
    a, b, c, d, e, f = watch[0], watch[1], watch[2], watch[3], watch[4], watch[5]
    x, y, q = watch[6], watch[7], watch[8]
    least = 1.0 / (jump_sd * jump_sd)
    a, b, c = a + least, b + least, c + least
    xx, yy, zz = b * c - f * f, a * c - e * e, a * b - d * d
    xy, xz, yz = e * f - c * d, d * f - b * e, d * e - a * f
    determinant = a * xx + d * xy + e * xz
    inner = xx * x * x + yy * y * y + zz * q * q + 2.0 * (xy * x * y + xz * x * q + yz * y * q)
    return float(inner / determinant)


PARTS = (add_variance, pass_time, _residual, predict, absorb, compute_statistic, _watch_for_jump)
"""What numba has to compile, each after what it calls."""


@functools.cache
def compile_filter() -> Callable[..., tuple[int, bool]] | None:
    """`run` compiled by numba, or `None` without it."""
    return compile_parts(run, PARTS)


def compile_parts(
    whole: Callable[..., tuple[int, bool]], parts: Sequence[Callable[..., Any]]
) -> Callable[..., tuple[int, bool]] | None:
    """A function and those that it calls compiled by numba, or `None` without it.

    What numba keeps on the disk it compiles anew where the file of `whole` has changed; a change of
    any other part has to be seen here.
    """
    try:
        numba = importlib.import_module("numba")
        extending = importlib.import_module("numba.extending")
    except ImportError:
        return None
    for part in parts:
        extending.register_jitable(part)
    kernel: Any
    try:
        kernel = numba.njit(cache=True)(whole)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(whole)
        return cast(Callable[..., tuple[int, bool]], kernel)
    files = {Path(part.__code__.co_filename) for part in parts}
    changed = max((file.stat().st_mtime for file in files if file.is_file()), default=0.0)
    for index in Path(kernel.stats.cache_path).glob(f"*.{whole.__name__}-*.nbi"):
        if index.stat().st_mtime < changed:
            index.unlink(missing_ok=True)
    return cast(Callable[..., tuple[int, bool]], kernel)
