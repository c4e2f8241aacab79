"""A temperature fit to a field whose components are known at every reading."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.base import Validity
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, CoverageError, LogError
from agonic.fit import ModelTest
from agonic.health import Finding, figure
from agonic.maths.equation import model
from agonic.maths.equation.affine import FREE, model_basis, split
from agonic.maths.estimation import series
from agonic.maths.estimation.wald import wald
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.thermal.fit.readings import collect_facts, convert_to_celsius, require_temperature
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.fit.settings import LARGEST_AUTO, Settings
from agonic.thermal.maths import known_field as vector_coil

FEWEST = 24
_NARROWEST_C = 1.0
_NARROW_C = 10.0
_FLAT = 0.05  # of the field: components that vary by less leave gains open
_SIGNIFICANT = 1e-4
_MARKED = 0.01  # of the residual variance: what a further order must take off


def fit_known_field(samples: Samples, reference: Reference, settings: Settings) -> ThermalFit:
    """The calibration that turns every reading into the known field."""
    field = _find_field(samples, reference)
    level, findings = convert_to_celsius(require_temperature(samples))
    low, high = float(level.min()), float(level.max())
    if high - low < _NARROWEST_C:
        raise CoverageError(
            f"the temperature only runs from {low:.1f} to {high:.1f} °C: nothing can be said of "
            "its influence",
            turns="record over the range of use, or fit with fit_vector",
        )
    scale = _Scale(samples.field, field, low, high)
    rate = None
    if settings.rate is not False and samples.time is not None:
        rate = series.compute_rates(samples.time, level)
    posed, estimate, tests, curve = _estimate(
        samples.field, field, level, rate, scale, settings, samples.unit
    )
    calibration = _make_calibration(estimate, posed, scale, samples, reference, settings)
    stray = estimate.weights == 0
    found = [*findings, *_find_defects(low, high, stray)]
    rms = _compute_rms(calibration, samples, level, field, ~stray)
    remark = (
        f"the corrected readings are {figure(rms)} nT "
        f"(rms of an axis) from the known field, {figure(_rms_raw(samples.field, field))} before"
    )
    return ThermalFit(
        calibration=calibration,
        taught_by="vector",
        n=len(samples),
        residuals=estimate.residuals * scale.size,
        weights=estimate.weights,
        temperature=level,
        station=np.zeros(len(samples), dtype=np.intp),
        heating=series.find_heating(level),
        noise=estimate.noise.sd * scale.size,
        excess=0.0,
        correlation=estimate.noise.correlation,
        condition=estimate.solution.condition,
        iterations=estimate.solution.iterations,
        converged=estimate.solution.converged,
        variances=None if curve is None else curve[None] * scale.size**2,
        findings=tuple(found),
        tests=tests,
        remarks=(remark, *(test.sentence for test in tests)),
    )


def _find_field(samples: Samples, reference: Reference) -> Array:
    """The known field at every reading, or a clear error."""
    if len(reference.values) != len(samples):
        raise AgonicError(
            f"the reference has {len(reference.values)} vectors and there are {len(samples)} "
            "readings; a vector reference for a temperature fit needs one for each"
        )
    if reference.frame not in (None, samples.frame, "b", "m"):
        raise AgonicError(
            f"the reference is in the axes {reference.frame!r} and the sensor does not turn with "
            "them; give the field in axes fixed to the sensor or the vehicle (m or b)"
        )
    if len(samples) < FEWEST:
        raise CoverageError(f"{len(samples)} readings are too few", turns="record a few hundred")
    field = np.asarray(reference.values)
    moving = np.linalg.svd(field - field.mean(axis=0), compute_uv=False) / np.sqrt(len(field))
    if moving[-1] < _FLAT * float(np.linalg.norm(field, axis=1).mean()) / np.sqrt(3):
        raise CoverageError(
            "the known field hardly changes along some direction, so gains along it are not "
            "determined",
            turns="drive all three axes of the coil, or turn the sensor about two axes",
        )
    if samples.temperature is None:
        raise LogError(f"{samples.name}: the samples have no temperature")
    return field


class _Scale:
    """Size of the readings and of the field, and the range of temperatures."""

    def __init__(self, raw: Array, field: Array, low: float, high: float) -> None:
        self.centre = raw.mean(axis=0)
        self.size = float(np.sqrt(np.mean(np.sum((raw - self.centre) ** 2, axis=1))))
        if not self.size > 0:
            raise CoverageError("the readings never change: the sensor is stuck")
        self.magnitude = float(np.sqrt(np.mean(np.sum(field**2, axis=1))))
        self.low, self.high = low, high
        self.centre_C, self.half_C = (low + high) / 2, (high - low) / 2
        self.pace = 1.0

    def x(self, level: Array) -> Array:
        """Temperatures as −1…1."""
        return (level - self.centre_C) / self.half_C


def _estimate(
    raw: Array,
    field: Array,
    level: Array,
    rate: Array | None,
    scale: _Scale,
    settings: Settings,
    unit: str,
) -> tuple[
    vector_coil.KnownFieldProblem,
    vector_coil.KnownFieldEstimate,
    tuple[ModelTest, ...],
    Array | None,
]:
    """The estimate of the order that was asked for or is needed, with the rate where it shows, and
    the variance of the residuals by order where it was looked for."""
    points, fields = (raw - scale.centre) / scale.size, field / scale.magnitude
    if rate is not None:
        scale.pace = float(np.sqrt(np.mean(rate**2))) or 1.0

    def posed(degree: int, with_rate: bool) -> vector_coil.KnownFieldProblem:
        lag = rate / scale.pace if with_rate and rate is not None else None
        phi = model.build_covariates(scale.x(level), 0.0, degree, lag)
        return vector_coil.KnownFieldProblem(points, fields, phi, degree, with_rate)

    curve: Array | None = None
    if settings.degree == "auto":
        curve = _compute_variances(
            lambda order: vector_coil.estimate(posed(order, False), robust=settings.robust)
        )
        degree = _choose_degree(curve)
    else:
        degree = settings.degree
    plain = posed(degree, False)
    estimate = vector_coil.estimate(plain, robust=settings.robust)
    if rate is None or not np.any(rate):
        return plain, estimate, (), curve
    fuller = posed(degree, True)
    lagging = vector_coil.estimate(fuller, robust=settings.robust)
    term, spread = lagging.solution.params[-3:], lagging.solution.covariance[-3:, -3:]
    statistic, p_value = wald(term, spread, len(raw) / lagging.noise.correlation)
    there = settings.rate is True or p_value < _SIGNIFICANT
    words = (
        f"the bias lags by {figure(float(np.linalg.norm(term)) * scale.size)} {unit} while the "
        f"temperature changes at {figure(scale.pace * 60)} °C/min"
        if there
        else "no sign that the bias depends on how fast the temperature changes"
    )
    test = ModelTest(
        smaller="temperature", larger="rate", statistic=statistic, p_value=p_value, sentence=words
    )
    found = (fuller, lagging) if there else (plain, estimate)
    return *found, (test,), curve


def _compute_variances(estimated: Callable[[int], vector_coil.KnownFieldEstimate]) -> Array:
    """The variance of the residuals by order."""
    return np.array([estimated(order).noise.sd ** 2 for order in range(LARGEST_AUTO + 1)])


def _choose_degree(variances: Array) -> int:
    """The smallest order after which the variance stops falling markedly."""
    for order in range(LARGEST_AUTO):
        if (variances[order + 1 :] > (1 - _MARKED) * variances[order]).all():
            return order
    return LARGEST_AUTO


def _make_calibration(
    estimate: vector_coil.KnownFieldEstimate,
    posed: vector_coil.KnownFieldProblem,
    scale: _Scale,
    samples: Samples,
    reference: Reference,
    settings: Settings,
) -> Thermal:
    """The calibration in the units of the readings."""
    p = posed.degree + 1
    sizes = np.concatenate(
        [
            np.full(3 * p, scale.size),
            np.full(9 * p, scale.magnitude / scale.size),
            np.full(3 if posed.rate else 0, scale.size / scale.pace),
        ]
    )
    values = estimate.solution.params * sizes
    bias, matrix = split(values[: 12 * p].reshape(12, p).T @ model_basis("full", FREE).T)
    bias = bias.copy()
    bias[0] += scale.centre
    facts = collect_facts(samples)
    return Thermal(
        bias=bias,
        matrix=matrix,
        centre_C=scale.centre_C,
        half_range_C=scale.half_C,
        rate=values[12 * p :] if posed.rate else None,
        covariance=estimate.solution.covariance * np.outer(sizes, sizes),
        unit_in=samples.unit,
        unit_out="nT",
        gauge=FREE,
        magnitude=scale.magnitude,
        noise=estimate.noise.sd * scale.size,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=samples.frame,
        frame_out=reference.frame or samples.frame,
        validity=Validity(
            largest_reading=float(np.abs(samples.field).max()),
            temperature_C=(scale.low, scale.high),
        ),
        provenance=Provenance(
            inputs=() if facts.source is None else (facts.source,),
            settings={
                "fit": "thermal",
                "taught_by": "vector",
                "reference": reference.source,
                **settings.recorded(),
            },
            method=("huber-1981", "nikolaev-2023"),
        ),
    )


def _compute_rms(
    calibration: Thermal, samples: Samples, level: Array, field: Array, kept: Mask
) -> float:
    columns = {"temperature": level}
    if calibration.rate is not None and samples.time is not None:
        columns["temperature_rate"] = series.compute_rates(samples.time, level)
    left = calibration.correct(samples.field, **columns) - field
    return float(np.sqrt(np.mean(left[kept] ** 2)))


def _rms_raw(raw: Array, field: Array) -> float:
    return float(np.sqrt(np.mean((raw - field) ** 2)))


def _find_defects(low: float, high: float, stray: Mask) -> list[Finding]:
    found = []
    if high - low < _NARROW_C:
        found.append(
            Finding(
                "small range",
                "check",
                f"the temperature only runs from {low:.1f} to {high:.1f} °C",
                "record over the range of use; beyond it the correction is a guess",
            )
        )
    if stray.any():
        share = float(stray.mean())
        found.append(
            Finding(
                "anomalies",
                "check" if share > 0.1 else "note",
                f"{int(stray.sum())} readings ({figure(100 * share)} %) do not fit and were left "
                "out",
            )
        )
    return found
