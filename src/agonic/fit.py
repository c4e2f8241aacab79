"""`Fit`: a calibration with its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol, Self

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.health import Evidence, Finding, Judged, figure, sort_findings
from agonic.readable import Readable
from agonic.samples import Samples

UNKNOWNS = {"sphere": 4, "ellipse": 5, "diagonal": 6, "full": 9}
"""Of each model; one that tests chose has those of all that they chose from."""


@dataclass(frozen=True, kw_only=True)
class ModelTest:
    """One step of the nested tests: is the larger model needed?"""

    smaller: str
    larger: str
    statistic: float
    p_value: float
    sentence: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel(Readable):
    """Residuals (n,) of one kind, their standard deviation and correlation length."""

    residuals: Array
    noise: float
    correlation: float


class Uncertain(Protocol):
    """Something that carries a covariance, as every calibration does."""

    @property
    def covariance(self) -> Array | None: ...


class Estimated(Judged):
    """A result whose calibration carries the covariance of what was estimated."""

    calibration: Uncertain

    @property
    def covariance(self) -> Array:
        """The covariance of the calibration, in the order of its parameters."""
        covariance = self.calibration.covariance
        assert covariance is not None, "a fit always carries a covariance"
        return covariance

    @property
    def sd(self) -> Array:
        """Standard errors of the same."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


LOOSER = 1.2
"""A vehicle's heading that is known so much less well than the sensor's is stated beside it."""


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """How well a result is known: the largest standard error of the bias, in `unit`, and those of a
    level heading, degrees, at the dip `inclination_deg`.

    `own_deg` is that of the sensor's own axes, `vehicle_deg` that of the vehicle where it is known;
    `alone` where the magnitude, which no turn of the sensor changes, tells nothing of the
    vehicle's; `delay_deg` is the share of the delay, while turning as in the log.
    """

    bias_sd: float
    unit: str
    own_deg: float
    inclination_deg: float
    vehicle_deg: float | None = None
    alone: bool = False
    delay_deg: float = 0.0

    @property
    def heading_deg(self) -> float:
        """The standard error of the heading of the sensor's own axes, the delay's share in it."""
        return float(np.hypot(self.own_deg, self.delay_deg))

    @property
    def vehicle_heading_deg(self) -> float | None:
        """That of the vehicle, where it is known, the delay's share in it."""
        return (
            None if self.vehicle_deg is None else float(np.hypot(self.vehicle_deg, self.delay_deg))
        )

    @property
    def sentence(self) -> str:
        """The same in words; at rest as well where most of the heading's error is the delay's."""
        heading = self._say(self.delay_deg)
        if self.delay_deg > self.own_deg:
            heading += f" while turning as in this log, {self._say(0.0)} at rest"
        return (
            f"standard error: bias {figure(self.bias_sd)} {self.unit}, heading {heading} (level, "
            f"dip {self.inclination_deg:.0f}°)"
        )

    def _say(self, delay_deg: float) -> str:
        own = f"{figure(float(np.hypot(self.own_deg, delay_deg)))}°"
        if self.vehicle_deg is None:
            return f"{own} of the sensor's own axes" if self.alone else own
        vehicle = f"{figure(float(np.hypot(self.vehicle_deg, delay_deg)))}°"
        if self.vehicle_deg <= LOOSER * self.own_deg:
            return vehicle
        return f"{own} of the sensor, {vehicle} of the vehicle"


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit(Estimated):
    """A calibration and what it rests on.

    `residuals` (n,) are distances from the model in the unit of the readings, a row a sample, and
    `weights` (n,) what the robust loss left of each reading, 0…1 (both `None` after a fit from
    moments, which keeps no readings); `noise` is the standard deviation of one reading on one axis;
    `correlation` is the correlation length, in readings (1 for white noise), already inside
    `covariance`; `condition` is that of the scaled information matrix; `channels` are the residuals
    by kind ("magnitude", "dip", "azimuth") where the attitude aided the fit; `findings` are all
    observations, by name; `tests` the choice of model; `accuracy` how well it is known, unless it
    is refused; `shares` what the heading's error is made of, degrees by name, the largest first.
    `covariance` (9, 9) is that of bias x y z, then matrix xx yy zz xy xz yz; (12, 12)
    where the matrix is free, with yx zx zy, and further with the coefficients of sources on board.
    """

    calibration: Affine
    n: int
    residuals: Array | None
    weights: Array | None
    noise: float
    correlation: float
    condition: float
    iterations: int
    converged: bool
    coverage: Coverage
    channels: Mapping[str, Channel] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    tests: tuple[ModelTest, ...] = field(default_factory=tuple)
    accuracy: Accuracy | None = None
    shares: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def _say_how_good(self) -> tuple[str, ...]:
        return (self.accuracy.sentence, *self.remarks) if self.accuracy else self.remarks

    @property
    def bias(self) -> Array:
        """The bias (3,) of the calibration, in the unit of the readings."""
        return self.calibration.bias

    @property
    def matrix(self) -> Array:
        """The matrix (3, 3) of the calibration."""
        return self.calibration.matrix

    def with_findings(self, *more: Finding | None) -> Self:
        """The fit with further findings, refusals first; a refused fit boasts of no accuracy."""
        fit = replace(self, findings=sort_findings((*self.findings, *more)))
        return replace(fit, accuracy=None, remarks=()) if fit.verdict == "refused" else fit


def gather_evidence(
    fit: Fit,
    calibration: Affine,
    samples: Samples,
    readings: Array,
    normals: Array,
    usable: Mask,
    known_radius: float | None,
) -> Evidence:
    """What a fit leaves to be examined, of the usable rows.

    Parameters: the calibration with sources on board at their mean; readings (n, 3) without what
    sources add, and the normals (n, 3) of its ellipsoid at them; usable (n,); the radius of the
    readings, in their unit, as far as it is known beforehand.
    """
    assert fit.residuals is not None
    assert fit.weights is not None
    assert calibration.magnitude is not None
    gain = float(np.cbrt(np.linalg.det(calibration.matrix)))  # however its axes are turned
    rows = slice(None) if usable.all() else usable  # a slice copies nothing
    return Evidence(
        readings=readings[rows],
        time=None if samples.time is None else samples.time[rows],
        residuals=fit.residuals[rows],
        weights=fit.weights[rows],
        normals=normals[rows],
        bias=calibration.bias,
        shape=calibration.matrix / gain,
        radius=calibration.magnitude / gain,
        noise=fit.noise,
        coverage=fit.coverage,
        known_radius=known_radius,
        unknowns=UNKNOWNS.get(calibration.model, 9) if not fit.tests else 9,
        unit=samples.unit,
    )
