"""What every calibration has in common, and applying one to samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.timing import restore
from agonic.errors import AgonicError, FrameError, LogError, UnitError
from agonic.maths.estimation.series import compute_rates
from agonic.provenance import Provenance
from agonic.readable import Readable
from agonic.samples import Samples


class Valued(Readable):
    """Equal where all that it holds is equal, to the last bit of every number."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return bool(_key(self) == _key(other))

    def __hash__(self) -> int:
        return hash(_key(self))


def _key(value: Any) -> Any:
    """A value as what can be compared and hashed."""
    if hasattr(value, "as_matrix"):  # a Rotation; what only reads a log loads no SciPy
        return _key(value.as_matrix().round(12))  # a file holds it as a quaternion
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0.0).tobytes()  # the sum turns −0 into 0
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__, tuple(_key(getattr(value, f.name)) for f in fields(value))
    if isinstance(value, Mapping):
        return tuple(sorted((str(name), _key(one)) for name, one in value.items()))
    if isinstance(value, list | tuple):
        return tuple(map(_key, value))
    return value


_OTHER_UNIT_FACTOR = 300.0
"""Readings so many times off are in another unit; a shield or a magnet does not do that."""


@dataclass(frozen=True, kw_only=True)
class Validity:
    """Where a calibration may be used: largest reading seen (per axis) and temperatures, °C."""

    largest_reading: float | None = None
    temperature_C: tuple[float, float] | None = None

    @classmethod
    def of(cls, samples: Samples) -> Validity:
        """What samples have seen."""
        warm = samples.temperature
        return cls(
            largest_reading=float(np.abs(samples.field).max()),
            temperature_C=None if warm is None else (float(warm.min()), float(warm.max())),
        )


class Calibration(Protocol):
    """A correction that can be saved: readings in, field out."""

    kind: ClassVar[str]

    @property
    def needs(self) -> tuple[str, ...]:
        """The columns of the samples that it takes beside the readings."""
        ...

    @property
    def unit_in(self) -> str: ...
    @property
    def unit_out(self) -> str: ...
    @property
    def frame_in(self) -> str: ...
    @property
    def frame_out(self) -> str: ...
    @property
    def sensor(self) -> str: ...
    @property
    def provenance(self) -> Provenance: ...
    @property
    def equation(self) -> str: ...

    def correct(self, raw: ArrayLike, **columns: ArrayLike) -> Array: ...


class Correction(Valued):
    """What every calibration can do beside correcting: be compared, read, and called."""

    def __call__(self, given: Any, **columns: ArrayLike) -> Any:
        """The field of readings (…, 3), as `correct`; of `Samples` and data frames, as `apply`."""
        calibration: Any = self
        if isinstance(given, Samples) or (hasattr(given, "columns") and hasattr(given, "index")):
            from agonic import apply as apply_to_any  # which knows data frames

            return apply_to_any(calibration, given)
        return calibration.correct(given, **columns)

    def _say(self) -> list[str]:
        calibration: Any = self
        lines = [f"{type(self).__name__} of {calibration.sensor!r}: {calibration.equation}"]
        bias, matrix = (np.asarray(getattr(self, name, 0.0)) for name in ("bias", "matrix"))
        if bias.ndim == 1 and matrix.ndim == 2:
            sd = getattr(self, "sd", None)
            known = "" if sd is None else f" ± {_write_row(sd[:3], 2)}"
            lines += [f"bias    {_write_row(bias)}{known} {calibration.unit_in}"]
            lines += [
                f"{'' if k else 'matrix':<8}{'  '.join(f'{value:9.6f}' for value in row)}"
                for k, row in enumerate(matrix)
            ]
        return lines


def _write_row(numbers: Any, digits: int = 6) -> str:
    """Numbers to some significant digits."""
    rounded = (float(f"{value:.{digits}g}") for value in np.asarray(numbers))
    return f"[{', '.join(f'{value:.{max(digits, 6)}g}' for value in rounded)}]"


def as_readings(raw: ArrayLike) -> Array:
    """Readings (…, 3) as numbers, or an error that says what is needed."""
    kind = type(raw).__name__
    if isinstance(raw, Samples):
        raise AgonicError("correct takes readings (n, 3); for samples use agonic.apply")
    try:
        array = np.asarray(raw, dtype=np.float64)
    except (TypeError, ValueError):
        raise AgonicError(f"readings were given as {kind}; needed are numbers (…, 3)") from None
    if array.shape[-1:] != (3,):
        raise AgonicError(f"readings of shape {array.shape} were given; needed are (…, 3)")
    return array


