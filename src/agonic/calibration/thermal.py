"""`Thermal`: bias and matrix that change with the sensor's temperature."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.calibration import schema_fields as form
from agonic.calibration.affine import FREE_PARAMETERS, LOWER, PARAMETERS, Affine
from agonic.calibration.base import Correction, Validity, lock_arrays, require_covariance
from agonic.errors import AgonicError, AgonicWarning
from agonic.maths.equation import polynomial
from agonic.maths.equation import temperature_model as kernel
from agonic.maths.equation.affine import correction_jacobian
from agonic.provenance import Provenance
from agonic.units import RAW

MARGIN_C = 0.5
"""So far beyond the range that was seen, a temperature still counts as inside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Thermal(Correction):
    """The correction over T, the sensor's own temperature.

        field = matrix(T) @ (raw − bias(T))
        bias(T) = Σ_k bias[k] xᵏ + rate dT/dt,   matrix(T) = Σ_k matrix[k] xᵏ,
        x = (T − centre_C) / half_range_C

    Parameters
    ----------
    bias : (p, 3) coefficients of the powers 0, 1, … of x, in the unit of the readings.
    matrix : (p, 3, 3) the same, nT per unit of the readings.
    centre_C, half_range_C : of the temperatures it was made from, so that x is −1…1 in them.
    rate : (3,) unit of the readings per °C/s: what the bias lags by while the temperature changes
        (hysteresis); `None` where there is no such term.
    covariance : (a, a) of `parameters`; or `None` where it is not known.
    validity : its `temperature_C` is the range; beyond it corrections are extrapolated, with a
        warning (`AgonicWarning`); `outside` says which.

    The others as in `Affine`.

    Examples
    --------
    >>> warm = Thermal(bias=[[100, 0, 0], [50, 0, 0]], matrix=[np.eye(3), np.zeros((3, 3))],
    ...                centre_C=20.0, half_range_C=30.0)
    >>> warm.correct([[1000.0, 0.0, 0.0]], temperature=[50.0])
    array([[850.,   0.,   0.]])
    >>> warm.at(20.0).bias.tolist()
    [100.0, 0.0, 0.0]
    """

    kind: ClassVar[str] = "thermal"

    centre_C: Annotated[float, form.described("Temperature at x = 0, °C.")]
    half_range_C: Annotated[float, form.described("From x = 0 to x = 1, °C.", gt=0)]
    bias: Annotated[
        Array,
        form.stored(tuple[form.Vector, ...], "Of each power of x, in unit_in.", min_length=1),
    ]
    matrix: Annotated[
        Array,
        form.stored(
            tuple[form.Matrix, ...],
            "Of each power of x, row by row, unit_out per unit_in.",
            min_length=1,
        ),
    ]
    rate: Annotated[
        Array | None,
        form.stored(form.Vector | None, "Added to the bias, unit_in per °C/s; null: none."),
    ] = None
    covariance: Annotated[
        Array | None,
        form.stored(
            form.Rows | None,
            f"Of {', '.join(PARAMETERS)}; in the gauge free, {', '.join(LOWER)} after "
            "them; each with all its powers, the rates last.",
        ),
    ] = None
    unit_in: form.Unit = "nT"
    unit_out: form.Unit = "nT"
    gauge: form.Gauge = "symmetric"
    magnitude: form.Magnitude = None
    noise: form.Noise = None
    sensor: form.Sensor = "mag"
    device_id: form.DeviceId = None
    frame_in: form.Frame = "m"
    frame_out: form.Frame = "m"
    validity: Validity = field(default_factory=Validity)
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        p = len(np.asarray(self.bias))
        if not self.half_range_C > 0:
            raise AgonicError(f"half_range_C is {self.half_range_C}; it must be above 0 °C")
        lock_arrays(self, bias=(p, 3), matrix=(p, 3, 3), rate=(3,))
        a = len(self.parameters)
        lock_arrays(self, covariance=(a, a))

    @property
    def needs(self) -> tuple[str, ...]:
        """The columns of the samples that it takes beside the readings."""
        return ("temperature",) if self.rate is None else ("temperature", "temperature_rate")

    @property
    def degree(self) -> int:
        """The order of the polynomials."""
        return len(self.bias) - 1

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of what `covariance` is about: each coefficient with its powers, then rates."""
        plain = FREE_PARAMETERS if self.gauge == "free" else PARAMETERS
        powers = [f"{name}_{k}" for name in plain for k in range(self.degree + 1)]
        return (*powers, *(() if self.rate is None else (f"rate_{axis}" for axis in "xyz")))

    @property
    def sd(self) -> Array | None:
        """Standard deviations of `parameters`."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    @property
    def range_C(self) -> tuple[float, float]:
        """The temperatures that it was made from."""
        low, high = self.centre_C - self.half_range_C, self.centre_C + self.half_range_C
        return self.validity.temperature_C or (low, high)

    @property
    def mean_gain(self) -> float:
        """The mean of the diagonal of the matrix at the centre of the range."""
        return float(np.trace(self.matrix[0]) / 3)

    def bias_at(self, temperature: ArrayLike) -> Array:
        """The bias (…, 3) at `temperature` (…), °C, not changing."""
        return np.asarray(self._powers(temperature) @ self.bias)

    def matrix_at(self, temperature: ArrayLike) -> Array:
        """The matrix (…, 3, 3) at `temperature` (…), °C."""
        return np.asarray(np.tensordot(self._powers(temperature), self.matrix, axes=1))

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The calibrated field of readings (…, 3) at temperatures (…), °C.

        Parameters: raw (…, 3) in `unit_in`; columns (…): `temperature`, °C, and where the
        calibration has a rate `temperature_rate`, °C/s (taken as 0 where it is not given). Warns
        (`AgonicWarning`) of temperatures outside the range.
        """
        values, temperature, rate = self._with(raw, columns)
        beyond = self.outside(temperature)
        if beyond.any():
            warnings.warn(self._beyond(temperature, beyond), AgonicWarning, stacklevel=2)
        left = values - self.bias_at(temperature)
        if self.rate is not None:
            left = left - rate[..., None] * self.rate
        return np.asarray(np.einsum("...ij,...j->...i", self.matrix_at(temperature), left))

    def uncertainty(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Covariance (n, 3, 3) of the calibrated field that the calibration itself contributes.

        Parameters: raw (n, 3) in `unit_in`; columns (n,) that are named in `needs`.
        """
        values, temperature, rate = self._with(np.atleast_2d(raw), columns)
        temperature = np.broadcast_to(temperature, values.shape[:1])
        phi, bias = self._powers(temperature), self.bias_at(temperature)
        if self.rate is not None:
            lag = np.broadcast_to(rate, values.shape[:1])[:, None]
            phi, bias = np.concatenate([phi, lag], axis=1), bias + lag * self.rate
        by = correction_jacobian(values, bias, self.matrix_at(temperature))
        layout = kernel.build_layout(self.degree, self.gauge, self.rate is not None)
        rows = kernel.chain_to_coefficients(by.reshape(-1, 12), layout, np.repeat(phi, 3, axis=0))
        rows = rows.reshape(len(values), 3, -1)
        return np.asarray(rows @ require_covariance(self.covariance) @ np.swapaxes(rows, 1, 2))

    def at(self, temperature_C: float) -> Affine:
        """The affine calibration that this is while the temperature stays at a value, °C."""
        shared = {f.name: getattr(self, f.name) for f in fields(Affine) if hasattr(self, f.name)}
        return Affine(
            **shared
            | {
                "bias": self.bias_at(temperature_C),
                "matrix": self.matrix_at(temperature_C),
                "covariance": None
                if self.covariance is None
                else self.covariance_at(temperature_C),
                "validity": replace(self.validity, temperature_C=(float(temperature_C),) * 2),
            }
        )

    def covariance_at(self, temperature_C: ArrayLike) -> Array:
        """Covariance (…, 9, 9), or (…, 12, 12) in the gauge free, of bias and matrix.

        Parameters: temperature_C (…), °C.
        """
        powers = self._powers(temperature_C)
        p = self.degree + 1
        count = len(PARAMETERS) if self.gauge != "free" else len(FREE_PARAMETERS)
        whole = require_covariance(self.covariance)[: count * p, : count * p].reshape(
            count, p, count, p
        )
        return np.asarray(np.einsum("...k,akbl,...l->...ab", powers, whole, powers))

    def sd_at(self, temperature_C: ArrayLike) -> Array:
        """Standard errors (…, 9 or 12) of bias and matrix at `temperature_C` (…)."""
        covariance = self.covariance_at(temperature_C)
        return np.asarray(np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)))

    def outside(self, temperature: ArrayLike) -> Mask:
        """Where `temperature` (…), °C, lies outside the range seen, by more than `MARGIN_C`."""
        values = np.asarray(temperature, dtype=np.float64)
        if self.validity.temperature_C is None:
            return np.zeros(values.shape, dtype=bool)
        low, high = self.validity.temperature_C
        return np.asarray((values < low - MARGIN_C) | (values > high + MARGIN_C))

    @property
    def equation(self) -> str:
        """The correction in words that hold for this calibration."""
        unit = "counts" if self.unit_in == RAW else self.unit_in
        lag = "" if self.rate is None else " - rate * dT/dt"
        return (
            f"field [{self.unit_out}] = matrix(T) @ (raw [{unit}] - bias(T){lag}), polynomials of "
            f"order {self.degree} in x = (T [°C] - {self.centre_C:g}) / {self.half_range_C:g}"
        )

    def _powers(self, temperature: ArrayLike) -> Array:
        x = polynomial.scale(temperature, self.centre_C, self.half_range_C)
        return polynomial.powers(x, self.degree)

    def _with(self, raw: ArrayLike, columns: dict[str, ArrayLike]) -> tuple[Array, Array, Array]:
        """Readings, temperature and rate as arrays."""
        if "temperature" not in columns:
            raise AgonicError(
                f"the calibration of {self.sensor} needs the temperature beside the readings: "
                "correct(raw, temperature=…), in °C"
            )
        temperature = np.asarray(columns["temperature"], dtype=np.float64)
        rate = np.asarray(columns.get("temperature_rate", 0.0), dtype=np.float64)
        values = np.asarray(raw, dtype=np.float64)
        return values, temperature, np.broadcast_to(rate, temperature.shape)

    def _beyond(self, temperature: Array, beyond: Mask) -> str:
        assert self.validity.temperature_C is not None
        low, high = self.validity.temperature_C
        far = temperature[beyond]
        return (
            f"{int(beyond.sum())} temperatures from {far.min():.1f} to {far.max():.1f} °C lie "
            f"outside {low:.1f} to {high:.1f} °C, for which {self.sensor} was calibrated; there "
            "the correction is extrapolated"
        )
