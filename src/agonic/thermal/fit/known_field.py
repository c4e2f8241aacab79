"""A temperature fit to a field whose components are known at every reading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, CoverageError
from agonic.health import Finding, figure
from agonic.maths.equation.affine import FREE
from agonic.maths.estimation import series
from agonic.provenance import Provenance
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.thermal.fit.calibration import make_calibration
from agonic.thermal.fit.known_field_model import (
    KnownFieldEstimate,
    KnownFieldReadings,
    choose_model,
    normalise,
)
from agonic.thermal.fit.problem import Settings, find_narrow_range, require_range
from agonic.thermal.fit.readings import (
    collect_facts,
    convert_to_celsius,
    judge_thermometer,
    require_temperature,
)
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.maths.known_field import (
    BLOCKS,
    FIELD,
    NETWORK,
    TEMPERATURE,
    compare_alternatives,
)
from agonic.thermal.maths.thermometer import smooth_thermometer

FEWEST = 24
_FLAT = 0.05  # of the field: components that vary by less leave gains open


def fit_known_field(samples: Samples, reference: Reference, settings: Settings) -> ThermalFit:
    """The calibration that turns every reading into the known field."""
    field = _find_field(samples, reference)
    level, findings = _find_level(samples)
    readings = normalise(samples, field, level, settings)
    scale = readings.scale
    problem, estimate, tests, curve = choose_model(readings, settings, samples.unit)
    calibration = _restore(estimate, readings, samples, reference, settings)
    kept = estimate.weights > 0
    found = [*findings, *_find_outliers(~kept)]
    rms = _compute_rms(calibration, samples, level, field, kept)
    before = float(np.sqrt(np.mean((samples.field - field) ** 2)))
    unseen = rms * _compare_to_seen(estimate)
    ratios = compare_alternatives(problem, estimate.fitted, estimate.weights, readings.x)
    alternatives = {name: ratio * unseen for name, ratio in ratios.items()}
    found += [*judge_unseen(unseen, before), *judge_alternatives(alternatives, unseen)]
    remark = (
        f"the corrected readings are {figure(rms)} nT (rms of an axis) from the known field, "
        f"{figure(unseen)} where the fit has not seen them ({BLOCKS} blocks), {figure(before)} "
        "before"
    )
    return ThermalFit(
        calibration=calibration,
        reference_kind="vector",
        n=len(samples),
        residuals=estimate.residuals * scale.size,
        weights=estimate.weights,
        temperature=level,
        station=np.zeros(len(samples), dtype=np.intp),
        heating=series.find_heating(level),
        noise=estimate.noise.sd * scale.size,
        excess=0.0,
        correlation=estimate.noise.correlation,
        condition=estimate.condition,
        iterations=1,
        converged=True,
        variances=None if curve is None else curve[None] * scale.size**2,
        findings=tuple(found),
        tests=tests,
        remarks=(
            remark,
            *describe_alternatives(alternatives, unseen),
            *(test.sentence for test in tests),
        ),
        unseen_rms=unseen,
        alternatives=alternatives,
    )


def _find_level(samples: Samples) -> tuple[Array, tuple[Finding, ...]]:
    """Temperatures (n,) without the noise of the thermometer, and what is to be said of them."""
    level, findings = convert_to_celsius(require_temperature(samples))
    move = "record over the range of use, or fit with fit_vector"
    require_range(float(level.min()), float(level.max()), move)
    findings += tuple(find_narrow_range(float(level.min()), float(level.max()), "record"))
    if samples.time is None:
        return level, findings
    calmed = smooth_thermometer(level, samples.time)
    return calmed.temperature, (*findings, *judge_thermometer([(level, calmed)]))


def _restore(
    estimate: KnownFieldEstimate,
    readings: KnownFieldReadings,
    samples: Samples,
    reference: Reference,
    settings: Settings,
) -> Thermal:
    """The calibration in the units of the readings."""
    facts = collect_facts(samples)
    return make_calibration(
        estimate.coefficients,
        estimate.covariance,
        readings.scale,
        facts,
        degree=estimate.degree,
        gauge=FREE,
        gain=readings.magnitude / readings.scale.size,
        magnitude=readings.magnitude,
        unit_out="nT",
        frame_out=reference.frame or samples.frame,
        noise=estimate.noise.sd * readings.scale.size,
        largest=float(np.abs(samples.field).max()),
        provenance=Provenance(
            inputs=facts.inputs,
            settings={
                "fit": "thermal",
                "reference_kind": "vector",
                "reference": reference.source,
                **settings.recorded(),
            },
            method=("huber-1981", "nikolaev-2023"),
        ),
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
    return field


def _compare_to_seen(estimate: KnownFieldEstimate) -> float:
    """By how much residuals are larger where the fit has not seen the readings."""
    kept = estimate.weights > 0
    seen = float(np.mean(estimate.residuals[kept] ** 2))
    return float(np.sqrt(np.mean(estimate.unseen[kept] ** 2) / max(seen, 1e-300)))


def _compute_rms(
    calibration: Thermal, samples: Samples, level: Array, field: Array, kept: Mask
) -> float:
    columns = {"temperature": level}
    if calibration.rate is not None and samples.time is not None:
        columns["temperature_rate"] = series.compute_rates(samples.time, level)
    left = calibration.correct(samples.field, **columns) - field
    return float(np.sqrt(np.mean(left[kept] ** 2)))


def _find_outliers(outlier: Mask) -> list[Finding]:
    if not outlier.any():
        return []
    share = float(outlier.mean())
    return [
        Finding(
            "anomalies",
            "check" if share > 0.1 else "note",
            f"{int(outlier.sum())} readings ({figure(100 * share)} %) do not fit and were left out",
        )
    ]


HELPS, MATTERS = 0.95, 0.8
"""The rms on unseen blocks, over that without, below which an alternative helps, and matters."""
_MOVES = {
    TEMPERATURE: "change the temperature more slowly, or calibrate in the direction of use",
    FIELD: "keep strong fields away, and step the coil as the field of use changes",
    NETWORK: "agonic fit network LOG --base CALIBRATION --inputs field,temperature, and compare",
}


def judge_unseen(unseen: float, before: float) -> list[Finding]:
    """A calibration that foretells unseen readings worse than none."""
    if unseen < before:
        return []
    return [
        Finding(
            "worse than recorded",
            "refuse",
            f"readings that the fit has not seen are {figure(unseen)} nT from the known field, as "
            f"recorded {figure(before)} nT: the record does not determine it",
            "drive all axes of the coil at every temperature, and check that readings and field "
            "are of the same moments and axes",
        )
    ]


def judge_alternatives(alternatives: Mapping[str, float], unseen: float) -> list[Finding]:
    """The alternative that foretells unseen blocks best, where it does so better than the fit."""
    if not alternatives:
        return []
    best = min(alternatives, key=lambda name: alternatives[name])
    ratio = alternatives[best] / max(unseen, 1e-300)
    if ratio > HELPS:
        return []
    return [
        Finding(
            "not in the model",
            "check" if ratio < MATTERS else "note",
            f"with {best} {figure(alternatives[best])} nT would be left of unseen blocks, "
            f"{figure(unseen)} without",
            _MOVES[best],
        )
    ]


def describe_alternatives(alternatives: Mapping[str, float], unseen: float) -> tuple[str, ...]:
    """That nothing more would help, or by how much each alternative would."""
    if not alternatives:
        return ()
    if min(alternatives.values()) > HELPS * unseen:
        return ("neither hysteresis nor a network would predict unseen blocks better",)
    said = ", ".join(f"{figure(left)} nT with {name}" for name, left in alternatives.items())
    return (f"on unseen blocks it would be {said}",)
