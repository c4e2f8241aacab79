"""Whether recent innovations show a step of the bias; in place, on lists or arrays.

Sums C = Σ w wᵀ and y = Σ w z, forgotten over `MEMORY_ROWS` readings, of what innovations z show of
the bias by their normalised Jacobian w; the statistic is yᵀ (C + 1/jump_sd²)⁻¹ y.
"""

from __future__ import annotations

from typing import Any

MEMORY_ROWS = 50
"""Readings over which innovations are gathered to see a jump."""
KEEP = 1.0 - 1.0 / MEMORY_ROWS
SCALE, USUAL, LOST, TIME, WATCHED = 9, 10, 11, 12, 21
"""Places in `watch`, after nine sums of the jump test, and how many there are: mean square of the
clipped innovations, what the jump test usually comes to, seconds since a reading fitted, and time
of the last reading. Those after belong to `motion`."""
CLIP = 2.5
"""Standard deviations: what one innovation may say for a jump."""
SCALE_ROWS = 1000.0
"""Readings over which the size of innovations is averaged."""
FREEDOM = 3.0
"""Mean of the jump test where nothing jumps."""


def gather(wx: float, wy: float, wz: float, z: float, keep: float, watch: Any) -> None:
    """The sums with an innovation more; `KEEP` of them is kept from reading to reading."""
    watch[0] = keep * watch[0] + wx * wx
    watch[1] = keep * watch[1] + wy * wy
    watch[2] = keep * watch[2] + wz * wz
    watch[3] = keep * watch[3] + wx * wy
    watch[4] = keep * watch[4] + wx * wz
    watch[5] = keep * watch[5] + wy * wz
    watch[6] = keep * watch[6] + wx * z
    watch[7] = keep * watch[7] + wy * z
    watch[8] = keep * watch[8] + wz * z


def is_jump(square: float, level: float, jump_sd: float, surely: float, watch: Any) -> bool:
    """Whether the sums tell a jump after a reading whose clipped innovations are of such a mean
    square; what is above `surely` does, however large it usually is."""
    watch[SCALE] += (square - watch[SCALE]) / SCALE_ROWS
    shown = compute_statistic(watch, jump_sd)
    limit = level * max(1.0, watch[SCALE]) * max(1.0, watch[USUAL])
    if shown > min(limit, max(level, surely)):
        return True
    watch[USUAL] += (min(shown, level) / FREEDOM - watch[USUAL]) / SCALE_ROWS
    return False


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
