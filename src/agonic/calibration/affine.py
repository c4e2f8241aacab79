"""`Affine`: bias and matrix, the calibration that most magnetometers need."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration import schema_fields as form
from agonic.calibration.base import (
    Correction,
    Validity,
    as_readings,
    check_size,
    lock_arrays,
    require_covariance,
)
from agonic.maths.equation import affine as kernel
from agonic.provenance import Provenance
from agonic.units import RAW

Model = Literal["sphere", "diagonal", "full", "ellipse"]

PARAMETERS = (
    "bias_x",
    "bias_y",
    "bias_z",
    "matrix_xx",
    "matrix_yy",
    "matrix_zz",
    "matrix_xy",
    "matrix_xz",
    "matrix_yz",
)
"""The order of `covariance`: nT (or raw units) for the bias, nT per raw unit for the matrix."""

FREE_PARAMETERS = (*PARAMETERS, "matrix_yx", "matrix_zx", "matrix_zy")
"""The same for a matrix that is neither symmetric nor triangular."""

LOWER = FREE_PARAMETERS[len(PARAMETERS) :]


@dataclass(frozen=True, kw_only=True, eq=False)
class Affine(Correction):
    """The correction by a bias and a matrix.

        field = matrix @ (raw − bias)

    Parameters
    ----------
    bias : (3,) in the unit of the readings: hard iron and the sensor's own zero.
    matrix : (3, 3), nT per unit of the readings: gains, non-orthogonality and soft iron.
    covariance : (9, 9) of `PARAMETERS`, in the gauge "free" (12, 12) of `FREE_PARAMETERS`; or
        `None` where it is not known.
    unit_in, unit_out : "nT" or "raw".
    gauge : "symmetric", "triangular" or "free": how the rotation that magnitude alone leaves
        open was fixed; free where something else determined it.
    model : "sphere", "diagonal" or "full"; "ellipse" of a two-axis compass: of z it says nothing.
    magnitude : the field magnitude it was scaled to, in `unit_out`.
    noise : standard deviation of one reading on one axis, in `unit_in`.
    sensor, frame_in, frame_out : whose readings, in which axes.
    device_id : the number by which an autopilot knows the sensor, if it does.
    latency_s : how late the readings came beside the attitude in the log it was made from; it is
        undone where the attitude counts (headings, checks), `correct` has no need of it.
    latency_sd_s : standard error of that, or `None` where nothing told it.

    Examples
    --------
    >>> Affine(bias=[10.0, 0.0, 0.0], matrix=np.eye(3) * 2).correct([[11.0, 1.0, 0.0]])
    array([[2., 2., 0.]])
    """

    kind: ClassVar[str] = "affine"
    needs: ClassVar[tuple[str, ...]] = ()

    bias: Annotated[Array, form.stored(form.Vector, "Subtracted from the readings, in unit_in.")]
    matrix: Annotated[Array, form.stored(form.Matrix, "Row by row, unit_out per unit_in.")]
    covariance: Annotated[
        Array | None,
        form.stored(
            form.Rows | None,
            f"Of {', '.join(PARAMETERS)}; in the gauge free, {', '.join(LOWER)} after "
            "them; of an interference, its coefficients row by row after those. Bias in unit_in, "
            "matrix in unit_out per unit_in.",
        ),
    ] = None
    unit_in: form.Unit = "nT"
    unit_out: form.Unit = "nT"
    gauge: form.Gauge = "symmetric"
    model: Model = "full"
    magnitude: form.Magnitude = None
    noise: form.Noise = None
    sensor: form.Sensor = "mag"
    device_id: form.DeviceId = None
    latency_s: Annotated[
        float, form.described("How late the readings came relative to the attitude, seconds.")
    ] = 0.0
    latency_sd_s: Annotated[
        form.NotNegative | None, form.described("Standard error of that; null: not determined.")
    ] = None
    frame_in: form.Frame = "m"
    frame_out: form.Frame = "m"
    validity: Validity = field(default_factory=Validity)
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        m = len(self.parameters)
        lock_arrays(self, bias=(3,), matrix=(3, 3), covariance=(m, m))

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of what `covariance` is about, in its order."""
        return FREE_PARAMETERS if self.gauge == "free" else PARAMETERS

    def cleaned(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The readings (…, 3) without what sources on board add: all of them, for none is known.

        Parameters: raw (…, 3) in `unit_in`; columns (…), not used.
        """
        return np.asarray(raw, dtype=np.float64)

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """The calibrated field of readings (…, 3): matrix @ (raw − bias).

        Parameters: raw (…, 3) in `unit_in`; columns (…), not used.
        """
        readings = as_readings(raw)
        check_size(readings, self, self.validity)
        return kernel.correct(readings, self.bias, self.matrix)

    def sensitivity(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """How the calibrated field changes with `parameters`, (n, 3, m).

        Parameters: raw (n, 3) in `unit_in`; columns (n,), not used.
        """
        rows = np.asarray(raw, dtype=np.float64)
        jacobian = kernel.correction_jacobian(rows, self.bias, self.matrix)
        return np.asarray(jacobian @ kernel.model_basis("full", self.gauge))

    def uncertainty(self, raw: ArrayLike, **columns: ArrayLike) -> Array:
        """Covariance (n, 3, 3) of the calibrated field that the calibration itself contributes.

        Parameters: raw (n, 3) in `unit_in`; columns (n,) that are named in `needs`.
        """
        covariance = require_covariance(self.covariance)
        jacobian = self.sensitivity(raw, **columns)
        return np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, 1, 2))

    @property
    def sd(self) -> Array | None:
        """Standard deviations of `parameters`."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))

    @property
    def scale_factors(self) -> Array:
        """Sensitivity of each sensor axis, raw units per nT: row lengths of A = matrix⁻¹."""
        return np.asarray(np.linalg.norm(np.linalg.inv(self.matrix), axis=1))

    @property
    def nonorthogonality_deg(self) -> Array:
        """How far the sensor axes are from square, degrees: xy, xz, yz; 0 is square."""
        axes = np.linalg.inv(self.matrix)
        axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        cosines = np.array([axes[0] @ axes[1], axes[0] @ axes[2], axes[1] @ axes[2]])
        return np.asarray(np.degrees(np.arcsin(cosines)))

    @property
    def multiplied_out(self) -> tuple[Array, Array]:
        """MR (3, 3) and MR0 (3,) of the twelve-number form, field = MR raw + MR0."""
        return self.matrix, -self.matrix @ self.bias

    @property
    def equation(self) -> str:
        """The correction in words that hold for this calibration."""
        unit = "counts" if self.unit_in == RAW else self.unit_in
        return f"field [{self.unit_out}] = matrix @ (raw [{unit}] - bias)"
