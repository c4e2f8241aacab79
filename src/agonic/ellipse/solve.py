"""The ellipse of readings in a plane, by maximum likelihood."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.ellipse.maths.conic import find_start
from agonic.maths.equation.affine import ELLIPSE
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import refine


class Found(NamedTuple):
    """An ellipse in the unit of the readings, of magnitude one.

    `ellipse` (5,) bias x y and matrix xx yy xy, `covariance` (5, 5) of them; `noise` of a reading
    on an axis; `correlation` in readings; `residuals` and `weights` (n,).
    """

    ellipse: Array
    covariance: Array
    noise: float
    correlation: float
    residuals: Array
    weights: Array


def solve(readings: Array, rounding: float, *, robust: bool = True, seed: int = 0) -> Found:
    """The ellipse that readings (n, 2) lie on, in their unit.

    The same likelihood as of an ellipsoid (distances from the curve, Tukey's loss where a reading
    stands out, errors that last in the covariance), with z nowhere in it.
    """
    centre = np.median(readings, axis=0)
    size = float(np.sqrt(np.mean(np.sum((readings - centre) ** 2, axis=1))))
    points = (readings - centre) / size
    problem = Problem(
        np.column_stack([points, np.zeros(len(points))]),
        np.ones(1),
        ELLIPSE,
        None,
        rounding=rounding / size,
    )
    found = refine(problem, find_start(points, seed), robust)
    scale = np.array([size, size, 1 / size, 1 / size, 1 / size])
    noise = found.noise["magnitude"]
    return Found(
        found.solution.params * scale + np.r_[centre, np.zeros(3)],
        found.solution.covariance * np.outer(scale, scale),
        noise.sd * size,
        noise.correlation,
        found.residuals["magnitude"] * size,
        found.weights,
    )
