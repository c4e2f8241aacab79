"""What turning does to the filter: the field turns in the sensor, and unknowns walk; in place."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

from agonic.maths.estimation import ud_filter


def turn(
    rate: tuple[float, float, float],
    elapsed: float,
    model: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    room: Any,
) -> None:
    """What `elapsed` seconds at a rate do: the field turns in the sensor, and all of it walks."""
    m = len(diagonal)
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
    gyro = model[1] * model[1] * elapsed
    _triangulate(columns, diagonal, gyro, model[2] * model[2] * elapsed, hx, hy, hz, room)
    walk(model[3], elapsed, 3, 6, columns, diagonal, room[0])
    walk(model[4], elapsed, 6, 9, columns, diagonal, room[0])
    walk(model[5], elapsed, 10, m, columns, diagonal, room[0])


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


def walk(
    rate: float, elapsed: float, first: int, last: int, columns: Any, diagonal: Any, room: Any
) -> None:
    """Numbers from first to before last walk at random."""
    if rate > 0.0:
        for i in range(first, last):
            ud_filter.add_variance(i, rate * rate * elapsed, columns, diagonal, room)


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


PARTS = (_find_rotation, walk, _rotate, _triangulate, turn)
"""What numba has to compile, each after what it calls."""
