"""`InflightFit`: a calibration made in flight, and what it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from datetime import datetime
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.thermal import Thermal
from agonic.fit import Channel
from agonic.health import Finding, Judged
from agonic.inflight.fit import calibration as saved
from agonic.inflight.fit.covariance import Estimate
from agonic.inflight.fit.ground_errors import find_ground_affine
from agonic.inflight.fit.pointing import find_eclipse
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import compute_residuals_of, rotation_of
from agonic.inflight.fit.terms import Drift
from agonic.inflight.maths.correlated_errors import join_errors
from agonic.inflight.maths.residuals import correct
from agonic.maths.equation.affine import model_basis, split
from agonic.readable import Shown
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class InflightFit(Judged):
    """The result of `fit_inflight`.

    Parameters
    ----------
    calibration : the ground calibration brought up to date, or the one that was made, with the bias
        of the last reading.
    change : what was found in flight: field = matrix @ (ground field − bias), with covariance; at
        the mean temperature of the record.
    ground : the calibration made on the ground, or None.
    before, after : the ground calibration and the one of flight at the mean temperature and the
        end of the record, both from readings to field: what to compare. `before` is None where
        there was no ground calibration.
    drift : how the bias changed over the record; `bias_at` evaluates it.
    n : how many readings took part.
    time, epoch : (n,) s since `epoch` (None where the log has no date).
    latitude_deg, temperature, eclipse : (n,) beside the residuals, each None where the log cannot
        tell; `eclipse` is true in the shadow of the Earth.
    thinned : 1; after a fit out of core the rows of this record are every `thinned`-th.
    field : (n, 3) the field of every reading, with the bias of its time.
    residuals : (n,) magnitude less that of the reference, nT.
    weights : (n,) what the robust loss left of each reading, 0 for rows that were excluded.
    channels : residuals (n,) by kind, nT, each with its own noise and correlation: "magnitude",
        and with the attitude "azimuth" and "dip".
    alignment : with the attitude, the rotation from sensor axes to those of the attitude, with its
        covariance, rad²; else None.
    direction_error_deg : (n,) angle between field and reference, in one set of axes; else None.
    sources, sources_sd : (3, k) nT that a unit of each of `source_names` adds to a reading (three
        columns for "second"), and standard errors.
    noise : standard deviation of a residual, nT: the sensor's noise and the model's error together.
    correlation, correlation_s : how many readings, and seconds, count as one for the bias, for
        errors of the model are correlated in time (the effective sample size is n over it).
    lasting_nT, lasting_s : of the noise the correlated part, and how long it lasts; 0 where
        none was seen.
    solve : what was estimated: "bias", "gains" or "full".
    held_out : rms of residuals that the fit had not seen, nT, by the number of knots tried.
    """

    calibration: Affine | Thermal | Chain
    change: Affine
    drift: Drift
    n: Annotated[int, Shown()]
    time: Array
    field: Array
    residuals: Array
    weights: Array
    noise: Annotated[float, Shown(key="noise_nT")]
    correlation: float
    correlation_s: Annotated[float, Shown()]
    condition: float
    iterations: int
    converged: bool
    solve: Annotated[str, Shown()]
    held_out: dict[int, float]
    after: Affine
    before: Affine | None = None
    ground: Calibration | None = None
    epoch: datetime | None = None
    latitude_deg: Array | None = None
    temperature: Array | None = None
    eclipse: Mask | None = None
    thinned: int = 1
    channels: Mapping[str, Channel] = dataclass_field(default_factory=dict)
    alignment: Alignment | None = None
    direction_error_deg: Array | None = None
    lasting_nT: Annotated[float, Shown()] = 0.0
    lasting_s: Annotated[float, Shown()] = 0.0
    source_names: tuple[str, ...] = ()
    sources: Array = dataclass_field(default_factory=lambda: np.zeros((3, 0)))
    sources_sd: Array = dataclass_field(default_factory=lambda: np.zeros((3, 0)))
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def covariance(self) -> Array:
        """Covariance (9, 9) of `change`: bias x y z at the end, then matrix xx yy zz xy xz yz."""
        covariance = self.change.covariance
        assert covariance is not None, "a fit always carries a covariance"
        return covariance

    @property
    def sd(self) -> Array:
        """Standard errors (9,) of the same."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def median_direction_error_deg(self) -> float | None:
        """Of the readings that took part; None without attitude."""
        error = self.direction_error_deg
        return None if error is None else float(np.median(error[self.weights > 0]))

    def bias_at(self, time: ArrayLike) -> tuple[Array, Array]:
        """The bias (k, 3) found in flight, nT, and its standard error (k, 3), at `time` (k,), s."""
        return self.drift.at(np.atleast_1d(np.asarray(time, dtype=np.float64)))


