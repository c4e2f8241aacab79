"""Robust regression: a straight line through points of which some may lie anywhere."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.one_pass import median

_FAR = 3.0  # a slope of more than so many standard errors is one


class Line(NamedTuple):
    """y = level + slope (x − middle), with the standard error of the slope."""

    middle: float
    level: float
    slope: float
    slope_sd: float

    def at(self, x: Array) -> Array:
        """The line at x."""
        return self.level + self.slope * (x - self.middle)

    @property
    def sloped(self) -> bool:
        """Whether the slope is more than chance."""
        return abs(self.slope) > _FAR * self.slope_sd


def fit_robust_line(x: Array, y: Array, taken: int = 0) -> Line:
    """The line by Tukey's biweight, from the median slope of pairs half the points apart.

    The standard error is Huber's, √(Σψ²(x − x̄)²) / Σψ'(x − x̄)², and allows for `taken` numbers
    that were estimated from the same points beforehand.
    """
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    half = len(x) // 2
    apart = x[half:] - x[: len(x) - half]
    slopes = (y[half:] - y[: len(y) - half])[apart > 0] / apart[apart > 0]
    slope = median(slopes) if len(slopes) else 0.0
    middle, level = float(np.mean(x)), median(y - slope * (x - np.mean(x)))
    weight, bend, loss, sd = np.ones_like(x), np.ones_like(x), tukey(), 0.0
    for _ in range(20):
        residuals = y - level - slope * (x - middle)
        scale = robust_scale(residuals, 2 + taken)
        if scale > 0:
            q = (residuals / scale) ** 2
            weight, bend = loss.weight(q), loss.curvature(q)
        total = weight.sum()
        middle = float(weight @ x / total)
        away = x - middle
        square = float(weight @ away**2)
        if square <= 0:
            return Line(middle, float(weight @ y / total), 0.0, np.inf)
        level, slope = float(weight @ y / total), float(weight @ (away * y) / square)
        freedom = len(x) / max(len(x) - 2 - taken, 1)
        scatter = float(np.sum((weight * away * residuals) ** 2))
        sd = float(np.sqrt(freedom * scatter) / max(bend @ away**2, 1e-3 * square))
    return Line(middle, level, slope, sd)
