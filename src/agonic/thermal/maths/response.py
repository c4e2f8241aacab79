"""One sensor at one temperature: its mean readings at the stations against the described turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.thermal.maths.stations import MOUNTINGS

_ROUNDS = 12


class Response(NamedTuple):
    """readings = response @ rot_nbᵀ @ field + bias, with |field| = 1.

    `field_n` (k, 3) is the field in the chamber that each station saw; `rms` what is left, as a
    share of the field.
    """

    response: Array
    bias: Array
    field: Array
    field_n: Array
    rms: float


def fit_response(readings: Array, rot_nb: Array) -> Response:
    """The linear response, bias and field direction that the readings of turned stations show.

    Bilinear least squares, the two sides in turn, from the best of the 24 ways in which the sensor
    can be mounted.

    Parameters: readings (k, 3) in any unit, rot_nb (k, 3, 3) from box to chamber.

    >>> turns = MOUNTINGS[[0, 3, 7, 9, 12, 15, 18, 20]]
    >>> field = np.array([0.4, 0.0, 0.9165151389911681])
    >>> seen = np.swapaxes(turns, 1, 2) @ field @ np.diag([2.0, 2.1, 1.9]) + [5.0, 6.0, 7.0]
    >>> fit_response(seen, turns).rms < 1e-3
    True
    """
    turned = np.swapaxes(rot_nb, 1, 2)
    response, field, bias = _find_start(readings, turned)
    for _ in range(_ROUNDS):
        seen = np.asarray(turned @ field)
        design = np.hstack([seen, np.ones((len(seen), 1))])
        solution = np.asarray(np.linalg.lstsq(design, readings, rcond=None)[0], np.float64)
        response, bias = solution[:3].T, solution[3]
        rows = (response @ turned).reshape(-1, 3)
        field = np.linalg.lstsq(rows, (readings - bias).ravel(), rcond=None)[0]
        field = field / np.linalg.norm(field)
    field_n = np.einsum("kij,kj->ki", rot_nb, (readings - bias) @ np.linalg.pinv(response).T)
    rms = float(np.sqrt(np.mean((field_n - field) ** 2) * 3))
    return Response(response, bias, field, field_n, rms)


def _find_start(readings: Array, turned: Array) -> tuple[Array, Array, Array]:
    """The mounting along the axes that leaves least, with its field and bias."""
    best: tuple[float, Array, Array, Array] | None = None  # what is left, and the three
    for axes in MOUNTINGS:
        design = np.concatenate([axes @ turned, np.broadcast_to(np.eye(3), turned.shape)], axis=2)
        solution = np.linalg.lstsq(design.reshape(-1, 6), readings.ravel(), rcond=None)[0]
        left = readings - design @ solution
        if best is None or float(np.sum(left**2)) < best[0]:
            size = float(np.linalg.norm(solution[:3]))
            best = (float(np.sum(left**2)), axes * size, solution[:3] / size, solution[3:])
    assert best is not None
    return best[1:]


def compute_misfit(readings: Sequence[Array], rot_nb: Array) -> float:
    """The rms over sensors of what is left, as a share of the field.

    The readings of a sensor are (k, 3), NaN where it has none.
    """
    left = []
    for own in readings:
        there = np.isfinite(own[:, 0])
        left.append(fit_response(own[there], rot_nb[there]).rms)
    return float(np.sqrt(np.mean(np.square(left))))
