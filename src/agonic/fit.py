"""`Fit`: a calibration with its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.coverage import Coverage
from agonic.health import Finding, Judged


@dataclass(frozen=True, kw_only=True)
class ModelTest:
    """One step of the nested tests: is the larger model needed?"""

    smaller: str
    larger: str
    statistic: float
    p_value: float
    sentence: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit(Estimated):
    """A calibration and what it rests on.

    `residuals` (n,) are distances from the model in the unit of the readings, a row a sample, and
    `weights` (n,) what the robust loss left of each reading, 0…1 (both `None` after a fit from
    moments, which keeps no readings); `noise` is the standard
    deviation of one reading on one axis; `correlation` is the correlation length,
    in readings (1 for white noise), already inside `covariance`; `condition` is that of the scaled
    information matrix; `channels` are the residuals by kind ("magnitude", "dip", "azimuth") where
    the attitude aided the fit; `findings` are all observations, by name; `tests` the choice of
    model. `covariance` (9, 9) is that of bias x y z, then matrix xx yy zz xy xz yz; (12, 12) where
    the matrix is free, with yx zx zy, and further with the coefficients of sources on board.
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
    remarks: tuple[str, ...] = ()