def build_result(problem: Problem, estimate: Estimate, samples: Samples) -> InflightFit:
    """The fit in nT, before it is examined; `samples` are those before the ground calibration."""
    change = saved.build_change(problem, estimate, samples)
    ground = find_ground_affine(problem.ground, estimate.terms.centre_C)
    sources, sources_sd = saved.build_sources(problem, estimate)
    params, layout = estimate.solution.params, estimate.layout
    field = correct(problem.rows(estimate.terms), params, layout) * problem.magnitude
    weights = np.zeros(len(samples))
    weights[problem.used] = estimate.weight
    channels = _build_channels(problem, estimate)
    magnitude = channels["magnitude"]
    variance, lasting_s = join_errors(estimate.errors.get("magnitude", ()))
    size = magnitude.noise / estimate.noise["magnitude"].sd
    turn = saved.find_rotation_covariance(problem, estimate)
    return InflightFit(
        calibration=saved.build_calibration(problem, estimate, change, samples),
        change=change,
        after=change if ground is None else saved.join_affine(ground, change, samples, turn),
        before=ground,
        ground=problem.ground,
        drift=saved.build_drift(estimate, problem.magnitude),
        n=int(problem.used.sum()),
        time=problem.time,
        **{name: getattr(samples, name) for name in ("epoch", "latitude_deg", "temperature")},
        eclipse=find_eclipse(samples),
        field=field @ rotation_of(estimate),
        residuals=np.linalg.norm(field, axis=1) - problem.wanted * problem.magnitude,
        weights=weights,
        channels=channels,
        alignment=saved.build_alignment(problem, estimate, change),
        direction_error_deg=_find_direction_error(problem, field),
        source_names=estimate.terms.sources,
        sources=sources,
        sources_sd=sources_sd,
        noise=magnitude.noise,
        correlation=magnitude.correlation,
        correlation_s=magnitude.correlation * float(np.median(np.diff(problem.time))),
        lasting_nT=min(float(np.sqrt(variance)) * size, magnitude.noise),
        lasting_s=lasting_s,
        condition=estimate.solution.condition,
        iterations=estimate.solution.iterations,
        converged=estimate.solution.converged,
        solve=problem.settings.solve,
        held_out=estimate.held_out,
    )


def _find_direction_error(problem: Problem, field: Array) -> Array | None:
    """The angle (n,), degrees, between the field (n, 3) and the direction expected; None without
    attitude."""
    if problem.direction is None:  # both are in the axes of the turned sensor
        return None
    aim = problem.direction.aim @ problem.rotation
    across = np.linalg.norm(np.cross(field, aim), axis=1)
    return np.asarray(np.degrees(np.arctan2(across, (field * aim).sum(axis=1))))


def _build_channels(problem: Problem, estimate: Estimate) -> dict[str, Channel]:
    """Residuals and noise by kind in the calibrated field, nT."""
    layout = estimate.layout
    constants = estimate.solution.params[: layout.constants]
    _, matrix = split(model_basis("full", layout.gauge) @ constants)
    size = problem.magnitude * float(np.trace(matrix)) / 3
    channels = {}
    for kind, noise in estimate.noise.items():
        # across the field residuals are over √(1 + κ²F²), F about one
        wide = size if kind == "magnitude" else size * np.sqrt(1 + estimate.sds[kind] ** 2)
        channels[kind] = Channel(
            residuals=compute_residuals_of(problem, estimate, kind) * wide,
            noise=noise.sd * float(wide),
            correlation=noise.correlation,
        )
    return channels
