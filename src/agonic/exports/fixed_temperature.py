"""Holding a calibration that changes with temperature at one, and what that costs.

    error = (W₀ W(T)⁻¹ − 1) m + W₀ (b(T) − b₀(T)),   |m| the field's magnitude

with W₀ the matrix that a target holds and b₀ its bias: constant, or a polynomial of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.calibration.steps import find_magnitude, require_calibration
from agonic.errors import AgonicError, ValidityError
from agonic.exports.polynomials import (
    changes_with_temperature,
    evaluate_affine,
    find_range_C,
    list_signals,
)
from agonic.exports.targets import TARGETS, list_words
from agonic.health.finding import figure

LEVELS = 121
"""Temperatures at which the error is looked at."""
ASCENTS = 60
USUAL = 50_000.0
"""The field where its magnitude is not known, nT."""


@dataclass(frozen=True, kw_only=True)
class Remainder:
    """The error of a field over a range of temperatures: over all directions of the field.

    `largest` is at `at_C`, `rms` over directions and the range, both in `unit`; `largest_deg` is
    the angle by which an error so large can turn the field.
    """

    largest: float
    largest_deg: float
    at_C: float
    rms: float
    unit: str
    range_C: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.range_C
        return (
            f"over {low:.4g} to {high:.4g} C the field is off by up to {self.largest:.0f} "
            f"{self.unit} ({self.largest_deg:.2g} deg), at {self.at_C:.4g} C; rms {self.rms:.0f} "
            f"{self.unit}"
        )


def compute_remainder(
    calibration: Calibration,
    temperature_C: float,
    *,
    bias_at: Callable[[Array], Array] | None = None,
) -> Remainder:
    """What the matrix of one temperature, and the biases (n, 3) of `bias_at`, leave in the field.

    Parameters: `bias_at` gives the bias that the target takes off at temperatures (n,); default:
    that of `temperature_C` always. The mean square of the first term of the equation above over
    directions is |m|² times a third of the squared Frobenius norm; the largest sum is searched.

    >>> from agonic.calibration.thermal import Thermal
    >>> warm = Thermal(bias=[[0, 0, 0], [50, 0, 0]], matrix=[np.eye(3), np.zeros((3, 3))],
    ...                centre_C=20.0, half_range_C=30.0)
    >>> str(compute_remainder(warm, 20.0)).split(",")[0]
    'over -10 to 50 C the field is off by up to 50 nT (0.057 deg)'
    """
    low, high = find_range_C(calibration)
    levels = np.linspace(low, high, LEVELS)
    bias, matrix, _ = evaluate_affine(calibration, levels)
    (bias0,), (matrix0,), _ = evaluate_affine(calibration, temperature_C)
    taken = bias0 if bias_at is None else bias_at(levels)
    turned = matrix0 @ np.linalg.inv(matrix) - np.eye(3)
    shift = (bias - taken) @ matrix0.T
    size = _size(calibration, bias0, matrix0)
    worst = _find_largest(size * turned, shift)
    square = size**2 * np.linalg.norm(turned, axis=(1, 2)) ** 2 / 3 + (shift**2).sum(axis=1)
    at = int(worst.argmax())
    return Remainder(
        largest=float(worst[at]),
        largest_deg=float(np.degrees(np.arcsin(min(worst[at] / size, 1.0)))),
        at_C=float(levels[at]),
        rms=float(np.sqrt(square.mean())),
        unit=calibration.unit_out,
        range_C=(low, high),
    )


def hold_temperature(
    calibration: Calibration, temperature_C: float | None
) -> tuple[Calibration, tuple[str, ...]]:
    """The calibration at one temperature, for a target that holds no other, and what is lost.

    One that does not change with temperature comes back as it is. Raises `AgonicError` where a
    temperature is needed and missing or the other way round, `ValidityError` outside the range.

    >>> from agonic.calibration.thermal import Thermal
    >>> warm = Thermal(bias=[[0, 0, 0], [50, 0, 0]], matrix=[np.eye(3), np.zeros((3, 3))],
    ...                centre_C=20.0, half_range_C=30.0)
    >>> one, warnings = hold_temperature(warm, 50.0)
    >>> one.bias.tolist(), warnings[0].split(":")[0]
    ([50.0, 0.0, 0.0], 'held at 50 C')
    """
    known = require_calibration(calibration)
    if not changes_with_temperature(known):
        if temperature_C is not None:
            raise AgonicError(
                f"the calibration of {known.sensor} does not change with temperature; leave the "
                "temperature out"
            )
        return known, ()
    low, high = find_range_C(known)
    within = f"{low:.4g} to {high:.4g} °C"
    if temperature_C is None:
        able = [name for name, target in TARGETS.items() if target.thermal]
        raise AgonicError(
            f"the calibration of {known.sensor} changes with temperature and the target holds one "
            f"temperature: say which (--temperature, in Python temperature_C), within {within}; "
            f"{list_words(able, 'and')} hold more than one"
        )
    require_within(known, temperature_C)
    lost = f"held at {temperature_C:.4g} C: {compute_remainder(known, temperature_C)}"
    return known.at(temperature_C), (lost, *describe_lag(known))  # type: ignore[union-attr]


def require_within(calibration: Calibration, temperature_C: float) -> None:
    """Raise `ValidityError` for a temperature outside the range of a calibration."""
    low, high = find_range_C(calibration)
    if not low <= temperature_C <= high:
        raise ValidityError(
            f"{temperature_C:.4g} °C is outside {low:.4g} to {high:.4g} °C, for which "
            f"{calibration.sensor} was calibrated"
        )


def describe_lag(calibration: Calibration) -> tuple[str, ...]:
    """A warning where the target leaves out what the bias lags by while the temperature changes."""
    names = list_signals(calibration)
    if "temperature_rate" not in names:
        return ()
    _, (matrix,), (rates,) = evaluate_affine(calibration, np.mean(find_range_C(calibration)))
    size = np.linalg.norm(matrix @ rates[:, names.index("temperature_rate")]) / 60
    return (
        f"the target has no term for the rate of the temperature: {figure(float(size), 3)} "
        f"{calibration.unit_out} for each degree C per minute stay in the field",
    )


def _find_largest(turned: Array, shift: Array) -> Array:
    """The largest |A u + c| (n,) over directions u, for A (n, 3, 3) and c (n, 3).

    By the ascent u ← Aᵀ(A u + c), made a unit vector, from both ends of each singular direction.
    Source: Journée, Nesterov, Richtárik & Sepulchre (2010), Generalized power method for sparse
    principal component analysis, J. Mach. Learn. Res. 11, 517-553, algorithm 1.
    """
    axes = np.linalg.svd(turned)[2]
    u = np.concatenate([axes, -axes], axis=1)
    for _ in range(ASCENTS):
        upwards = (u @ turned.transpose(0, 2, 1) + shift[:, None]) @ turned
        length = np.linalg.norm(upwards, axis=2, keepdims=True)
        u = np.divide(upwards, length, out=u, where=length > 0)
    found = np.linalg.norm(u @ turned.transpose(0, 2, 1) + shift[:, None], axis=2)
    return np.asarray(found.max(axis=1))


def _size(calibration: Calibration, bias: Array, matrix: Array) -> float:
    """The magnitude of the field, in `unit_out`."""
    unknown = USUAL if calibration.unit_out == "nT" else float(np.linalg.norm(matrix @ bias))
    return find_magnitude(calibration) or unknown or 1.0
