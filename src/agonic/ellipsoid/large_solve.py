"""Maximum likelihood over readings that are not kept: each iteration is one pass over them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.ellipsoid.large_scan import Progress, Recording, Scan, read_segments
from agonic.ellipsoid.maths import block_sums, sweep
from agonic.ellipsoid.maths.block_sums import Assumed, Frame, Sums
from agonic.ellipsoid.problem import Scale
from agonic.ellipsoid.settings import Fixed
from agonic.ellipsoid.solve import Found
from agonic.maths.equation import gauge
from agonic.maths.equation.affine import model_basis, split
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.equation.priors import make_prior
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import elasticity, expected_square
from agonic.maths.estimation.noise import batch_means

MOST_PASSES = 12
SETTLED = 0.03
"""Standard errors by which the result may be off for steps that were taken without looking."""

COMPILE_FROM = 5_000_000
"""Rows for which numba is worth loading."""


class Whole(NamedTuple):
    """A fit to all readings: what was found, the noise, how many readings there were and how many
    of them did not count, and the likeliest change of the parameters in time."""

    found: Found
    noise: Assumed
    n: int
    outliers: int
    change_point: batch_means.ChangePoint | None


def maximise(
    recording: Recording,
    scan: Scan,
    scale: Scale,
    model: Fixed,
    start: Estimate,
    soft_iron_sd: float | None,
    robust: bool,
    report: Progress,
) -> Whole:
    """The minimum over all readings, from that over some of them.

    Each pass adds up normal equations, the noise, and the scores of stretches of time, and how
    they all change; Newton's step goes to the minimum. From the rows in memory it is so short
    that what the next pass would see is known without it; where it is not, there is one.
    """
    change = block_sums.reduction(model)
    prior = make_prior(model, soft_iron_sd)
    noise = start.noise["magnitude"]
    params, correlation = start.solution.params, noise.correlation
    outliers_count_nothing = noise.loss.weight(np.array([1e6]))[0] == 0.0
    assumed = Assumed(noise.sd, bool(outliers_count_nothing))
    for number in range(1, MOST_PASSES + 1):
        sums = _sum_pass(recording, scan, scale, change @ params, assumed, number, report)
        seen = _estimate_noise(sums, assumed, robust, len(params))
        growth = float(np.log(seen.sd / assumed.sd))
        sums = sums.with_noise(growth)
        normal = sums.normal(seen.sd, change)
        white = _scatter_of_white_noise(normal, len(params))
        for _ in range(2):  # how long errors last is seen in the scores after the step
            joint = leastsq.join([normal], [correlation], params, prior)
            curved = normal.information * (normal.curvature / normal.weight / correlation)
            step = -leastsq.inverse(curved + joint.known) @ joint.gradient
            scores = sums.after(change @ step, seen.sd) @ change / seen.sd
            scatter = batch_means.compute_scatter(scores, white)
            correlation = scatter.correlation
        params = params + step
        left = _find_error_of_step(step, normal, change, seen, growth)
        converged = left < SETTLED and seen.robust == assumed.robust
        if converged:
            break
        assumed = seen
    steady = batch_means.compute_scatter(scores, white, steady=True)
    covariance, data = leastsq.find_covariance(
        joint, [correlation], [1.0], scatter.matrix / correlation**2
    )
    bias, matrix = split(model_basis(model) @ params)
    found = Found(
        model,
        bias,
        matrix,
        gauge.expand_model_covariance(model, covariance),
        seen.sd,
        correlation,
        condition=float(leastsq.condition(data)),
        iterations=number,
        converged=converged,
    )
    return Whole(
        found,
        seen,
        normal.total,
        round(float(sums.facts[6])),
        batch_means.find_change_point(-scores, data * correlation, steady.matrix),
    )


def _sum_pass(
    recording: Recording,
    scan: Scan,
    scale: Scale,
    params: Array,
    assumed: Assumed,
    number: int,
    report: Progress,
) -> Sums:
    """One pass."""
    sums = Sums.empty(batch_means.STRETCHES)
    compiled = scan.rows >= COMPILE_FROM or sweep.compile_sweep.cache_info().currsize > 0
    for part in read_segments(recording, scan, lambda done: report(f"iteration {number}", done)):
        frame = Frame(scale.centre, scale.size, part.factor)
        block_sums.add(sums, part.stretch, part.columns, frame, params, assumed, compiled=compiled)
    return sums.first(-(-scan.rows // scan.stretch))


def _find_error_of_step(
    step: Array, normal: leastsq.Normal, change: Array, noise: Assumed, growth: float
) -> float:
    """How far the result may still be off, in standard errors, by what is of second order.

    A step errs by its square over the size of the ellipsoid, noise by its effect on a curved
    surface, σ²/F, a loss that bends by the square of what residuals move; each over σ/√n.
    """
    whole = change @ step
    moved = float(step @ normal.information @ step) / normal.total + growth**2
    off = float(whole @ whole) / noise.sd + noise.sd * growth**2 + noise.robust * moved
    return float(np.sqrt(normal.total)) * off


def _estimate_noise(sums: Sums, assumed: Assumed, robust: bool, parameters: int) -> Assumed:
    """The noise of all readings, by those that the loss lets through (`noise.residuals`)."""
    _, weight, _, _, power, total, _, largest = sums.facts.tolist()
    stands_out = largest > np.sqrt(2 * np.log(2 * total)) + 1
    if robust and stands_out and not assumed.robust:
        return assumed._replace(robust=True)
    freedom = total / max(total - parameters, 1)
    loss = assumed.loss
    over = power / weight / expected_square(loss) * freedom
    sd = assumed.sd * over ** (1 / elasticity(loss))
    return assumed._replace(sd=max(float(sd), 1e-9))


def _scatter_of_white_noise(normal: leastsq.Normal, parameters: int) -> Array:
    """The scatter of the gradient by residuals of which each counts."""
    freedom = normal.total / max(normal.total - parameters, 1)
    return np.asarray(normal.information * (freedom * normal.scatter / normal.weight))
