"""What a reading does to the filter: its prediction, the gate, the update and the jump test.

As in `ud_filter` every function works in place on lists or arrays.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from agonic.maths.estimation.filters import ud_filter
from agonic.maths.estimation.filters.ud_filter import CLIP, FREEDOM, MEMORY_ROWS, SCALE_ROWS

SEEN = 37
"""Numbers kept of each reading: residual x y z, its sd x y z, whether it was used, L⁻¹ of the
residual's covariance L Lᵀ (six), innovation L⁻¹ r x y z, field x y z, bias x y z, what each
innovation moves the bias by (nine, those of x first), covariance of the bias (six)."""
SCALE, USUAL, LOST, TIME, RATE, UNSEEN, WATCHED = 9, 10, 11, 12, 13, 20, 21
"""Places in `watch`, after the nine sums of the jump test, and how many there are: mean square of
the clipped innovations, what the test usually comes to, seconds since a reading fitted, time of the
last reading, its rate x y z, how that changed x y z, the mean square of its second difference, and
the mean variance of what turns unseen between two readings."""
CLIPPED_SQUARE = 0.9258
"""Mean of min(χ², 2.5²)/3, χ² of three degrees of freedom."""

_CURVED = 0.3  # of the noise of a magnitude: what the curvature of a length may come to
_SURE = 0.5 * MEMORY_ROWS * CLIP * CLIP  # of what the jump test can come to at all


def take(
    row: Any,
    elapsed: float,
    model: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    watch: Any,
    seen: Any,
    room: Any,
) -> bool:
    """The filter after a reading; whether a jump of the bias shows."""
    noise, gate, level, jump_sd = model[0], model[8], model[9], model[10]
    m = len(diagonal)
    for j in range(m):
        room[6][j] = x[j]
    gain = (x[10] + x[11] + x[12]) / 3.0
    if model[11] > 0.0:
        late = model[11] * model[11] * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) / (gain * gain)
        noise = sqrt(noise * noise + late * (row[4] * row[4] + row[5] * row[5] + row[6] * row[6]))
    least = noise * gain
    noise = sqrt(noise * noise + _find_bend(row, gain, x, columns, diagonal))
    jacobian = (room[0], room[1], room[2])
    _find_residual(x, row, m, jacobian, room[3])
    size = _whiten(jacobian, room[3], noise, columns, diagonal, (room[4], room[5], room[7]), seen)
    _find_gain(columns, diagonal, (room[4], room[5], room[7]), seen)
    used = row[8] > 0.0 and size <= gate * gate * max(1.0, watch[SCALE])
    seen[6] = 1.0 if used else 0.0
    watch[LOST] = 0.0 if used else watch[LOST] + elapsed
    if used:
        f, share = room[4], room[5]
        for i in range(3):
            h = jacobian[i]
            left = room[3][i]
            for j in range(m):
                left += h[j] * (x[j] - room[6][j])
            ud_filter.predict(h, noise, columns, diagonal, f)
            ud_filter.absorb(noise, columns, diagonal, f, share)
            for j in range(m):
                x[j] -= share[j] * left
    if row[7] > 0.0 and elapsed > 0.0:
        lasting = model[6] * sqrt(2.0 * model[7] / elapsed)
        _take_magnitude(row[7], least, lasting, model[6], x, columns, diagonal, room)
    for i in range(3):
        seen[16 + i], seen[19 + i] = x[i], x[3 + i]
    return level > 0.0 and row[8] > 0.0 and _is_jump(seen, size, watch, level, jump_sd)


def _find_residual(x: Any, row: Any, m: int, jacobian: Any, residual: Any) -> None:
    """raw − bias − W⁻¹ (h + τ ω × (h + ½ τ ω × h)) (into `residual`), and its Jacobian.

    The reading shows the field of τ seconds ago; W⁻¹ by its cofactors.
    """
    xx, yy, zz, xy, xz, yz = x[10], x[11], x[12], x[13], x[14], x[15]
    a, b, c = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    d, e, f = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    one = 1.0 / (xx * a + xy * d + xz * e)
    a, b, c, d, e, f = a * one, b * one, c * one, d * one, e * one, f * one
    inverse = ((a, d, e), (d, b, f), (e, f, c))
    hx, hy, hz = x[0], x[1], x[2]
    wx, wy, wz = row[4] - x[6], row[5] - x[7], row[6] - x[8]
    px, py, pz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
    late = x[9]
    qx, qy, qz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
    px, py, pz = px + late * qx, py + late * qy, pz + late * qz
    hx += late * (px - 0.5 * late * qx)
    hy += late * (py - 0.5 * late * qy)
    hz += late * (pz - 0.5 * late * qz)
    wx, wy, wz = late * wx, late * wy, late * wz
    u = a * hx + d * hy + e * hz
    v = d * hx + b * hy + f * hz
    w = e * hx + f * hy + c * hz
    residual[0] = row[1] - x[3] - u
    residual[1] = row[2] - x[4] - v
    residual[2] = row[3] - x[5] - w
    for i in range(3):
        h, line = jacobian[i], inverse[i]
        h[0] = -line[0] - line[1] * wz + line[2] * wy
        h[1] = -line[1] - line[2] * wx + line[0] * wz
        h[2] = -line[2] - line[0] * wy + line[1] * wx
        for j in range(3):
            h[3 + j] = -1.0 if i == j else 0.0
            h[6 + j] = 0.0
        h[9] = -line[0] * px - line[1] * py - line[2] * pz
        if m > 10:
            h[10], h[11], h[12] = line[0] * u, line[1] * v, line[2] * w
        if m > 13:
            h[13] = line[0] * v + line[1] * u
            h[14] = line[0] * w + line[2] * u
            h[15] = line[1] * w + line[2] * v


def _whiten(
    jacobian: Any, r: Any, noise: float, columns: Any, diagonal: Any, room: Any, seen: Any
) -> float:
    """|L⁻¹ r|², L Lᵀ the covariance of the residual; r, its sd, L⁻¹ and L⁻¹ r are kept."""
    m = len(diagonal)
    for i in range(3):
        h, f = jacobian[i], room[i]
        for j in range(m):
            total = h[j]
            column = columns[j]
            for k in range(j):
                total += column[k] * h[k]
            f[j] = total
    least = noise * noise
    xx, yy, zz, xy, xz, yz = least, least, least, 0.0, 0.0, 0.0
    for j in range(m):
        p, q, s, d = room[0][j], room[1][j], room[2][j], diagonal[j]
        xx += d * p * p
        yy += d * q * q
        zz += d * s * s
        xy += d * p * q
        xz += d * p * s
        yz += d * q * s
    seen[0], seen[1], seen[2] = r[0], r[1], r[2]
    seen[3], seen[4], seen[5] = sqrt(xx), sqrt(yy), sqrt(zz)
    p = 1.0 / sqrt(xx)
    d, e = xy * p, xz * p
    q = 1.0 / sqrt(max(yy - d * d, least))
    g = (yz - d * e) * q
    s = 1.0 / sqrt(max(zz - e * e - g * g, least))
    seen[7], seen[8], seen[9] = p, -d * p * q, q
    seen[10], seen[11], seen[12] = (d * q * g - e) * p * s, -g * q * s, s
    x = seen[13] = seen[7] * r[0]
    y = seen[14] = seen[8] * r[0] + seen[9] * r[1]
    z = seen[15] = seen[10] * r[0] + seen[11] * r[1] + seen[12] * r[2]
    return float(x * x + y * y + z * z)


def _find_gain(columns: Any, diagonal: Any, room: Any, seen: Any) -> None:
    """P Hᵀ L⁻ᵀ of the bias, by which it follows an innovation, and its covariance; `room` holds
    the Uᵀ h of the three residuals."""
    m = len(diagonal)
    f, g, h = room
    at = 31
    for i in range(3, 6):
        a, b, c = diagonal[i] * f[i], diagonal[i] * g[i], diagonal[i] * h[i]
        for j in range(i + 1, m):
            part = columns[j][i] * diagonal[j]
            a += part * f[j]
            b += part * g[j]
            c += part * h[j]
        first = 22 + 3 * (i - 3)
        seen[first] = seen[7] * a
        seen[first + 1] = seen[8] * a + seen[9] * b
        seen[first + 2] = seen[10] * a + seen[11] * b + seen[12] * c
        for k in range(3, i + 1):
            total = diagonal[i] * (1.0 if k == i else columns[i][k])
            for j in range(i + 1, m):
                total += columns[j][i] * columns[j][k] * diagonal[j]
            seen[at] = total
            at += 1


def variance_of(i: int, columns: Any, diagonal: Any) -> float:
    """The variance of number i."""
    total = float(diagonal[i])
    for j in range(i + 1, len(diagonal)):
        total += columns[j][i] * columns[j][i] * diagonal[j]
    return total


def _find_bend(row: Any, gain: float, x: Any, columns: Any, diagonal: Any) -> float:
    """Variance of what a reading bends by: errors of the matrix and of the delay times errors of
    the field, and times one another.

    With c the relative variance of W⁻¹ (1 + τ [ω]×) and v that of the field, c v + c²h²/2: what a
    filter of second order adds to the noise of a reading (M. Athans, R. P. Wishner, A. Bertolini
    1968, IEEE Transactions on Automatic Control 13(5), 504–514). Without it the first readings,
    linear about a guess, would count as surely as all later ones.
    """
    m = len(diagonal)
    unsure = 0.0
    for i in range(10, m):
        unsure += variance_of(i, columns, diagonal)
    unsure = 3.0 * unsure / ((m - 10) * gain * gain) if m > 10 else 0.0
    wx, wy, wz = row[4] - x[6], row[5] - x[7], row[6] - x[8]
    unsure += variance_of(9, columns, diagonal) * (wx * wx + wy * wy + wz * wz)
    spread = 0.0
    for i in range(3):
        spread += variance_of(i, columns, diagonal) / 3.0
    size = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    return float(unsure * (spread + 0.5 * unsure * size) / (gain * gain))


def _take_magnitude(
    magnitude: float,
    noise: float,
    lasting: float,
    error: float,
    x: Any,
    columns: Any,
    diagonal: Any,
    room: Any,
) -> None:
    """The length of the field against the magnitude, whose `error` s lasts for a time T.

    Over many T that says as much as white noise of 2 T s²/τ each τ, the `lasting`. The length of an
    uncertain field is longer by half its variance across over |h|; while that is more than the
    noise nothing is learnt, for it would be the same error again and again.
    """
    m = len(diagonal)
    h, f, gain = room[0], room[4], room[5]
    size = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    if not size > 0.0:
        return
    for j in range(m):
        h[j] = x[j] / size if j < 3 else 0.0
    spread = 0.0
    for i in range(3):
        spread += variance_of(i, columns, diagonal)
    bend = 0.5 * (spread - ud_filter.predict(h, 0.0, columns, diagonal, f)) / size
    if bend > _CURVED * max(noise, error):
        return
    noise = sqrt(noise * noise + lasting * lasting)
    r = size + bend - magnitude
    ud_filter.predict(h, noise, columns, diagonal, f)
    ud_filter.absorb(noise, columns, diagonal, f, gain)
    for j in range(m):
        x[j] -= gain[j] * r


def _is_jump(seen: Any, size: float, watch: Any, level: float, jump_sd: float) -> bool:
    """Whether the jump test of `ud_filter` tells one, with three innovations more."""
    keep = 1.0 - 1.0 / ud_filter.MEMORY_ROWS
    part = min(1.0, CLIP / sqrt(size)) if size > 0.0 else 1.0
    a, b, c, d, e, f = seen[7], seen[8], seen[9], seen[10], seen[11], seen[12]
    x, y, z = part * seen[13], part * seen[14], part * seen[15]
    watch[0] = keep * watch[0] + a * a + b * b + d * d
    watch[1] = keep * watch[1] + c * c + e * e
    watch[2] = keep * watch[2] + f * f
    watch[3] = keep * watch[3] + b * c + d * e
    watch[4] = keep * watch[4] + d * f
    watch[5] = keep * watch[5] + e * f
    watch[6] = keep * watch[6] + a * x + b * y + d * z
    watch[7] = keep * watch[7] + c * y + e * z
    watch[8] = keep * watch[8] + f * z
    watch[SCALE] += (part * part * size / FREEDOM - watch[SCALE]) / SCALE_ROWS
    shown = ud_filter.compute_statistic(watch, jump_sd)
    limit = level * max(1.0, watch[SCALE]) * max(1.0, watch[USUAL])
    if shown > min(limit, max(level, _SURE)):
        return True
    watch[USUAL] += (min(shown, level) / FREEDOM - watch[USUAL]) / SCALE_ROWS
    return False


PARTS = (
    _find_residual,
    _whiten,
    _find_gain,
    variance_of,
    _find_bend,
    _take_magnitude,
    _is_jump,
    take,
)
"""What numba has to compile, each after what it calls."""
