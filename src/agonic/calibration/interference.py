"""`Interference`: bias and matrix, and what on-board sources add to the readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import lock_arrays
from agonic.calibration.schema_fields import Name, Row, described, stored
from agonic.calibration.sources import list_columns, parse_source, stack_inputs
from agonic.calibration.sources import signals as signals
from agonic.calibration.timing import Timing, find_timing
from agonic.errors import AgonicError
from agonic.maths.equation import affine as kernel
from agonic.maths.equation.affine import FREE, join, model_basis, split


@dataclass(frozen=True, kw_only=True, eq=False)
class Interference(Affine):
    """The correction by a bias, a matrix and what recorded sources add.

        field = matrix @ (raw − bias − coefficients @ x)

    x is what was recorded of the sources: currents in amperes, the duty of motors, the throttle,
    the dipole of a torquer, or the readings of a second magnetometer. With the latter this is the
    3×6 mix of two sensors,

        field = matrix @ raw − (matrix @ coefficients) @ second − matrix @ bias,

    of which the mean of two sensors with equal and opposite disturbance is the case
    matrix = 1/2, coefficients = −1.

    Parameters
    ----------
    sources : the columns in x and their form: "current_A", "motor1_duty^1.5", "heater_A>0.5",
        "second" (three numbers); see `agonic.calibration.sources`.
    coefficients : (3, k), readings per unit of x.
    second_sensor : the name of the second magnetometer, where the sources have one.
    typical : (k,) what the sources were on average in the log, where it is known.
    timing_sd_s : standard errors of delays and time constants, by column, where they were found.
    covariance : (m, m) of `parameters`: those of an `Affine`, then the coefficients row by row.

    The others as in `Affine`; `bias` is that with x = 0.

    Examples
    --------
    >>> motors = Interference(bias=np.zeros(3), matrix=np.eye(3),
    ...                       sources=("current_A",), coefficients=[[100.0], [0.0], [50.0]])
    >>> motors.correct([[3000.0, 0.0, 0.0]], current_A=[10.0])
    array([[2000.,    0., -500.]])
    """

    kind: ClassVar[str] = "interference"

    sources: Annotated[
        tuple[Name, ...],
        described(
            "Columns in x, each as it is, to a power (motor1_duty^1.5) or 1 above a "
            "value (heater_A>0.5), recorded late (@0.2) or through a filter (~0.3; the field "
            "follows it: ~-2), s; second is another magnetometer, three numbers."
        ),
    ]
    coefficients: Annotated[
        Array, stored(tuple[Row, Row, Row], "Row by row, unit_in per unit of x.")
    ]
    second_sensor: Annotated[
        str | None, described("The name of the second magnetometer, where it is a source.")
    ] = None
    typical: Annotated[
        Array | None, stored(Row | None, "What the sources were on average in the log.")
    ] = None
    timing_sd_s: Annotated[
        Mapping[str, float],
        stored(
            dict[str, float], "Standard errors of delays and time constants that were found, s."
        ),
    ] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.sources:
            raise AgonicError("sources is empty; name what disturbs, as current_A or motor1_duty")
        width = sum(parse_source(name).width for name in self.sources)
        find_timing(self.sources)
        if len(set(self.sources)) < len(self.sources):
            raise AgonicError(f"a source is named twice: {', '.join(self.sources)}")
        object.__setattr__(self, "sources", tuple(self.sources))
        lock_arrays(self, coefficients=(3, width), typical=(width,))
        super().__post_init__()

    @property
    def needs(self) -> tuple[str, ...]:  # type: ignore[override]
        """The columns of the samples that it takes beside the readings."""
        return list_columns(self.sources)

    @property
    def timing(self) -> dict[str, Timing]:
        """How the columns that are recorded late or filtered go with what they do."""
        return find_timing(self.sources)

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of what `covariance` is about, in its order."""
        named = [f"{axis}_per_{name}" for axis in "xyz" for name in signals(self.sources)]
        return (*super().parameters, *named)

    def cleaned(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The readings (…, 3) without what the sources add: raw − coefficients @ x.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        added = stack_inputs(self.sources, None, columns) @ self.coefficients.T
        return np.asarray(np.asarray(raw, dtype=np.float64) - added)

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The calibrated field of readings (…, 3) beside the columns that it needs.

        Parameters: raw (…, 3) in `unit_in`; columns (…) that are named in `needs`.
        """
        return kernel.correct(self.cleaned(raw, **columns), self.bias, self.matrix)

    def sensitivity(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """How the calibrated field changes with `parameters`, (n, 3, m).

        Parameters: raw (n, 3) in `unit_in`; columns (n,) that are named in `needs`.
        """
        x = np.atleast_2d(stack_inputs(self.sources, None, columns))
        affine = super().sensitivity(np.atleast_2d(self.cleaned(raw, **columns)))
        added = -(self.matrix[:, :, None] * x[:, None, None, :]).reshape(len(x), 3, -1)
        return np.concatenate([affine, added], axis=2)

    def at(self, x: ArrayLike) -> Affine:
        """The affine calibration that this is while the sources stay at x (k,)."""
        x = np.asarray(x, dtype=np.float64)
        covariance = self.covariance
        if covariance is not None:
            m = len(super().parameters)
            onto = np.zeros((m, len(covariance)))
            onto[:, :m] = np.eye(m)
            onto[:3, m:] = np.kron(np.eye(3), x)
            covariance = onto @ covariance @ onto.T
        plain = {f.name: getattr(self, f.name) for f in fields(Affine)}
        return Affine(
            **plain | {"bias": self.bias + self.coefficients @ x, "covariance": covariance}
        )

    @property
    def equation(self) -> str:
        """The correction in words that hold for this calibration."""
        plain = super().equation
        return f"{plain[:-1]} - coefficients @ ({', '.join(signals(self.sources))}))"


def mean_of(first: Affine, second: Affine) -> Interference:
    """The mean of two calibrated magnetometers, as a correction of the first beside the second.

        field = ½ W₁ (raw − b₁) + ½ W₂ (second − b₂)

    It cancels a disturbance that is equal and opposite at the two places, and halves one that only
    one of them sees.

    >>> mean_of(Affine(bias=np.zeros(3), matrix=np.eye(3)),
    ...         Affine(bias=np.zeros(3), matrix=np.eye(3))).coefficients.tolist()
    [[-1.0, -0.0, -0.0], [-0.0, -1.0, -0.0], [-0.0, -0.0, -1.0]]
    """
    ends = [(c.unit_in, c.unit_out, c.frame_in, c.frame_out) for c in (first, second)]
    if ends[0] != ends[1]:
        raise AgonicError(f"the two calibrations must share units and axes; they have {ends}")
    across = np.asarray(np.linalg.solve(first.matrix, second.matrix), dtype=np.float64)
    plain = {f.name: getattr(first, f.name) for f in fields(Affine)}
    return Interference(
        **plain
        | {
            "bias": first.bias + across @ second.bias,
            "matrix": first.matrix / 2,
            "gauge": "free",
            "covariance": None,
        },
        sources=("second",),
        coefficients=-across,
        second_sensor=second.sensor,
    )


def turn_calibration(calibration: Affine, turn: Array) -> Affine:
    """A calibration of turned readings, for the readings as they were; turn (3, 3) by which."""
    return _turn(calibration, turn, np.eye(3))


def turn_field(calibration: Affine, turn: Array) -> Affine:
    """A calibration whose field is turned into body axes; turn (3, 3) by which."""
    return _turn(calibration, np.eye(3), turn)


def _turn(calibration: Affine, first: Array, last: Array) -> Affine:
    """The calibration of readings that are turned first, and its field at last."""
    held = {f.name: getattr(calibration, f.name) for f in fields(calibration)}
    held |= {
        "bias": first.T @ calibration.bias,
        "matrix": last @ calibration.matrix @ first,
        "gauge": FREE,
        "frame_out": "b",
        "covariance": _turn_covariance(calibration, first, last),
    }
    if isinstance(calibration, Interference):
        held["coefficients"] = first.T @ calibration.coefficients
    return type(calibration)(**held)


def _turn_covariance(calibration: Affine, first: Array, last: Array) -> Array | None:
    if calibration.covariance is None:
        return None
    before, after = model_basis("full", calibration.gauge), model_basis("full", FREE)
    bias, matrix = split(before.T)
    local = join(bias @ first, last @ matrix @ first)
    columns = np.linalg.lstsq(after, local.T, rcond=None)[0]
    k = before.shape[1]
    more = len(calibration.covariance) - k  # coefficients of sources, axis by axis
    change = np.zeros((len(columns) + more, k + more))
    change[: len(columns), :k] = columns
    change[len(columns) :, k:] = np.kron(first.T, np.eye(more // 3)) if more else 0.0
    return np.asarray(change @ calibration.covariance @ change.T)
