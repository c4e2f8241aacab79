"""`TrackerState`: where a followed calibration stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, check_choice
from agonic.maths.equation import gauge
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.filters.states import BY_MAGNITUDE, FilterState, Model
from agonic.maths.rotations.polar import RotationPart
from agonic.provenance import Provenance
from agonic.readable import Shown

Solve = Literal["bias", "gains", "full"]

_GYRO = ("gyro_bias_sd", "gyro_walk", "delay_sd_s", "field_walk")
_NOT_NEGATIVE = ("walk", "matrix_walk", "external_sd", "jump_level", "history_s", *_GYRO)
_POSITIVE = ("noise", "external_time_s", "gate", "jump_sd", "bias_sd", "matrix_sd", "gyro_noise")


@dataclass(frozen=True, kw_only=True)
class TrackerParams:
    """How a calibration is followed: what moves, how fast, and what is known before.

    Parameters
    ----------
    solve : "bias", "gains" (bias and the diagonal of the matrix) or "full"; the rest is fixed.
    noise : sd of one reading on one axis, in the unit of the readings; `None`: that of the
        starting calibration, or else estimated from the first readings.
    walk : random walk of each bias, in the unit of the readings per √s: after t seconds it has
        moved by walk·√t.
    matrix_walk : the same of each entry of the matrix.
    external_sd, external_time_s : what the reference magnitude leaves out (crust, ring current):
        sd, nT, and correlation time; `None`: what the reference states, and what noise with memory
        the first readings show, with its own time.
    bias_sd : how far the bias may have moved since the starting calibration, beside its own
        standard error; `None`: a twentieth of the field, or, without a calibration, all of it.
    matrix_sd : how far each entry of the matrix may be from the starting one; `None`: nothing
        beside its standard error, or, without a calibration, 0.1.
    gate : a reading further than this many standard deviations from its prediction is refused.
    jump_level : χ² of three degrees of freedom above which a jump is announced; 0: never.
    jump_sd : the size of jump to expect, in the unit of the readings.
    history_s : seconds between the moments at which bias and band are kept; 0: never.
    gyro : follow also by how the field turns; `None`: where there is a gyro and it turns so.
    gyro_noise, gyro_bias_sd, gyro_walk : its noise density, rad/√s, its bias, rad/s, and how far
        that walks, rad/s per √s.
    delay_sd_s : how late the magnetometer may be behind the gyro, s; 0: not at all.
    field_walk : how far the field itself changes where the sensor moves, nT per √s.

    Examples
    --------
    >>> TrackerParams(walk=0.5).solve
    'full'
    """

    solve: Solve = "full"
    noise: float | None = None
    walk: float = 0.0
    matrix_walk: float = 0.0
    external_sd: float | None = None
    external_time_s: float = 600.0
    bias_sd: float | None = None
    matrix_sd: float | None = None
    gate: float = 5.0
    jump_level: float = 50.0
    jump_sd: float = 2000.0
    history_s: float = 60.0
    gyro: bool | None = None
    gyro_noise: float = 1e-3
    gyro_bias_sd: float = 0.05
    gyro_walk: float = 1e-5
    delay_sd_s: float = 0.02
    field_walk: float = 50.0

    def __post_init__(self) -> None:
        check_choice("solve", self.solve, tuple(BY_MAGNITUDE.sizes))
        for name in (*_NOT_NEGATIVE, *_POSITIVE):
            value = getattr(self, name)
            low = value is not None and (value < 0 or (value == 0 and name in _POSITIVE))
            if low or (value is not None and not np.isfinite(value)):
                least = "zero or more" if name in _NOT_NEGATIVE else "above zero"
                raise AgonicError(f"{name} is {value}; it must be {least}")

    def model(self, noise: float, jumps: bool = True) -> Model:
        """What the kernel takes, to look for jumps or not; made once, not with every reading."""
        made = self._made.get((noise, jumps))
        if made is None:
            names = set(Model._fields) & set(self.__dataclass_fields__)
            known = {name: getattr(self, name) for name in names}
            known |= {"noise": noise, "external_sd": self.external_sd or 0.0}
            made = Model(**known if jumps else known | {"jump_level": 0.0})
            self._made[noise, jumps] = made
        return made

    def with_external(self, sd: float, time_s: float) -> TrackerParams:
        """The settings with errors with memory; made once, not with every reading."""
        made = self._settled.get((sd, time_s))
        if made is None:
            made = replace(self, external_sd=sd, external_time_s=time_s)
            self._settled[sd, time_s] = made
        return made

    @cached_property
    def _made(self) -> dict[tuple[float, bool], Model]:
        return {}

    @cached_property
    def _settled(self) -> dict[tuple[float, float], TrackerParams]:
        return {}


MAX_SETTLED_SD = 0.05
"""Of the field: the largest standard error of a bias that is known, beside a gyro."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Jump:
    """A jump of the bias: the reading at which it began, when it was seen, and what it was. `time`
    and `seen` in seconds of the readings; `shift` (3,) and its standard error `shift_sd` (3,), in
    the unit of the readings, as soon as the bias is settled again."""

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
        return self.recent is None and largest < MAX_SETTLED_SD * size

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
        constants = np.arange(len(now.parameters)) * (ground.degree + 1)
        return replace(
            ground,
            bias=np.stack([now.bias, *ground.bias[1:]]),
            matrix=np.stack([now.matrix, *ground.matrix[1:]]),
            covariance=_put_in(ground.covariance, now.covariance, constants),
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
        return replace(
            first,
            bias=now.bias,
            matrix=now.matrix,
            covariance=_put_in(first.covariance, now.covariance, np.arange(len(now.parameters))),
            noise=now.noise,
            magnitude=now.magnitude,
            unit_out=now.unit_out,
            provenance=now.provenance,
        )


def _put_in(whole: Array | None, part: Array | None, rows: Index) -> Array | None:
    """`whole` with `part` in the given rows and columns, uncorrelated with the others."""
    if whole is None or part is None:
        return None
    made = np.array(whole)
    made[rows] = made[:, rows] = 0.0
    made[np.ix_(rows, rows)] = part
    return made
