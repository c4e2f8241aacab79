"""What time does to the filter: states decay, turn in the sensor, or walk; in place."""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from typing import Any

from agonic.maths.estimation.filters import factors

RATE, UNSEEN = 13, 20
"""Places in `watch`: the last rate x y z, how that changed x y z, the mean square of its second
difference; and the mean variance of what turns unseen between two readings."""


def decay(elapsed: float, model: Any, x: Any, columns: Any, diagonal: Any, room: Any) -> None:
    """What `elapsed` seconds do by the magnitude: the error of the reference decays and is stirred,
    bias and matrix walk."""
    m = len(diagonal)
    if model.external_sd > 0.0:
        kept = exp(-elapsed / model.external_time_s)
        x[0] *= kept
        for j in range(1, m):
            columns[j][0] *= kept
        kept *= kept
        diagonal[0] = kept * diagonal[0] + (1.0 - kept) * model.external_sd * model.external_sd
    factors.walk(model.walk, elapsed, 1, 4, columns, diagonal, room)
    factors.walk(model.matrix_walk, elapsed, 4, m, columns, diagonal, room)


def find_mean_rate(row: Any, elapsed: float, watch: Any, x: Any) -> tuple[float, float, float]:
    """The rate at which the sensor turned as a whole from the last reading to this one.

    (ω₀ + ω₁)/2 + Δt (ω₀ − β) × (ω₁ − β)/12: about an axis that moves the mean alone is not enough,
    and what it leaves out would be taken for a delay (J. E. Bortz 1971, IEEE Transactions on
    Aerospace and Electronic Systems AES-7(1), 61–66, for a rate that is a straight line in time).
    """
    ax, ay, az = watch[RATE], watch[RATE + 1], watch[RATE + 2]
    bx, by, bz = row[4], row[5], row[6]
    px, py, pz = ax - x[6], ay - x[7], az - x[8]
    qx, qy, qz = bx - x[6], by - x[7], bz - x[8]
    part = elapsed / 12.0
    return (
        0.5 * (ax + bx) + part * (py * qz - pz * qy),
        0.5 * (ay + by) + part * (pz * qx - px * qz),
        0.5 * (az + bz) + part * (px * qy - py * qx),
    )


def find_unseen_turn(row: Any, elapsed: float, watch: Any) -> float:
    """Variance about each axis, rad², of what turns between two readings beside the mean rate.

    As large as the second difference Δ² of the rates shows: Δt² E(Δ²)²/12 where successive rates
    have nothing to do with one another, half of that in a random walk, and Δt² (Δ²)²/144 where they
    are smooth; the largest is taken. `watch` is moved on.
    """
    total = 0.0
    for i in range(3):
        change = row[4 + i] - watch[RATE + i] if elapsed > 0.0 else 0.0
        beyond = change - watch[RATE + 3 + i]
        total += beyond * beyond
        watch[RATE + i], watch[RATE + 3 + i] = row[4 + i], change
    now = total / 3.0
    watch[RATE + 6] += (now - watch[RATE + 6]) / 16.0
    # a second difference has the variance 6 σ² of rates, the mean of two σ²/2
    unseen = elapsed * elapsed * max(now, watch[RATE + 6]) / 12.0
    unseen = min(unseen, 4.0)  # rad²: nothing is known of a direction
    watch[UNSEEN] += (unseen - watch[UNSEEN]) / 256.0
    return float(unseen)