def check_size(raw: Array, calibration: Calibration, validity: Validity) -> None:
    """Raise `UnitError` where readings (…, 3) are all hundreds of times off those it was made
    from."""
    known, size = validity.largest_reading, _find_largest(raw)
    if not np.isfinite(size):
        size = _find_largest(raw[np.isfinite(raw)])
    if not known or not size or known / _OTHER_UNIT_FACTOR < size < known * _OTHER_UNIT_FACTOR:
        return
    raise UnitError(
        f"readings up to {size:.3g} were given where the calibration is of readings in "
        f"{calibration.unit_in}, up to {known:.5g}: they are in another unit; convert them, or "
        "read them with it"
    )


def _find_largest(values: Array) -> float:
    """The largest size of any values; NaN where one is."""
    return max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))


def read_only(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """`values` as an unwriteable float64 array of the given shape, finite throughout."""
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise AgonicError(f"{name} must be finite numbers of shape {shape}, not {array.shape}")
    array.flags.writeable = False
    return array


def lock_arrays(owner: object, **shapes: tuple[int, ...]) -> None:
    """Put unwriteable arrays of these shapes in the place of attributes; `None` stays."""
    for name, shape in shapes.items():
        value = getattr(owner, name)
        if value is not None:
            object.__setattr__(owner, name, read_only(name, value, shape))


def require_covariance(covariance: Array | None) -> Array:
    """The covariance of a calibration, or an error where it carries none."""
    if covariance is None:
        raise AgonicError("the calibration carries no covariance; fit it again with agonic")
    return covariance


def select_columns(calibration: Calibration, samples: Samples) -> dict[str, Array]:
    """The columns of the samples that the calibration needs beside the readings, by name. The rate
    at which the temperature changes, °C/s, is taken from time and temperature."""
    there = samples.columns()
    if "temperature_rate" in calibration.needs and {"time", "temperature"} <= set(there):
        there["temperature_rate"] = compute_rates(there["time"], there["temperature"])
    missing = [name for name in calibration.needs if name not in there]
    if missing:
        told = [name for name in missing if name != "temperature_rate" or "time" not in there]
        words = ", ".join(
            name.replace("temperature_rate", "time (for temperature_rate)") for name in told
        )
        raise LogError(
            f"the calibration of {calibration.sensor} needs {words} beside the readings and the "
            "samples have none; record it with the magnetometer"
        )
    at_rows = restore(there, getattr(calibration, "timing", {}))
    return {name: at_rows[name] for name in calibration.needs}


def has_two_axes(calibration: object) -> bool:
    """Whether a calibration, or a step of it, is that of a two-axis compass."""
    steps = getattr(calibration, "steps", (calibration,))
    return any(getattr(step, "model", None) == "ellipse" for step in steps)


def check_axes(calibration: Calibration, samples: Samples) -> None:
    """Raise `FrameError` where readings of two axes meet a calibration of three, or the reverse."""
    if has_two_axes(calibration) == (samples.axes == "xy"):
        return
    raise FrameError(
        f"{samples.name} and the calibration of {calibration.sensor} differ in their axes",
        left=samples.axes,
        right="xy" if samples.axes == "xyz" else "xyz",
    )


def apply(calibration: Calibration, samples: Samples) -> Samples:
    """The samples with their field corrected, in the unit and frame that the calibration gives.

    Raises `UnitError` and `FrameError` where calibration and samples do not meet, and `LogError`
    where the samples lack a column that the calibration needs.

    >>> from agonic.calibration.affine import Affine
    >>> apply(Affine(bias=[1, 0, 0], matrix=np.eye(3)), Samples(field=[[3.0, 0, 4]])).field
    array([[2., 0., 4.]])
    """
    if not isinstance(samples, Samples) or not hasattr(calibration, "correct"):
        given = f"{type(calibration).__name__}, {type(samples).__name__}"
        raise AgonicError(
            f"apply takes a calibration and samples, and was given {given}; samples are "
            "ag.read(path) or ag.Samples(field=array, unit=...), for an array there is "
            "calibration.correct(array)"
        )
    return samples.with_columns(
        field=correct_field(calibration, samples),
        unit=calibration.unit_out,
        frame=calibration.frame_out,
        logged=None,
    )


def check_readings(calibration: Calibration, samples: Samples) -> None:
    """Raise `UnitError`, `FrameError` or `AgonicError` where samples are not what it corrects."""
    if samples.unit != calibration.unit_in:
        raise UnitError(
            f"the calibration of {calibration.sensor} corrects readings in {calibration.unit_in} "
            f"and these are in {samples.unit}; read the log with the unit it was made in"
        )
    if samples.frame != calibration.frame_in:
        raise FrameError(
            f"the calibration of {calibration.sensor} was made in other axes",
            left=samples.frame,
            right=calibration.frame_in,
        )
    check_axes(calibration, samples)


def correct_field(calibration: Calibration, samples: Samples) -> Array:
    """The corrected field (n, 3) of every row, as the calibration makes it, whatever comes out.
    `apply` leaves rows out whose field is beyond what any sensor gives. Raises as `apply` does."""
    check_readings(calibration, samples)
    return calibration.correct(samples.field, **select_columns(calibration, samples))
