"""`ThermalFit`: a temperature calibration with its evidence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index, Mask
from agonic.calibration.thermal import Thermal
from agonic.fit import Estimated, ModelTest
from agonic.health import Finding
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Bins:
    """The nine coefficients at each temperature by themselves, cooling and heating apart.

    `temperature` (t,) °C; `cooling`, `heating` (t, 9) and their standard errors `cooling_sd`,
    `heating_sd`; NaN where stations are missing.
    """

    temperature: Array
    cooling: Array
    cooling_sd: Array
    heating: Array
    heating_sd: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Hysteresis:
    """Cooling less heating of the nine coefficients, averaged over temperature, (9,).

    `difference` and its standard error `sd`; `largest` the largest of the curve smoothed over
    5 °C. NaN where one of the directions was not recorded.
    """

    difference: Array
    sd: Array
    largest: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Spread:
    """Standard deviations of the readings at each station, before and after the correction.

    `stations` (k,) numbers; `before` and `after` (k, 4) of x, y, z and |B|, nT (or raw units).
    """

    stations: tuple[int, ...]
    before: Array
    after: Array

    @property
    def improvement(self) -> Array:
        """The largest of the stations before over the largest after, for x, y, z and |B|, (4,).

        Source: Nikolaev et al. 2023, table.
        """
        return np.asarray(self.before.max(axis=0) / self.after.max(axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Fixture:
    """What the orientations of the stations gave beside the coefficients.

    `mounting` turns the axes of the sensor into those of the box; `field_n` (3,) is the chamber's
    field in its axes; `turned_deg` by station how far it stood off, `sd_deg` their standard
    deviation as the readings show it.
    """

    mounting: Rotation
    field_n: Array
    turned_deg: Mapping[int, float]
    sd_deg: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Positions:
    """How the stations stood, as the readings show it.

    By station the field's unit direction in the axes of the sensor, the angle of the shortest turn
    from the first station, and its standard error. What a station was turned about the field
    itself no magnetometer sees.
    """

    direction: Mapping[int, Array]
    turn_deg: Mapping[int, float]
    turn_sd_deg: Mapping[int, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Anomaly:
    """Readings of a station that were left out: how many, and when (s), NaN without times."""

    station: int
    count: int
    times: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ThermalFit(Estimated):
    """A temperature calibration and what it rests on.

    `reference_kind` is "magnitude", "turns", "positions" (turns that were found from the readings)
    or "vector". `residuals` are those of the means of bins, (m,) along the normal of the ellipsoid
    or (m, 3), in the unit of the readings, at
    `temperature` (m,) of `station` (m,), while `heating` (m,) or not; `weights` (m,) what the
    robust loss left of each. With a vector reference they are those of the readings. `noise` is the
    standard deviation of one reading on one axis, `excess` that by which means of bins scatter
    beyond it (misfit, and changes of the chamber's field). `variances` (9, d) are the variances of
    the scaled residuals of the coefficients by order 0…d−1; with a vector reference and
    `degree="auto"` (1, d), those of the readings, nT² (raw units²). `drift` (1,) or (3,) is how
    much the field changed from the first to the last reading, along itself or in the chamber's
    axes, with `drift_sd`; `None` where that is not sure. So are `ageing` (3,) and `ageing_sd` of
    the bias, in the unit of the readings; the calibration is that of the middle. `field_sd` is the
    standard deviation of its slow changes (of its magnitude, or of each component), 0 where that
    they are there is not sure. With a vector reference `unseen_rms` is what is left, nT on an axis,
    of readings that the fit has not seen, and `alternatives` what would be with other models. The
    calibration and its covariance allow for what is not sure too.
    """

    calibration: Thermal
    reference_kind: Annotated[str, Shown()]
    n: Annotated[int, Shown()]
    residuals: Array
    weights: Array
    temperature: Array
    station: Index
    heating: Mask
    noise: Annotated[float, Shown(key="noise_nT")]
    excess: Annotated[float, Shown(key="excess_nT")]
    correlation: float
    condition: float
    iterations: int
    converged: bool
    bins: Bins | None = None
    variances: Array | None = None
    hysteresis: Hysteresis | None = None
    spread: Spread | None = None
    fixture: Fixture | None = None
    positions: Positions | None = None
    drift: Annotated[Array | None, Shown(key="drift_nT")] = None
    drift_sd: Array | None = None
    ageing: Annotated[Array | None, Shown(key="ageing_nT")] = None
    ageing_sd: Array | None = None
    field_sd: float = 0.0
    anomalies: tuple[Anomaly, ...] = ()
    findings: tuple[Finding, ...] = ()
    tests: tuple[ModelTest, ...] = field(default_factory=tuple)
    remarks: tuple[str, ...] = ()
    unseen_rms: Annotated[float | None, Shown(key="unseen_rms_nT")] = None
    alternatives: Annotated[Mapping[str, float], Shown(key="unseen_rms_with_nT")] = field(
        default_factory=dict
    )
