"""What a reading does to the filter: its prediction, the gate, the update and the jump test.

As in `factors` every function works in place on lists or arrays.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from agonic.maths.estimation.filters import factors
from agonic.maths.estimation.filters.jump_test import (
    CLIP,
    FREEDOM,
    KEEP,
    LOST,
    MEMORY_ROWS,
    SCALE,
    gather,
    is_jump,
)

ROOM = 8
"""Lines that are worked in."""

_SURE = 0.5 * MEMORY_ROWS * CLIP * CLIP  # of what the jump test can come to at all


def take_magnitude(
    row: Any,
    model: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    watch: Any,
    about: Any,
    linearised: bool,
    seen: Any,
    room: Any,
) -> bool:
    """The filter after a reading by its magnitude; whether a jump of the bias shows.

    `seen` takes residual, sd, whether it was used, clipped innovation, and the Jacobian.
    """
    noise, gate = model.noise, model.gate
    h, f, gain = room[0], room[1], room[2]
    m = len(diagonal)
    r, steepness = find_distance(about if linearised else x, row, noise, h, m)
    if linearised:
        for i in range(m):
            r += h[i] * (x[i] - about[i])
    sd = sqrt(factors.predict(h, noise, columns, diagonal, f))
    z = -r / sd
    used = row[5] > 0.0 and z * z <= gate * gate * max(1.0, watch[SCALE])
    clipped = CLIP if z > CLIP else -CLIP if z < -CLIP else z
    seen[0], seen[1], seen[2], seen[3] = (
        r * steepness,
        sd * steepness,
        1.0 if used else 0.0,
        clipped,
    )
    share = 1.0 / sd
    for i in range(m):
        seen[4 + i] = h[i] * share
    if used:
        factors.absorb(noise, columns, diagonal, f, gain)
        for i in range(m):
            x[i] -= gain[i] * r
    if not (model.jump_level > 0.0 and row[5] > 0.0):
        return False
    gather(seen[5], seen[6], seen[7], clipped, KEEP, watch)
    return is_jump(clipped * clipped, model.jump_level, model.jump_sd, 1e300, watch)


def find_distance(x: Any, row: Any, noise: float, h: Any, m: int) -> tuple[float, float]:
    """r and its Jacobian by the first m numbers (into h), and |s|; see `magnitude_residual`."""
    xx, yy, zz, xy, xz, yz = x[4], x[5], x[6], x[7], x[8], x[9]
    dx, dy, dz = row[1] - x[1], row[2] - x[2], row[3] - x[3]
    ux, uy, uz = (
        xx * dx + xy * dy + xz * dz,
        xy * dx + yy * dy + yz * dz,
        xz * dx + yz * dy + zz * dz,
    )
    size = sqrt(ux * ux + uy * uy + uz * uz) + 1e-300
    ex, ey, ez = ux / size, uy / size, uz / size
    sx, sy, sz = (
        xx * ex + xy * ey + xz * ez,
        xy * ex + yy * ey + yz * ez,
        xz * ex + yz * ey + zz * ez,
    )
    square = sx * sx + sy * sy + sz * sz
    steep = sqrt(square) + 1e-300
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


def take_vector(
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
    """The filter after a reading beside a gyro; whether a jump of the bias shows.

    `seen` takes residual x y z, its sd x y z, whether it was used, L⁻¹ of the residual's covariance
    L Lᵀ (six), innovation L⁻¹ r x y z, field x y z, what each innovation moves the bias by (nine,
    those of x first), covariance of the bias (six).
    """
    noise, gate = model.noise, model.gate
    m = len(diagonal)
    for j in range(m):
        room[6][j] = x[j]
    gain = (x[10] + x[11] + x[12]) / 3.0
    if model.late_s > 0.0:
        late = (
            model.late_s * model.late_s * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) / (gain * gain)
        )
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
            factors.predict(h, noise, columns, diagonal, f)
            factors.absorb(noise, columns, diagonal, f, share)
            for j in range(m):
                x[j] -= share[j] * left
    if row[7] > 0.0 and elapsed > 0.0:
        lasting = model.external_sd * sqrt(2.0 * model.external_time_s / elapsed)
        _take_length(row[7], least, lasting, model.external_sd, x, columns, diagonal, room)
    for i in range(3):
        seen[16 + i] = x[i]
    return model.jump_level > 0.0 and row[8] > 0.0 and _watch(seen, size, model, watch)


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
    at = 28
    for i in range(3, 6):
        a, b, c = diagonal[i] * f[i], diagonal[i] * g[i], diagonal[i] * h[i]
        for j in range(i + 1, m):
            part = columns[j][i] * diagonal[j]
            a += part * f[j]
            b += part * g[j]
            c += part * h[j]
        first = 19 + 3 * (i - 3)
        seen[first] = seen[7] * a
        seen[first + 1] = seen[8] * a + seen[9] * b
        seen[first + 2] = seen[10] * a + seen[11] * b + seen[12] * c
        for k in range(3, i + 1):
            total = diagonal[i] * (1.0 if k == i else columns[i][k])
            for j in range(i + 1, m):
                total += columns[j][i] * columns[j][k] * diagonal[j]
            seen[at] = total
            at += 1


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
        unsure += factors.variance_of(i, columns, diagonal)
    unsure = 3.0 * unsure / ((m - 10) * gain * gain) if m > 10 else 0.0
    wx, wy, wz = row[4] - x[6], row[5] - x[7], row[6] - x[8]
    unsure += factors.variance_of(9, columns, diagonal) * (wx * wx + wy * wy + wz * wz)
    spread = 0.0
    for i in range(3):
        spread += factors.variance_of(i, columns, diagonal) / 3.0
    size = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    return float(unsure * (spread + 0.5 * unsure * size) / (gain * gain))


def _take_length(
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
        spread += factors.variance_of(i, columns, diagonal)
    bend = 0.5 * (spread - factors.predict(h, 0.0, columns, diagonal, f)) / size
    if bend > 0.3 * max(noise, error):
        return
    noise = sqrt(noise * noise + lasting * lasting)
    r = size + bend - magnitude
    factors.predict(h, noise, columns, diagonal, f)
    factors.absorb(noise, columns, diagonal, f, gain)
    for j in range(m):
        x[j] -= gain[j] * r


def _watch(seen: Any, size: float, model: Any, watch: Any) -> bool:
    """The jump test with the three innovations of a reading, clipped together."""
    part = min(1.0, CLIP / sqrt(size)) if size > 0.0 else 1.0
    gather(seen[7], 0.0, 0.0, part * seen[13], KEEP, watch)
    gather(seen[8], seen[9], 0.0, part * seen[14], 1.0, watch)
    gather(seen[10], seen[11], seen[12], part * seen[15], 1.0, watch)
    square = part * part * size / FREEDOM
    return is_jump(square, model.jump_level, model.jump_sd, _SURE, watch)
