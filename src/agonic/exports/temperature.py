"""Calibrations that change with temperature, for targets that hold polynomials, or one temperature.

`Polynomials`: any calibration that changes with temperature, as C and tables can hold it.

    field = matrix(T) (raw − bias(T) − coefficients(T) x),   each number a polynomial of T

A chain with a step after its thermal one has a bias that is none: matrix(T)⁻¹ times the later
bias. The order is raised until what is left is below the rounding of float32.

Holding a calibration that changes with temperature at one, and what that costs.

    error = (W₀ W(T)⁻¹ − 1) m + W₀ (b(T) − b₀(T)),   |m| the field's magnitude

with W₀ the matrix that a target holds and b₀ its bias: constant, or a polynomial of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebpts1
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.interference import Interference
from agonic.calibration.network import Network
from agonic.calibration.sources import parse_source
from agonic.calibration.sources import signals as signals_of
from agonic.calibration.steps import find_magnitude, find_step, require_calibration, steps_of
from agonic.calibration.thermal import MARGIN_C, Thermal
from agonic.errors import AgonicError, ValidityError
from agonic.exports.targets import TARGETS, list_words
from agonic.health.finding import figure
from agonic.maths.equation import polynomial

MAX_DEGREE = 12
"""The highest order that is tried."""
MAX_ROUNDING = 2.0**-26
"""What may be left of a number, as a share of the largest of its kind: half of float32's own."""
MIN_COEFFICIENT = 2.0**-40
"""Coefficients so small beside the largest number of their kind are the rounding of the fit."""
RATE = "temperature_rate"
FOREVER_C = 1e4
"""Further than this no thermometer goes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Polynomials:
    """Coefficients of the powers 0, 1, … of x = (T − centre_C) / half_range_C. `bias` (p, 3),
    `matrix` (p, 3, 3), `coefficients` (p, 3, k) of the k `signals`; they hold from `low_C` to
    `high_C`, and by `MARGIN_C` beyond."""

    bias: Array
    matrix: Array
    coefficients: Array
    signals: tuple[str, ...]
    centre_C: float
    half_range_C: float
    low_C: float
    high_C: float

    @property
    def table(self) -> Array:
        """(p, 12 + 3 k): bias, matrix and coefficients, a row a power."""
        parts = (self.bias, self.matrix, self.coefficients)
        return np.concatenate([part.reshape(len(self.bias), -1) for part in parts], axis=1)

    @property
    def clamp_C(self) -> tuple[float, float]:
        """Where a controller stops following the temperature."""
        return self.low_C - MARGIN_C, self.high_C + MARGIN_C


def changes_with_temperature(calibration: Calibration) -> bool:
    """Whether a calibration depends on temperature, and is affine at each."""
    return "temperature" in calibration.needs and find_step(calibration, Network) is None


def find_range_C(calibration: Calibration) -> tuple[float, float]:
    """The temperatures for which all steps of a calibration were made."""
    ranges = [_range(step) for step in steps_of(calibration) if isinstance(step, Thermal)]
    if not ranges:
        raise AgonicError(f"{calibration.sensor} is calibrated at one temperature")
    low, high = max(r[0] for r in ranges), min(r[1] for r in ranges)
    if not low <= high:
        raise AgonicError("the steps of this calibration have no temperature in common")
    return low, high


def _range(step: Thermal) -> tuple[float, float]:
    if step.validity.temperature_C is not None:
        return step.validity.temperature_C
    return step.centre_C - step.half_range_C, step.centre_C + step.half_range_C


def evaluate_affine(
    calibration: Calibration, temperature_C: ArrayLike
) -> tuple[Array, Array, Array]:
    """Bias (n, 3), matrix (n, 3, 3) and coefficients (n, 3, k) of signals at temperatures (n,). At
    one temperature every calibration is affine in the reading and the signals, so the readings 0,
    e₁, e₂, e₃ and a unit of each signal tell all of it."""
    temperature = np.atleast_1d(np.asarray(temperature_C, dtype=np.float64))
    n, size = len(temperature), 1e5  # of a usual reading, for the rounding
    sources = [parse_source(name) for name in list_sources(calibration)]
    still = {
        name: np.full((n, 3)[: source.width // 3 + 1], source.off)
        for source in sources
        for name in source.columns
    }
    still["temperature"] = temperature

    def field(reading: Array, **moved: Array) -> Array:
        return calibration.correct(np.broadcast_to(reading, (n, 3)), **{**still, **moved})

    zero = field(np.zeros(3))
    matrix = np.stack([field(size * axis) - zero for axis in np.eye(3)], axis=2) / size
    added = []
    for source in sources:
        name = source.columns[0]
        for unit in np.eye(3) if source.width == 3 else (np.array(1.0),):
            added.append(field(np.zeros(3), **{name: still[name] + unit}))
    moved = np.stack([one - zero for one in added], axis=2) if added else np.zeros((n, 3, 0))
    both = -np.linalg.solve(matrix, np.concatenate([zero[:, :, None], moved], axis=2))
    return both[:, :, 0], matrix, both[:, :, 1:]


def list_sources(calibration: Calibration) -> tuple[str, ...]:
    """What a calibration takes beside reading and temperature, in order, each in its form."""
    return tuple(
        dict.fromkeys(
            name
            for step in steps_of(calibration)
            for name in (step.sources if isinstance(step, Interference) else step.needs)
            if name != "temperature"
        )
    )


def list_signals(calibration: Calibration) -> tuple[str, ...]:
    """The numbers beside reading and temperature that a calibration takes, in order."""
    return signals_of(list_sources(calibration))


def fit_polynomials(calibration: Calibration) -> Polynomials:
    """The polynomials of a calibration that changes with temperature, of the lowest order."""
    low, high = find_range_C(calibration)
    centre, half = _scale(calibration, low, high)
    reach = max((high - low) / 2, 0.0) + MARGIN_C
    nodes = (low + high) / 2 + reach * chebpts1(4 * MAX_DEGREE)
    values = evaluate_affine(calibration, nodes)
    table = np.concatenate([part.reshape(len(nodes), -1) for part in values], axis=1)
    # the size that the rounding of each number is measured by: the largest of its kind
    sizes = [max(float(np.abs(part).max(initial=0.0)), 1e-12) for part in values]
    largest = np.repeat(sizes, [part[0].size for part in values])
    x = polynomial.scale(nodes, centre, half)
    for degree in range(MAX_DEGREE + 1):
        powers = polynomial.powers(x, degree)
        found = np.linalg.lstsq(powers, table, rcond=None)[0]
        if (np.abs(powers @ found - table).max(axis=0) <= MAX_ROUNDING * largest).all():
            found[np.abs(found) < MIN_COEFFICIENT * largest] = 0.0
            bias, matrix, rest = np.split(found, [3, 12], axis=1)
            return Polynomials(
                bias=bias,
                matrix=matrix.reshape(-1, 3, 3),
                coefficients=rest.reshape(degree + 1, 3, -1),
                signals=list_signals(calibration),
                centre_C=centre,
                half_range_C=half,
                low_C=low,
                high_C=high,
            )
    raise AgonicError(
        f"no polynomial of order {MAX_DEGREE} follows this calibration over {low:g} to {high:g} "
        "°C; hold it at a temperature, or fit it again over a shorter range"
    )


def make_constant(calibration: Affine) -> Polynomials:
    """The polynomials of order 0 of a calibration that no temperature changes, for all of them."""
    mixed = calibration if isinstance(calibration, Interference) else None
    return Polynomials(
        bias=calibration.bias[np.newaxis],
        matrix=calibration.matrix[np.newaxis],
        coefficients=mixed.coefficients[np.newaxis] if mixed else np.zeros((1, 3, 0)),
        signals=signals_of(mixed.sources) if mixed else (),
        centre_C=0.0,
        half_range_C=1.0,
        low_C=-FOREVER_C,
        high_C=FOREVER_C,
    )


def _scale(calibration: Calibration, low: float, high: float) -> tuple[float, float]:
    """Centre and half range: those of the only thermal step, so that its numbers stay its own."""
    thermal = [step for step in steps_of(calibration) if isinstance(step, Thermal)]
    if len(thermal) == 1:
        return thermal[0].centre_C, thermal[0].half_range_C
    return (low + high) / 2, max((high - low) / 2, MARGIN_C)


LEVELS = 121
"""Temperatures at which the error is looked at."""
FIELD_NT = 50_000.0
"""The field where its magnitude is not known, nT."""


@dataclass(frozen=True, kw_only=True)
class Remainder:
    """The error of a field over a range of temperatures: over all directions of the field.
    `largest` is at `at_C`, `rms` over directions and the range, both in `unit`; `largest_deg` is
    the angle by which an error so large can turn the field."""

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
    """What the matrix of one temperature, and the biases (n, 3) of `bias_at`, leave in the
    field."""
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
    """The calibration at one temperature, for a target that holds no other, and what is lost. One
    that does not change with temperature comes back as it is. Raises `AgonicError` where a
    temperature is needed and missing or the other way round, `ValidityError` outside the range."""
    known = require_calibration(calibration)
    if not changes_with_temperature(known):
        require_temperature(temperature_C is None, known)
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


def require_temperature(meant: bool, calibration: Calibration) -> None:
    """Raise `AgonicError` where a temperature was given that means nothing to a calibration."""
    if not meant:
        raise AgonicError(
            f"the calibration of {calibration.sensor} does not change with temperature; leave the "
            "temperature out"
        )


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
    for _ in range(60):
        upwards = (u @ turned.transpose(0, 2, 1) + shift[:, None]) @ turned
        length = np.linalg.norm(upwards, axis=2, keepdims=True)
        u = np.divide(upwards, length, out=u, where=length > 0)
    found = np.linalg.norm(u @ turned.transpose(0, 2, 1) + shift[:, None], axis=2)
    return np.asarray(found.max(axis=1))


def _size(calibration: Calibration, bias: Array, matrix: Array) -> float:
    """The magnitude of the field, in `unit_out`."""
    unknown = FIELD_NT if calibration.unit_out == "nT" else float(np.linalg.norm(matrix @ bias))
    return find_magnitude(calibration) or unknown or 1.0
