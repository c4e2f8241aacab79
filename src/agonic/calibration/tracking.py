"""`TrackerState`: where a followed calibration stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracker_params import TrackerParams as TrackerParams
from agonic.maths.equation import gauge
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.filters.states import FilterState
from agonic.maths.rotations.polar import RotationPart
from agonic.provenance import Provenance
from agonic.readable import Shown

SETTLED = 0.05
"""Of the field: the largest standard error of a bias that is known, beside a gyro."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Jump:
    """A jump of the bias: the reading at which it began, when it was seen, and what it was.

    `time` and `seen` in seconds of the readings; `shift` (3,) and its standard error `shift_sd`
    (3,), in the unit of the readings, as soon as the bias is settled again.
    """

    time: Annotated[float, Shown(key="time_s")]
    seen: Annotated[float, Shown(key="seen_s")]
    shift: Annotated[Array, Shown()]
    shift_sd: Annotated[Array, Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """The first readings after a start or a jump, kept until the bias has settled.

    While little is known the residuals are not linear in what is unknown, so these `rows` (k, 6)
    are taken together again and again, from the state `prior` to them (beside a gyro (k, 9), once,
    for their noise); `before` is the
    state before a jump, `outliers` how many readings did not fit since they were last taken
    together, `None` before the first time; `learns` whether enough was known then for the filter to
    learn from what comes until the next time.
    """

    prior: FilterState
    rows: Array
    before: FilterState | None = None
    outliers: int | None = None
    learns: bool = False


class Recent(NamedTuple):
    """The last readings, rows (k, 6), and the filter before the first and before the middle one.

    A jump is seen some readings after it began; from here the filter goes back to before it. Beside
    a gyro it goes on, and there are no rows: `before` is what was known before a jump that is not
    measured yet.
    """

    before: FilterState
    middle: FilterState
    rows: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackerState:
    """Where a followed calibration stands: everything that the next reading needs.

    `base` is the calibration it started from; where that changed with temperature, `ground` is it
    and `base` what it is at its middle temperature; where it took out what disturbs on board,
    `aboard` is it and `base` what it is with all of that switched off. `estimate` is the
    filter's, with its covariance, `noise` of one reading on one axis; `n` readings were seen,
    `refused` of them not used; `jumps` are all jumps so far; `epoch` is the UTC moment of time
    zero, if known; `magnitude` the last reference magnitude, nT; `external_sd`, nT, and
    `external_time_s` of errors with memory, as the reference states them or as the readings show.
    """

    base: Affine
    turned: RotationPart
    estimate: FilterState
    noise: Annotated[float, Shown()]
    noise_known: bool = True
    opening: Opening | None = None
    recent: Recent | None = None
    n: Annotated[int, Shown()] = 0
    refused: Annotated[int, Shown()] = 0
    jumps: Annotated[tuple[Jump, ...], Shown()] = ()
    epoch: datetime | None = None
    magnitude: float | None = None
    ground: Thermal | None = None
    aboard: Interference | None = None
    external_sd: float = 0.0
    external_time_s: float = 600.0
    gyro_unused: str = ""

    def moved(self, **changed: object) -> TrackerState:
        """The state with some facts replaced: as `replace`, at a fraction of its time."""
        other = object.__new__(TrackerState)
        other.__dict__.update(self.__dict__, **changed)
        return other

    def settle_params(self, params: TrackerParams) -> TrackerParams:
        """The settings with what was found of errors with memory, where it was not given."""
        if params.external_sd is not None or not self.external_sd:
            return params
        return params.with_external(self.external_sd, self.external_time_s)

    @property
    def time(self) -> float:
        """Seconds since `epoch` of the last reading; −infinity before the first."""
        return self.estimate.time if self.n else -np.inf

    @property
    def bias(self) -> Annotated[Array, Shown()]:
        """The bias now, (3,), in the unit of the readings."""
        return self.estimate.bias

    @property
    def bias_sd(self) -> Annotated[Array, Shown()]:
        """Its standard error, (3,), errors that last included."""
        sd = self.estimate.inflation.factor * np.sqrt(np.diag(self.estimate.covariance))
        return np.asarray(sd[self.estimate.coefficients[:3]])

    @property
    def turn(self) -> FilterState | None:
        """The filter beside a gyro, with the field, gyro bias and delay; `None` without one."""
        return self.estimate if self.estimate.beside_gyro else None

    @property
    def settled(self) -> bool:
        """The bias is known well enough for the filter to run on its own."""
        if self.n == 0 or self.opening is not None:
            return False
        if self.turn is None:
            return True
        size = np.sqrt((self.turn.field**2).sum()) / float(np.mean(self.turn.matrix[:3]))
        largest = float(self.turn.find_sd("bias").max())
        return self.recent is None and largest < SETTLED * size

    @property
    def consistency(self) -> Annotated[float, Shown()]:
        """Innovations over their stated standard deviations, rms of the last thousand; about 1."""
        return self.estimate.consistency

    @property
    def calibration(self) -> Affine:
        """The calibration now, with its covariance, in the gauge of the one it started from."""
        bias, kept = self.estimate.bias, self.turned.covariance
        covariance = np.zeros((9, 9))
        covariance[3:, 3:] = kept[3:9, 3:9]
        chosen = self.estimate.coefficients
        larger, m = self.estimate.inflation.factor[chosen], len(chosen)
        stated = self.estimate.covariance[np.ix_(chosen, chosen)]
        covariance[:m, :m] = larger[:, None] * stated * larger
        symmetric = unpack_symmetric(self.estimate.matrix)
        if self.base.gauge == "triangular":
            matrix, covariance = gauge.make_triangular(symmetric, covariance)
        elif self.base.gauge == "free":
            matrix, covariance = self.turned.free(symmetric, covariance)
        else:
            matrix = symmetric
        return replace(
            self.base,
            bias=bias,
            matrix=matrix,
            covariance=covariance,
            noise=self.noise,
            model="full",
            magnitude=self.magnitude,
            unit_out="nT",
            provenance=Provenance(
                settings={"fit": "track", "readings": self.n, "refused": self.refused},
                method=("bierman-1977",),
                parents=self.base.provenance.parents,
            ),
        )

    def at_middle(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Readings (n, 3) as they would be at the middle temperature of the ground calibration.

        Parameters: raw (n, 3) in the unit of the ground calibration; columns (n,) that it needs.

        matrix(T₀)⁻¹ field + bias(T₀): what it knows of the temperature stays, its constant moves.
        What disturbs on board is taken out of the readings.
        """
        if self.aboard is not None:
            return self.aboard.cleaned(raw, **columns)
        if self.ground is None:
            return np.asarray(raw, dtype=np.float64)
        field = self.ground.correct(raw, **columns)
        return np.asarray(field @ np.linalg.inv(self.base.matrix).T + self.base.bias)

    @property
    def thermal(self) -> Thermal | None:
        """The ground calibration with its constants as they are now; `None` where there is none.

        The constants' covariance is the tracker's, that of the shape in temperature the ground's.
        """
        if self.ground is None:
            return None
        now, ground = self.calibration, self.ground
        covariance = None
        if ground.covariance is not None and now.covariance is not None:
            covariance = np.array(ground.covariance)
            constants = np.arange(len(now.covariance)) * (ground.degree + 1)
            covariance[constants] = covariance[:, constants] = 0.0
            covariance[np.ix_(constants, constants)] = now.covariance
        return replace(
            ground,
            bias=np.stack([now.bias, *ground.bias[1:]]),
            matrix=np.stack([now.matrix, *ground.matrix[1:]]),
            covariance=covariance,
            noise=now.noise,
            provenance=now.provenance,
        )

    @property
    def interference(self) -> Interference | None:
        """The calibration now with what disturbs on board; `None` where it knew of nothing.

        The covariance of bias and matrix is the tracker's, that of the coefficients the first's.
        """
        if self.aboard is None:
            return None
        now, first = self.calibration, self.aboard
        covariance = None
        if first.covariance is not None and now.covariance is not None:
            covariance, m = np.array(first.covariance), len(now.covariance)
            covariance[:m] = covariance[:, :m] = 0.0
            covariance[:m, :m] = now.covariance
        return replace(
            first,
            bias=now.bias,
            matrix=now.matrix,
            covariance=covariance,
            noise=now.noise,
            magnitude=now.magnitude,
            unit_out=now.unit_out,
            provenance=now.provenance,
        )
