"""A fit to be examined, at its solution; what is found; the rows that are tested, as nouns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.maths.equation.coverage import (
    find_rms_sd,
    heading_jacobian_deg,
    level_directions,
)
from agonic.maths.estimation.inference.linearised import Linearised

FEWEST_ROWS = 60


class Residuals(NamedTuple):
    """What one kind of residual (magnitude, dip, azimuth) knows, all over its noise.

    `residuals` (n,), their `jacobian` (n, p + q) by the calibration's p numbers and further q
    unknowns, `by_reading` (n, 3) the normal along which an error of a reading shows, `correlation`.
    """

    residuals: Array
    jacobian: Array
    by_reading: Array
    correlation: float


class View(NamedTuple):
    """Readings (n, 3) of some rows, all kinds of their residuals, magnitude first, and signals."""

    readings: Array
    kinds: tuple[Residuals, ...]
    signals: Mapping[str, Array]


class Views(NamedTuple):
    """Some rows as they are, with a further draw of the readings' noise, and of the attitude's."""

    own: View
    blurred: View
    tilted: View


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """A fit by magnitude, and perhaps more, at its solution, in the units of the readings.

    `readings` (n, 3), `time` (n,) or None, `weights` (n,), `calibration` with its covariance,
    `wanted` the magnitude (1,) or (n,), `noise` of a reading on one axis, `correlation` of the
    noise in rows, `prior` (9, 9) the prior's information. `signals` are those (n, k) that a bias
    may go with, by the cause that it would be; a level vehicle at rest has none of them.

    Where more than the magnitude is known, `look` gives all kinds of residuals of some rows, and
    `own_prior` (p + q, p + q) is the information of the priors alone; `prior` is that of all else
    than the magnitude.
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
    look: Callable[[Index], Views] | None = None
    own_prior: Array = field(default_factory=lambda: np.zeros((0, 0)))

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
        return float(find_rms_sd(self._heading_by, covariance))

    @cached_property
    def _heading_by(self) -> Array:
        c = self.calibration
        return heading_jacobian_deg(self.inclination_deg, self.magnitude, c.matrix, c.gauge)


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelError:
    """Something that the model does not have and the residuals show: `size` rms in the readings.

    `heading_deg` is what it leaves open of a level heading beside `stated_deg` without it, `growth`
    (p, p) what the covariance has to grow by. Where its `probability` is below one, residuals do
    not show it for sure, and heading and growth are means.
    """

    cause: str
    p_value: float
    size: float
    heading_deg: float
    stated_deg: float
    growth: Array
    probability: float = 1.0

    def weigh(self, probability: float) -> ModelError:
        """The same error where it is there with this probability only."""
        heading, growth = self.heading_deg * probability**0.5, self.growth * probability
        return replace(self, heading_deg=heading, growth=growth, probability=probability)


class ResidualsAtFeet(NamedTuple):
    """Feet (n, 3) over the radius; of all residuals the normals (N, 3), times the radius over the
    noise, and they themselves (N,); signals (n, k) that a bias may go with."""

    feet: Array
    by_reading: Array
    residuals: Array
    signals: Mapping[str, Array]


class Work(NamedTuple):
    """The rows that are tested: their numbers, unit normals, feet over the radius; scales.

    `linear` is the fit by magnitude alone; `whole` that by all kinds of residuals, one kind after
    the other, and `even` that without regard to correlation, which an error of the model makes as
    well as noise; `seen` what they see, `again` with more noise of the readings, and of the
    attitude. `by_noise` is the information that a fit seems to have because noise blurs its
    Jacobian.
    """

    fitted: Fitted
    rows: Index
    normals: Array
    feet: Array
    radius: float
    scale: Array
    onto: Array
    linear: Linearised
    by_noise: Array
    whole: Linearised
    even: Linearised
    seen: ResidualsAtFeet
    again: tuple[ResidualsAtFeet, ...]


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
