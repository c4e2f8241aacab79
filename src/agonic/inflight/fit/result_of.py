"""From the kernel's numbers to calibrations in nT: what changed, and ground and change in one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.fit import Channel
from agonic.inflight.fit import calibration
from agonic.inflight.fit.drift import Drift
from agonic.inflight.fit.pointing import eclipse
from agonic.inflight.fit.problem import Task
from agonic.inflight.fit.result import InflightFit
from agonic.inflight.fit.solve import Estimate, Found, residuals_of, turn_of
from agonic.inflight.maths.residuals import correct
from agonic.maths.equation.affine import FREE, model_basis, split
from agonic.maths.rotations.polar import turned
from agonic.provenance import Provenance
from agonic.samples import Samples

METHOD = ("huber-1981",)


def fit(result: Found, samples: Samples) -> InflightFit:
    """The fit in nT, before it is examined; `samples` are those before the ground calibration."""
    task, estimate = result.task, result.estimate
    moved = _drift(estimate, task.magnitude)
    change = _change(task, estimate, samples)
    parts = calibration.Parts.of(task, estimate, change)
    turn = turn_of(estimate)
    rows = task.rows(estimate.terms)
    field = correct(rows, estimate.solution.params, estimate.layout) * task.magnitude
    weights = np.zeros(len(samples))
    weights[task.believed] = estimate.weight
    channels = _channels(task, estimate)
    magnitude = channels["magnitude"]
    lasts = _lasting(estimate, magnitude.noise)
    return InflightFit(
        calibration=parts.calibration(samples),
        change=change,
        after=parts.after(samples),
        before=parts.before(),
        ground=task.ground,
        drift=moved,
        n=int(task.believed.sum()),
        time=task.time,
        epoch=samples.epoch,
        latitude_deg=samples.latitude_deg,
        temperature=samples.temperature,
        eclipse=eclipse(samples),
        field=field @ turn,
        residuals=np.linalg.norm(field, axis=1) - task.wanted * task.magnitude,
        weights=weights,
        channels=channels,
        alignment=None if task.toward is None else _alignment(task, estimate, change),
        direction_error_deg=_direction_error_deg(task, field),
        source_names=estimate.terms.sources,
        sources=parts.sources,
        sources_sd=parts.sources_sd,
        noise=magnitude.noise,
        correlation=magnitude.correlation,
        correlation_s=magnitude.correlation * float(np.median(np.diff(task.time))),
        lasting_nT=lasts[0],
        lasting_s=lasts[1],
        condition=estimate.solution.condition,
        iterations=estimate.solution.iterations,
        converged=estimate.solution.converged,
        solve=task.settings.solve,
        held_out=result.held_out,
    )


def _channels(task: Task, estimate: Estimate) -> dict[str, Channel]:
    """Residuals and noise by kind in the calibrated field, nT."""
    layout = estimate.layout
    _, matrix = split(
        model_basis("full", layout.gauge) @ estimate.solution.params[: layout.constants]
    )
    size = task.magnitude * float(np.trace(matrix)) / 3
    channels = {}
    for kind, noise in estimate.noise.items():
        # across the field residuals are over √(1 + κ²F²), F about one
        wide = size if kind == "magnitude" else size * np.sqrt(1 + estimate.sds[kind] ** 2)
        channels[kind] = Channel(
            residuals=residuals_of(task, estimate, kind) * wide,
            noise=noise.sd * float(wide),
            correlation=noise.correlation,
        )
    return channels


def _lasting(estimate: Estimate, noise: float) -> tuple[float, float]:
    """Standard deviation of what lasts in the magnitude, nT, and how long it does, s."""
    errors = estimate.errors.get("magnitude", ())
    variance = sum(error.variance for error in errors)
    if not variance:
        return 0.0, 0.0
    size = noise / estimate.noise["magnitude"].sd
    time = sum(error.variance * error.time_s for error in errors) / variance
    return min(float(np.sqrt(variance)) * size, noise), float(time)


def _direction_error_deg(task: Task, field: Array) -> Array | None:
    """Angles between field and reference, both in the axes of the turned sensor."""
    if task.toward is None:
        return None
    aim = task.toward.aim @ task.turn
    across = np.linalg.norm(np.cross(field, aim), axis=1)
    return np.asarray(np.degrees(np.arctan2(across, (field * aim).sum(axis=1))))


def _drift(estimate: Estimate, magnitude: float) -> Drift:
    """The bias in time, nT."""
    terms, params = estimate.terms, estimate.solution.params
    c, k, s = estimate.layout.constants, estimate.layout.bias_terms, terms.splines
    own = np.r_[0:3, [c + axis * k + j for axis in range(3) for j in range(s)]].astype(np.intp)
    return Drift(
        knots=terms.knots,
        middle=terms.middle,
        constant=params[:3] * magnitude,
        coefficients=estimate.layout.biases(params)[:, :s] * magnitude,
        covariance=estimate.solution.covariance[np.ix_(own, own)] * magnitude**2,
        start=terms.start,
        stop=terms.stop,
    )


def _change(task: Task, estimate: Estimate, samples: Samples) -> Affine:
    """field = matrix @ (ground field − bias) at the end of the record and at the middle
    temperature, with covariance; what is turned in it is left to the alignment."""
    layout, params = estimate.layout, estimate.solution.params
    at_end = calibration.at_end(estimate)
    size = calibration.sizes(layout, task.magnitude)
    covariance = at_end @ estimate.solution.covariance @ at_end.T * np.outer(size, size)
    bias, matrix = split(model_basis("full", layout.gauge) @ (at_end @ params))
    if layout.gauge == FREE:
        _, rest = turned(matrix, covariance, FREE)
        matrix, covariance = rest.rotation.T @ matrix, rest.covariance[:9, :9]
    ground = task.ground
    frame = samples.frame if ground is None else ground.frame_out
    return Affine(
        bias=bias * task.magnitude,
        matrix=(matrix + matrix.T) / 2,
        covariance=covariance,
        unit_in=samples.unit if ground is None else ground.unit_out,
        unit_out="nT",
        magnitude=task.magnitude,
        noise=estimate.noise["magnitude"].sd * task.magnitude,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=frame,
        frame_out=frame,
        validity=calibration.validity(samples),
        provenance=Provenance(
            inputs=(samples.origin,),
            settings=_settings(task, estimate),
            method=METHOD,
        ),
    )


def _alignment(task: Task, estimate: Estimate, change: Affine) -> Alignment:
    """From sensor axes to those of the attitude."""
    layout = estimate.layout
    at_end = calibration.at_end(estimate)
    _, matrix = split(model_basis("full", FREE) @ (at_end @ estimate.solution.params))
    _, rest = turned(matrix, at_end @ estimate.solution.covariance @ at_end.T, layout.gauge)
    return Alignment(
        rotation=Rotation.from_matrix(task.turn @ rest.rotation),
        covariance=task.turn @ rest.covariance[9:, 9:] @ task.turn.T,
        frame_in=change.frame_out,
        sensor=change.sensor,
        provenance=change.provenance,
    )


def _settings(task: Task, estimate: Estimate) -> Mapping[str, Any]:
    """What was chosen, for the provenance."""
    asked, terms = task.settings, estimate.terms
    intervals = max(terms.splines - 2, 0)
    return {
        "fit": "inflight",
        "solve": asked.solve,
        "drift_intervals": intervals,
        "temperature_degree": terms.degree,
        "matrix_rate": terms.rate,
        "sources": list(terms.sources),
        "attitude": asked.attitude,
        "gain_sd": asked.gain_sd,
        "soft_iron_sd": asked.soft_iron_sd,
        "robust": asked.robust,
        "ground": None if task.ground is None else task.ground.kind,
        "excluded": int((~task.believed).sum()),
    }
