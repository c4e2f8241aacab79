"""What bias and matrix may depend on: time, temperature, and currents on board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from agonic.arrays import Array
from agonic.calibration.sources import list_columns, signals, stack_inputs
from agonic.calibration.timing import find_timing, restore
from agonic.errors import CoverageError, LogError
from agonic.maths.equation import polynomial
from agonic.samples import Samples

DEGREE = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift:
    """A bias in time: bias(t) = constant + coefficients @ (spline(t) − middle), nT.

    `knots` is the spline's full knot vector, empty for a constant bias; `covariance` that of the
    constant, then the coefficients row by row; `start` and `stop` are the ends of the record, s.
    """

    knots: Array
    middle: Array
    constant: Array
    coefficients: Array
    covariance: Array
    start: float
    stop: float

    @property
    def changes(self) -> bool:
        """Whether the bias is anything but constant."""
        return self.intervals > 0

    @property
    def intervals(self) -> int:
        """Even stretches of time that the spline has, 0 for a constant bias."""
        return max(len(self.knots) - 2 * DEGREE - 1, 0)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Bias (k, 3) and its standard error (k, 3); outside the record that of its end."""
        within = np.clip(time, self.start, self.stop)
        terms = evaluate_spline(within, self.knots) - self.middle
        bias = self.constant + terms @ self.coefficients.T
        by_axis = np.kron(np.eye(3), terms[:, None])  # (n, 3, 3 k)
        jacobian = np.concatenate([np.broadcast_to(np.eye(3), (len(time), 3, 3)), by_axis], axis=2)
        variance = np.einsum("nij,jk,nik->ni", jacobian, self.covariance, jacobian)
        return bias, np.sqrt(np.maximum(variance, 0.0))


def place_knots(start: float, stop: float, intervals: int) -> Array:
    """The knot vector of a cubic spline with so many even intervals; none for 0."""
    if intervals == 0:
        return np.empty(0)
    inner = np.linspace(start, stop, intervals + 1)
    return np.concatenate([[start] * DEGREE, inner, [stop] * DEGREE])


def evaluate_spline(time: Array, knots: Array) -> Array:
    """The basis functions at times (n, k); the last one is left out, for all add up to one."""
    if len(knots) == 0:
        return np.zeros((len(time), 0))
    basis = BSpline.design_matrix(time, knots, DEGREE).toarray()
    return np.asarray(basis[:, :-1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The terms of a record, so that any piece of it can be given its own.

    Of the bias in order: the spline in time, powers of temperature from the first, and `sources`
    over their `spread`. Of the matrix: the same powers where `matrix_degree` says so, and with
    `rate` the time, 0 at the end and −1 at the start. `start` and `stop` are those of the record.
    """

    start: float
    stop: float
    knots: Array
    middle: Array
    degree: int
    matrix_degree: int
    rate: bool
    centre_C: float
    half_range_C: float
    sources: tuple[str, ...]
    spread: Array

    @property
    def splines(self) -> int:
        """Columns of the spline."""
        return len(self.middle)

    @property
    def intervals(self) -> int:
        """Even stretches of time that the spline has, 0 for a constant bias."""
        return max(self.splines - DEGREE + 1, 0)

    @property
    def bias_count(self) -> int:
        """Terms of the bias."""
        return self.splines + self.degree + len(self.spread)

    @property
    def last(self) -> Array:
        """The terms of the bias at the end, at the middle temperature, with nothing switched on."""
        at_stop = evaluate_spline(np.array([self.stop]), self.knots)[0] - self.middle
        return np.concatenate([at_stop, np.zeros(self.bias_count - self.splines)])

    def localise(self, constants: int, parameters: int) -> Array:
        """What makes of the Jacobian (n, m) that of splines without their means, (m, m): zero far
        from their knots, where those of the terms are so much of the bias."""
        local = np.eye(parameters)
        means = np.concatenate([self.middle, np.zeros(self.bias_count - self.splines)])
        local[:3, constants : constants + 3 * len(means)] = np.kron(np.eye(3), means)
        return local

    def of_bias(self, samples: Samples) -> Array:
        """The terms of the bias of each row, (n, k)."""
        assert samples.time is not None
        spline = evaluate_spline(samples.time, self.knots)
        spline -= self.middle
        if self.bias_count == self.splines:
            return spline
        parts = [spline, self._powers(samples, self.degree)]
        if self.sources:
            parts.append(_stack_sources(samples, self.sources) / self.spread)
        return np.concatenate(parts, axis=1)

    def of_matrix(self, samples: Samples) -> Array:
        """The terms of the matrix of each row, (n, l)."""
        assert samples.time is not None
        parts = [self._powers(samples, self.matrix_degree)]
        if self.rate:
            parts.append(((samples.time - self.stop) / (self.stop - self.start))[:, None])
        return np.concatenate(parts, axis=1)

    def _powers(self, samples: Samples, degree: int) -> Array:
        if not degree:
            return np.zeros((len(samples), 0))
        x = polynomial.scale(samples.temperature, self.centre_C, self.half_range_C)  # type: ignore[arg-type]
        return polynomial.powers(x, degree)[:, 1:]


def build_terms(
    samples: Samples,
    intervals: int,
    *,
    degree: int,
    of_matrix: bool,
    rate: bool,
    sources: tuple[str, ...],
) -> Terms:
    """The terms of a record with so many intervals of the bias in time."""
    assert samples.time is not None
    start, stop = float(samples.time[0]), float(samples.time[-1])
    knots = place_knots(start, stop, intervals)
    low, high = 0.0, 0.0
    if samples.temperature is not None:
        low, high = float(samples.temperature.min()), float(samples.temperature.max())
    elif degree:
        raise LogError("terms in temperature were asked for and the log has no temperature")
    return Terms(
        start=start,
        stop=stop,
        knots=knots,
        middle=evaluate_spline(samples.time, knots).mean(axis=0),
        degree=degree,
        matrix_degree=degree if of_matrix else 0,
        rate=rate and of_matrix,
        centre_C=(low + high) / 2,
        half_range_C=max((high - low) / 2, 1e-6),
        sources=sources,
        spread=_spread(samples, sources),
    )


def _stack_sources(samples: Samples, sources: tuple[str, ...]) -> Array:
    """What the sources measure, (n, k), delays and time constants undone."""
    return stack_inputs(sources, None, restore(samples.columns(), find_timing(sources)))


def _spread(samples: Samples, sources: tuple[str, ...]) -> Array:
    """Standard deviations of what disturbs on board."""
    if not sources:
        return np.zeros(0)
    missing = [name for name in list_columns(sources) if name not in samples.columns()]
    if missing:
        raise LogError(
            f"{samples.name}: the log holds no {', '.join(missing)}; a fit with it needs it "
            "recorded beside the readings"
        )
    values = _stack_sources(samples, sources)
    spread = np.asarray(values.std(axis=0))
    still = [
        name
        for name, sd, mean in zip(signals(sources), spread, values.mean(axis=0), strict=True)
        if sd <= 1e-9 * (abs(mean) + 1e-9)
    ]
    if still:
        raise CoverageError(
            f"{', '.join(still)} never changes, so its effect on the readings cannot be separated "
            f"from the bias; fit without it"
        )
    return spread
