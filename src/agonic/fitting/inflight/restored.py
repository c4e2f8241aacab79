"""From the kernel's numbers to calibrations in nT: what changed, and ground and change in one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.fitting.inflight.drift import Drift, knots_between, spline
from agonic.fitting.inflight.record import InflightFit
from agonic.kernels import taught
from agonic.kernels.affine import join, model_basis, split
from agonic.provenance import Input, Provenance
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.fitting.inflight.from_samples import Task

Array = NDArray[np.float64]

METHOD = ("huber-1981",)


def fit(
    task: Task, estimate: taught.Estimate, intervals: int,
    samples: Samples, held_out: dict[int, float],
) -> InflightFit:  # fmt: skip
    """The fit in nT, before it is examined."""
    noise = estimate.noise["magnitude"]
    moved = _drift(task, estimate, intervals)
    change = _change(task, estimate, moved, samples)
    weights = np.zeros(len(samples))
    weights[task.believed] = estimate.weight
    bias, _ = moved.at(task.time)
    field = (task.field - bias) @ change.matrix.T
    gain = float(np.trace(change.matrix)) / 3
    step = float(np.median(np.diff(task.time)))
    return InflightFit(
        calibration=_calibration(task, change, samples),
        change=change,
        drift=moved,
        n=int(task.believed.sum()),
        field=field,
        residuals=np.linalg.norm(field, axis=1) - task.wanted * task.magnitude,
        weights=weights,
        noise=noise.sd * task.magnitude * gain,
        correlation=noise.correlation,
        correlation_s=noise.correlation * step,
        condition=estimate.solution.condition,
        iterations=estimate.solution.iterations,
        converged=estimate.solution.converged,
        solve=task.solve,
        held_out=held_out,
    )


def _drift(task: Task, estimate: taught.Estimate, intervals: int) -> Drift:
    """The bias in time, nT."""
    knots = knots_between(task.time[0], task.time[-1], intervals)
    params, covariance = estimate.solution.params, estimate.solution.covariance
    own = np.r_[0:3, 9 : len(params)]
    return Drift(
        knots=knots,
        middle=spline(task.time, knots).mean(axis=0),
        constant=params[:3] * task.magnitude,
        coefficients=params[9:].reshape(3, -1) * task.magnitude,
        covariance=covariance[np.ix_(own, own)] * task.magnitude**2,
        start=float(task.time[0]),
        stop=float(task.time[-1]),
    )


def _change(task: Task, estimate: taught.Estimate, moved: Drift, samples: Samples) -> Affine:
    """field = matrix @ (ground field − bias at the end of the record), with covariance."""
    params, covariance = estimate.solution.params, estimate.solution.covariance
    last = spline(np.array([moved.stop]), moved.knots)[0] - moved.middle
    onto = np.zeros((9, len(params)))
    onto[:9, :9] = np.eye(9)
    onto[:3, 9:] = np.kron(np.eye(3), last)
    size = np.r_[np.full(3, task.magnitude), np.ones(6)]
    _, matrix = split(model_basis("full") @ params[:9])
    ground = task.ground
    unit = samples.unit if ground is None else ground.unit_out
    frame = samples.frame if ground is None else ground.frame_out
    return Affine(
        bias=moved.at(np.array([moved.stop]))[0][0],
        matrix=matrix,
        covariance=onto @ covariance @ onto.T * np.outer(size, size),
        unit_in=unit,
        unit_out="nT",
        magnitude=task.magnitude,
        noise=estimate.noise["magnitude"].sd * task.magnitude,
        sensor=samples.name,
        device_id=samples.device_id,
        frame_in=frame,
        frame_out=frame,
        validity=_validity(samples),
        provenance=Provenance(
            inputs=(samples.source or Input.of_array(samples.name, samples.field),),
            settings=_settings(task, moved),
            method=METHOD,
        ),
    )


def _calibration(task: Task, change: Affine, samples: Samples) -> Affine | Chain:
    """Ground and change in one: multiplied out where the ground is affine, else a chain."""
    ground = task.ground
    if ground is None:
        return change
    if type(ground) is not Affine:
        steps = (*ground.steps, change) if isinstance(ground, Chain) else (ground, change)
        return Chain(steps=steps, provenance=change.provenance)  # type: ignore[arg-type]
    matrix = change.matrix @ ground.matrix
    bias = ground.bias + np.linalg.solve(ground.matrix, change.bias)
    return replace(
        change,
        bias=bias,
        matrix=matrix,
        gauge="free",
        covariance=_composed(ground, change),
        unit_in=ground.unit_in,
        frame_in=ground.frame_in,
        validity=_validity(samples),
    )


def _composed(ground: Affine, change: Affine) -> Array:
    """Covariance (12, 12) of bias and matrix of the two in one.

        matrix = M W,   bias = b + W⁻¹ c

    The flight knows bias and gains of the present; the ground's own errors of them are inside the
    change already, so that only the change is uncertain.
    """
    w, inverse = ground.matrix, np.linalg.inv(ground.matrix)
    local = np.zeros((12, 12))
    local[:3, :3] = inverse
    for i in range(3):
        for j in range(3):
            step = np.zeros((3, 3))
            step[i, j] = 1.0
            local[:, 3 + 3 * i + j] = join(np.zeros(3), step @ w)
    assert change.covariance is not None
    onto = np.linalg.pinv(model_basis("full", "free")) @ local @ model_basis("full")
    return np.asarray(onto @ change.covariance @ onto.T)


def _validity(samples: Samples) -> Validity:
    warm = samples.temperature
    return Validity(
        largest_reading=float(np.abs(samples.field).max()),
        temperature_C=None if warm is None else (float(warm.min()), float(warm.max())),
    )


def _settings(task: Task, moved: Drift) -> Mapping[str, Any]:
    """What was chosen, for the provenance."""
    return {
        "fit": "inflight",
        "solve": task.solve,
        "drift_intervals": moved.intervals,
        "gain_sd": task.gain_sd,
        "soft_iron_sd": task.soft_iron_sd,
        "robust": task.robust,
        "ground": None if task.ground is None else task.ground.kind,
        "excluded": int((~task.believed).sum()),
    }