def turn(
    row: Any,
    elapsed: float,
    model: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    watch: Any,
    room: Any,
) -> None:
    """What `elapsed` seconds do beside a gyro: the field turns in the sensor, as a whole, at the
    mean of the rates at both readings, and takes up the gyro's noise, what the rates may leave
    unseen and what it changes on the way; bias, gyro bias and matrix walk."""
    m = len(diagonal)
    rate = find_mean_rate(row, elapsed, watch, x)
    unseen = find_unseen_turn(row, elapsed, watch)
    # the field turns against the sensor
    ax, ay, az = x[6] - rate[0], x[7] - rate[1], x[8] - rate[2]
    _find_rotation(ax * elapsed, ay * elapsed, az * elapsed, room[0])
    turned = room[0]
    _rotate(turned, x)
    hx, hy, hz = x[0], x[1], x[2]
    for j in range(m):
        column = columns[j]
        if j < 3:
            for i in range(j, 3):
                column[i] = 1.0 if i == j else 0.0
        _rotate(turned, column)
        if j > 5:
            bx = column[6] * elapsed
            by = (column[7] if j > 6 else 0.0) * elapsed
            bz = (column[8] if j > 7 else 0.0) * elapsed
            column[0] += by * hz - bz * hy
            column[1] += bz * hx - bx * hz
            column[2] += bx * hy - by * hx
    # an error e of the matrix turns the field by e ω more or less while it turns about: for 1/ω
    lasting = model.away * model.away * sqrt(ax * ax + ay * ay + az * az)
    gyro = (model.gyro_noise * model.gyro_noise + lasting) * elapsed + unseen
    bend = 2.0 * unseen * unseen * (hx * hx + hy * hy + hz * hz)  # of an arc beside its tangent
    field = model.field_walk * model.field_walk * elapsed + bend
    _triangulate(columns, diagonal, gyro, field, hx, hy, hz, room)
    factors.walk(model.walk, elapsed, 3, 6, columns, diagonal, room[0])
    factors.walk(model.gyro_walk, elapsed, 6, 9, columns, diagonal, room[0])
    factors.walk(model.matrix_walk, elapsed, 10, m, columns, diagonal, room[0])


def _find_rotation(ax: float, ay: float, az: float, turned: Any) -> None:
    """The rotation about a vector by its length, row by row (Rodrigues)."""
    angle = sqrt(ax * ax + ay * ay + az * az)
    first = sin(angle) / angle if angle > 1e-4 else 1.0 - angle * angle / 6.0
    half = sin(0.5 * angle) / angle if angle > 1e-4 else 0.5 - angle * angle / 48.0
    second = 2.0 * half * half
    along = cos(angle)
    turned[0] = along + second * ax * ax
    turned[1] = second * ax * ay - first * az
    turned[2] = second * ax * az + first * ay
    turned[3] = second * ax * ay + first * az
    turned[4] = along + second * ay * ay
    turned[5] = second * ay * az - first * ax
    turned[6] = second * ax * az - first * ay
    turned[7] = second * ay * az + first * ax
    turned[8] = along + second * az * az


def _rotate(turned: Any, vector: Any) -> None:
    a, b, c = vector[0], vector[1], vector[2]
    vector[0] = turned[0] * a + turned[1] * b + turned[2] * c
    vector[1] = turned[3] * a + turned[4] * b + turned[5] * c
    vector[2] = turned[6] * a + turned[7] * b + turned[8] * c


def _triangulate(
    columns: Any,
    diagonal: Any,
    gyro: float,
    field: float,
    hx: float,
    hy: float,
    hz: float,
    room: Any,
) -> None:
    """U and D of the field from its turned columns, the gyro's noise and what the field walks.

    Modified weighted Gram–Schmidt (Thornton 1976) of the rows of [R U_hh, [h]×, 1].
    """
    for i in range(3):
        line = room[i]
        for j in range(3):
            line[j] = columns[j][i]
            line[3 + j] = 0.0
            line[6 + j] = 1.0 if i == j else 0.0
    room[0][4], room[0][5] = -hz, hy
    room[1][3], room[1][5] = hz, -hx
    room[2][3], room[2][4] = -hy, hx
    weight = room[3]
    for j in range(3):
        weight[j], weight[3 + j], weight[6 + j] = diagonal[j], gyro, field
    for j in range(2, -1, -1):
        last = room[j]
        total = 0.0
        for k in range(9):
            total += last[k] * last[k] * weight[k]
        diagonal[j] = total
        for i in range(j):
            line = room[i]
            shared = 0.0
            for k in range(9):
                shared += line[k] * last[k] * weight[k]
            shared = shared / total if total > 0.0 else 0.0
            columns[j][i] = shared
            for k in range(9):
                line[k] -= shared * last[k]
