"""A fit to be examined, at its solution; what is found; the rows that are tested."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.maths.equation.affine import magnitude_residual, model_basis
from agonic.maths.equation.coverage import find_spread_rows, heading_sd_deg, level_directions
from agonic.maths.estimation.score_test import Linearised, batches_of

MOST_ROWS, BLOCK = 20_000, 200
FEWEST_ROWS = 60
WORST_CONDITION = 1e12
"""Of the information over the scales: beyond it the fit itself is undetermined."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """A fit by magnitude at its solution, in the units of the readings.

    `readings` (n, 3), `time` (n,) or None, `weights` (n,), `calibration` with its covariance,
    `wanted` the magnitude (1,) or (n,), `noise` of a reading on one axis, `correlation` of the
    noise in rows, `prior` (9, 9) the prior's information. `signals` are those (n, k) that a bias
    may go with, by the cause that it would be; a level vehicle at rest has none of them.
    """

    calibration: Affine
    readings: Array
    time: Array | None
    weights: Array
    wanted: Array
    noise: float
    correlation: float
    prior: Array
    inclination_deg: float = 60.0
    signals: Mapping[str, Array] = field(default_factory=dict)

    @property
    def magnitude(self) -> float:
        """The field's magnitude that the calibration was made with."""
        assert self.calibration.magnitude is not None
        return self.calibration.magnitude

    @property
    def gain(self) -> float:
        """The mean gain of the calibration's matrix."""
        return float(np.trace(self.calibration.matrix)) / 3

    def heading_deg(self, covariance: Array) -> float:
        """What a covariance leaves open of a level heading, rms over all headings."""
        c = self.calibration
        at = (self.inclination_deg, self.magnitude, c.matrix, covariance, c.gauge)
        return float(heading_sd_deg(*at))


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelError:
    """Something that the model does not have and the residuals show.

    `size` rms in the readings, `heading_deg` what it leaves open of a level heading
    beside `stated_deg` without it, `growth` (p, p) what the covariance has to grow by.
    """

    cause: str
    p_value: float
    size: float
    heading_deg: float
    stated_deg: float
    growth: Array


class Work(NamedTuple):
    """The rows that are tested: their numbers, unit normals, feet over the radius; scales."""

    fitted: Fitted
    rows: Index
    normals: Array
    feet: Array
    blurred: Array
    radius: float
    scale: Array
    onto: Array
    linear: Linearised


def prepare(fitted: Fitted) -> Work | None:
    n = len(fitted.readings)
    gain = fitted.gain
    radius = fitted.magnitude / gain
    if n < FEWEST_ROWS or not 0 < fitted.noise < 0.2 * radius:
        return None
    rows = _some(fitted.readings)
    readings = fitted.readings[rows]
    wanted = fitted.wanted if len(fitted.wanted) == 1 else fitted.wanted[rows]
    residuals, local = magnitude_residual(
        readings, fitted.calibration.bias, fitted.calibration.matrix, wanted, fitted.noise
    )
    onto = model_basis("full", fitted.calibration.gauge)
    scale = np.r_[np.full(3, radius), np.full(onto.shape[1] - 3, gain)]
    normals = (
        (readings - fitted.calibration.bias)
        @ fitted.calibration.matrix.T
        @ fitted.calibration.matrix
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    feet = readings - residuals[:, None] * normals
    blur = fitted.noise * np.random.default_rng(0).normal(size=feet.shape)
    blur -= np.sum(blur * normals, axis=1, keepdims=True) * normals
    linear = Linearised(
        residuals / fitted.noise,
        (local @ onto) * (scale / fitted.noise),
        fitted.weights[rows],
        fitted.prior * np.outer(scale, scale),
        batches_of(len(rows), fitted.correlation),
    )
    if np.linalg.cond(linear.information) > WORST_CONDITION:
        return None
    blurred = (feet + blur) / radius
    return Work(fitted, rows, normals, feet / radius, blurred, radius, scale, onto, linear)


def _some(readings: Array) -> Index:
    """All rows, or blocks of consecutive ones spread evenly; few of those that say the same."""
    n = len(readings)
    spread = find_spread_rows(readings)
    if len(spread) < min(n, MOST_ROWS):  # at rest for most of the log
        return spread
    if n <= MOST_ROWS:
        return np.arange(n)
    starts = np.linspace(0, n - BLOCK, MOST_ROWS // BLOCK).astype(np.intp)
    return np.unique((starts[:, None] + np.arange(BLOCK)).ravel())


def make_error(work: Work, cause: str, p_value: float, size: float, growth: Array) -> ModelError:
    fitted = work.fitted
    assert fitted.calibration.covariance is not None
    return ModelError(
        cause=cause,
        p_value=p_value,
        size=size,
        heading_deg=fitted.heading_deg(growth),
        stated_deg=fitted.heading_deg(fitted.calibration.covariance),
        growth=growth,
    )


def level_readings(work: Work) -> Array:
    """What the sensor reads level in the field, at even headings (36, 3)."""
    directions, _ = level_directions(work.fitted.inclination_deg)
    inverse = np.linalg.inv(work.fitted.calibration.matrix)
    return np.asarray(work.fitted.magnitude * directions @ inverse.T + work.fitted.calibration.bias)


def moved_field(work: Work, shift: Array) -> Array:
    """How a change of the calibration changes the level field at even headings (36, 3)."""
    local = work.onto @ shift
    moved = (level_readings(work) - work.fitted.calibration.bias) @ local[3:].reshape(3, 3).T
    return np.asarray(moved - work.fitted.calibration.matrix @ local[:3])


def field_per_degree(work: Work) -> float:
    """Field across the horizontal that turns the heading by a degree."""
    level = work.fitted.magnitude * np.cos(np.radians(work.fitted.inclination_deg))
    return float(np.radians(level))
