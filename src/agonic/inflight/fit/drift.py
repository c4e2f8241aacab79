"""The bias over time: a cubic spline, as terms that join the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from agonic.arrays import Array

DEGREE = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift:
    """A bias in time: bias(t) = constant + coefficients @ (spline(t) − middle), nT.

    `knots` is the spline's full knot vector, empty for a constant bias; `covariance` that of the
    constant, then the coefficients row by row; `start` and `stop` are the ends of the record, s.
    """

    knots: Array
    middle: Array
    constant: Array
    coefficients: Array
    covariance: Array
    start: float
    stop: float

    @property
    def changes(self) -> bool:
        """Whether the bias is anything but constant."""
        return self.intervals > 0

    @property
    def intervals(self) -> int:
        """Even stretches of time that the spline has, 0 for a constant bias."""
        return max(len(self.knots) - 2 * DEGREE - 1, 0)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Bias (k, 3) and its standard error (k, 3); outside the record that of its end."""
        within = np.clip(time, self.start, self.stop)
        terms = evaluate_spline(within, self.knots) - self.middle
        bias = self.constant + terms @ self.coefficients.T
        jacobian = np.zeros((len(time), 3, len(self.covariance)))
        jacobian[:, :, :3] = np.eye(3)
        k = terms.shape[1]
        for axis in range(3):
            jacobian[:, axis, 3 + axis * k : 3 + (axis + 1) * k] = terms
        variance = np.einsum("nij,jk,nik->ni", jacobian, self.covariance, jacobian)
        return bias, np.sqrt(np.maximum(variance, 0.0))


def place_knots(start: float, stop: float, intervals: int) -> Array:
    """The knot vector of a cubic spline with so many even intervals; none for 0."""
    if intervals == 0:
        return np.empty(0)
    inner = np.linspace(start, stop, intervals + 1)
    return np.concatenate([[start] * DEGREE, inner, [stop] * DEGREE])


def evaluate_spline(time: Array, knots: Array) -> Array:
    """The basis functions at times (n, k); the last one is left out, for all add up to one."""
    if len(knots) == 0:
        return np.zeros((len(time), 0))
    basis = BSpline.design_matrix(time, knots, DEGREE).toarray()
    return np.asarray(basis[:, :-1])
