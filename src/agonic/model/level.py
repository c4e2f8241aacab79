"""Level headings: what errors of parameters and readings do to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.affine import split
from agonic.maths.equation.coverage import level_directions
from agonic.model.rows import Rows
from agonic.model.term import Seen


class Level(NamedTuple):
    """Level headings (h,): derivatives by the parameters (h, m) and by errors of the readings over
    the radius (h, 3), degrees, and what terms see there."""

    by_params: Array
    by_errors: Array
    seen: Seen

    @property
    def per_error(self) -> float:
        """Variance of a heading by errors of the readings of unit size on every axis, degrees²."""
        return float(np.mean(np.sum(self.by_errors**2, axis=1)))

    def spread(self, covariance: Array, by: Array | None = None) -> float:
        """Variance of a heading, mean over all, by parameters or other unknowns of a covariance."""
        ways = self.by_params if by is None else by
        return float(np.mean(np.sum((ways @ covariance) * ways, axis=1)))


def stand_level(
    rows: Rows, params: Array, origin: Array, inclination_deg: float, down: Array
) -> Level:
    """The level headings of a calibration, by its parameters in the problem's units."""
    basis = rows.problem.basis
    m = basis.shape[1]
    bias, matrix = split(basis @ params[:m])
    directions, across = level_directions(inclination_deg, down=down)
    level = np.cos(np.radians(inclination_deg))
    d = directions @ np.linalg.inv(matrix).T
    by_matrix = (across[:, :, None] * d[:, None, :]).reshape(len(d), 9)
    by_params = np.zeros((len(d), len(params)))
    local = np.concatenate([-across @ matrix, by_matrix], axis=1) @ basis
    by_params[:, :m] = np.degrees(local / level)
    seen = rows.seen._replace(
        x=(d + bias + origin) / rows.radius,
        unit=directions,
        time=np.zeros(len(d)),
        rows=np.zeros(len(d), dtype=np.intp),
        blur=0.0,
    )
    return Level(by_params, np.degrees(across @ matrix * rows.radius / level), seen)
