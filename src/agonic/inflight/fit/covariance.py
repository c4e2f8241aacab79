"""The covariance of an estimate under correlated errors: each kind of residual says how."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.inflight.fit.terms import Terms
from agonic.inflight.maths import correlated_errors
from agonic.inflight.maths.residuals import Layout, Rows, Source, residual_pieces, turn_directions
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise

OF_SENSOR = 1
"""Number of the geometry of errors of the bias, which turn with the sensor."""
OF_EARTH = 2
"""Number of the geometry of errors of the magnitude that stand in Earth-fixed axes."""
TURN = 2
"""Number of the geometry of a kind across the field that is a turn of the attitude."""


class Estimate(NamedTuple):
    """The solution, and of each kind the noise, the residuals, and the correlated errors, in units
    of the magnitude; `sds` as `find_residuals` takes them; `held_out` the held-out error, nT, by
    the number of intervals tried."""

    solution: leastsq.Solution
    layout: Layout
    terms: Terms
    noise: dict[str, Noise]
    sds: dict[str, float]
    residuals: dict[str, Array]
    errors: dict[str, tuple[correlated_errors.CorrelatedError, ...]]
    held_out: dict[int, float]

    @property
    def weight(self) -> Array:
        """What the robust losses left of each reading, the least of its kinds."""
        weights = [
            noise.loss.weight((self.residuals[kind] / noise.sd) ** 2)
            for kind, noise in self.noise.items()
        ]
        return np.asarray(np.minimum.reduce(weights))


def compute_mean_correlation(noise: dict[str, Noise]) -> float:
    """One length for all kinds, so that they are weighted by their noise alone: it is known too
    poorly to choose between kinds."""
    return float(np.mean([of.correlation for of in noise.values()]))


@dataclass(frozen=True)
class Clock:
    """Stretches of `step_s` from `start`."""

    start: float
    step_s: float
    count: int

    @classmethod
    def of(cls, start: float, stop: float, step_s: float) -> Clock:
        """At most `STRETCHES` of at least `step_s`."""
        step = max((stop - start) / correlated_errors.STRETCHES, step_s)
        return cls(start, step, int((stop - start) / step) + 2)

    def stretch(self, time: Array) -> Index:
        """The number of the stretch of each time."""
        return np.floor((time - self.start) / self.step_s).astype(np.intp)


def compute_covariance(
    source: Source,
    estimate: Estimate,
    information: Array,
    clock: Clock,
    *,
    earth_fixed: bool,
    assumed: Sequence[correlated_errors.CorrelatedError] = (),
) -> Estimate:
    """The estimate with its covariance at the minimum, by one more pass a kind, and of each kind
    how many readings count as one, and the correlated errors; `assumed` are errors of the magnitude
    that its residuals need not show, `information` (m, m) the prior's.

    With ν how many readings counted as one when the data were weighed against the prior (the
    effective sample size is n over it), D_c the curvature of kind c, S_c = Σ (w r)² JJᵀ/σ⁴ the
    scatter of its gradient by noise, which need not be the same everywhere, and E_c by correlated
    errors:

        A = Σ D_c/ν + H,   B = Σ (S_c + E_c)/ν² + H,   covariance A⁻¹BA⁻¹.
    """
    bread, white, errors = information.copy(), {}, {}
    extra: dict[str, Array] = {}
    layout, noise, params = estimate.layout, estimate.noise, estimate.solution.params
    mean_correlation = compute_mean_correlation(noise)
    # columns of the Jacobian are zero where they are far from their spline
    local = estimate.terms.localise(layout.constants, layout.parameters)
    back = np.linalg.inv(local)
    for kind, of in noise.items():
        earth = earth_fixed and kind == "magnitude"
        sums, normal, squares = _sum_stretches(source, kind, estimate, clock, local, earth)
        curved = max(normal.curvature / max(normal.weight, 1e-300), 0.1)
        freedom = normal.total / max(normal.total - len(params), 1)
        bread += normal.information * curved / mean_correlation
        white[kind] = freedom * squares / of.sd**4
        errors[kind] = correlated_errors.find_correlated_errors(
            sums, of.sd**2, clock.step_s, () if kind == "magnitude" else (TURN,)
        )
        scattering = [*errors[kind], *(assumed if kind == "magnitude" else ())]
        if kind != "magnitude":
            # a turn of the attitude is one and the same in azimuth and dip: the scatter of a sum of
            # two is at most twice that of each added up, and that where they see the turn alike
            scattering = [
                one._replace(variance=one.variance * (2.0 if one.geometry == TURN else 1.0))
                for one in scattering
            ]
        scatter = correlated_errors.compute_scatter(sums, scattering, clock.step_s)
        extra[kind] = back.T @ scatter @ back / of.sd**4
    inverse = leastsq.inverse(bread)
    plain = {kind: inverse @ (part / mean_correlation**2) @ inverse for kind, part in white.items()}
    added = {kind: inverse @ (part / mean_correlation**2) @ inverse for kind, part in extra.items()}
    correlation = {
        kind: 1.0
        + float(np.trace(added[kind][:3, :3]) / max(np.trace(plain[kind][:3, :3]), 1e-300))
        for kind in noise
    }
    total = np.sum([*plain.values(), *added.values(), inverse @ information @ inverse], axis=0)
    return estimate._replace(
        solution=estimate.solution._replace(covariance=(total + total.T) / 2),
        noise={kind: of._replace(correlation=correlation[kind]) for kind, of in noise.items()},
        errors=errors,
    )


def _sum_stretches(
    source: Source, kind: str, estimate: Estimate, clock: Clock, local: Array, earth_fixed: bool
) -> tuple[correlated_errors.Sums, leastsq.Normal, Array]:
    """Sums over stretches, those of the solver, and Σ (w r)² J Jᵀ, in one pass."""
    params, noise = estimate.solution.params, estimate.noise[kind]
    squares = np.zeros((len(params), len(params)))
    magnitude = kind == "magnitude"
    sums = correlated_errors.Sums.empty(
        clock.count, len(params), (1, 3, 3) if earth_fixed or not magnitude else (1, 3)
    )

    def watch(rows: Rows, residuals: Array, jacobian: Array, onto: Array) -> None:
        weights = noise.loss.weight((residuals / noise.sd) ** 2)
        directions = [np.ones((len(residuals), 1)), jacobian[:, :3]]
        if earth_fixed:
            assert rows.direction_e is not None
            directions.append(rows.direction_e)
        if not magnitude:
            directions.append(turn_directions(rows, kind))
        scored = jacobian * (weights * residuals)[:, None]
        squares[:] += onto.T @ (scored.T @ scored) @ onto
        sums.add(clock.stretch(rows.time), weights, residuals, jacobian, directions, onto @ local)

    seen = residual_pieces(source, kind, estimate.layout, estimate.sds[kind], watch)
    normal = leastsq.accumulate(seen, params, noise.loss, noise.sd, keep=False)
    return sums, normal, squares
