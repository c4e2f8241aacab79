"""The first readings after a start or a jump, taken together until the bias has settled.

A filter takes each residual as linear about its estimate then. At first it knows little, and
what was taken wrongly is never taken again. So the first readings are kept: the one solver finds
the most probable bias and matrix of all of them, robustly, and the filter runs again from the
prior with every residual linear about that. Without walk this is the batch fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.tracking import Jump, Opening, Recent, TrackerParams, TrackerState
from agonic.inflight.tracking import map_estimate
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters import kalman, states
from agonic.maths.estimation.loss import cauchy
from agonic.maths.estimation.noise.residuals import robust_scale

MOMENTS = tuple(sorted({n << k for n in (2, 3) for k in range(3, 12)} | {8192}))
"""Numbers of readings at which an opening is solved: 16, 24, 32, 48 … 8192; at the last it is
closed, settled or not, which at 1 Hz is more than an orbit."""
STRIDE = 128
"""Readings between the estimates that are kept to go back to; a jump is dated within twice this."""
DOUBT = 2.0
"""Difference of log-likelihoods that dates nothing."""

_PATIENT = 1024  # readings in which an opening settles where the directions of the field turn
_CURVED = 0.03  # part of the noise that the curvature of residuals may come to in a filter
# the same where they turn slowly, as once an orbit: jumps are not seen until it closes
_NONLINEAR = 0.5


def count_until_due(readings: int) -> int:
    """How many readings until an opening of so many is to be solved."""
    return next(n for n in MOMENTS if n > readings) - readings


def count_since_jump(
    opening: Opening, before: TrackerState, now: TrackerState, params: TrackerParams
) -> int:
    """How many readings came since an opening was last solved, where a jump came with them; else 0.

    Then a quarter of them are far from what is found now, or all scatter about it by twice as much
    as those before did about what was found then. Only a long opening can tell.
    """
    last = max((n for n in MOMENTS if n < len(opening.rows)), default=0)
    if last < _PATIENT:
        return 0
    then = robust_scale(map_estimate.linearise(opening.rows[:last], before.estimate.state)[0])
    then = max(then, map_estimate.compute_total_sd(params, now.noise, now.estimate.state))
    new, _ = map_estimate.linearise(opening.rows[last:], now.estimate.state)
    far = 4 * np.count_nonzero(np.abs(new) > params.gate * then) > len(new)
    return len(new) if far or robust_scale(new) > 2 * then else 0


def compute_nonlinearity(estimate: states.FilterState, magnitude: float) -> float:
    """How far residuals are from linear within the standard errors, δ²/2F, in their unit.

    δ² = tr P over bias and matrix, the matrix times the field.
    """
    gain = float(np.mean(estimate.state[4:7]))
    field = magnitude / gain
    variances = np.diag(estimate.covariance)
    spread = variances[1:4].sum() + (field / gain) ** 2 * variances[4:].sum()
    return float(spread / (2 * field))


def is_nearly_linear(estimate: states.FilterState, magnitude: float, noise: float) -> bool:
    """Whether the filter may run on its own."""
    return compute_nonlinearity(estimate, magnitude) < _CURVED * noise


def widen_for_nonlinearity(
    estimate: states.FilterState,
    prior: states.FilterState,
    apart: Array,
    magnitude: float,
    noise: float,
) -> states.FilterState:
    """An estimate with wider standard errors, as residuals may not be linear within its own.

    Linear standard errors hold about one solution; while δ²/2F is above the noise σ there are
    others as good, on a surface that is not flat. So the readings count for less, and each bias
    may be off by as much as the surface bends, and as far as the others are `apart` (3,):

        P⁻¹ ← P⁻¹/f² + P₀⁻¹ (1 − 1/f²),   f = 1 + δ²/2Fσ;   then P_bb ← P_bb + (δ²/2F)² 1 + a².
    """
    known = prior.diagonal > 0
    block = np.ix_(known, known)
    share = (1.0 + compute_nonlinearity(estimate, magnitude) / noise) ** -2
    covariance = estimate.covariance
    information = share * leastsq.inverse(covariance[block])
    information += (1.0 - share) * leastsq.inverse(prior.covariance[block])
    covariance[block] = leastsq.inverse(information)
    wide = states.start_filter(estimate.state, covariance, 0.0)
    wide = wide._replace(watched=estimate.watched, batches=estimate.batches)
    return states.add_variance(wide, np.hypot(compute_nonlinearity(wide, magnitude), apart))


def predict(
    estimate: states.FilterState, model: states.Model, rows: Array, learns: bool, compiled: bool
) -> tuple[states.FilterState, kalman.Predictions]:
    """The estimate after rows that come before the next solution, and what it predicted of them.

    A wide estimate learns nothing: linearised at one reading after the other it would take its own
    errors for knowledge. `model` sees no jumps.
    """
    taken = rows if learns else np.column_stack([rows[:, :5], np.zeros(len(rows))])
    later, seen, _ = kalman.advance(estimate, model, taken, compiled=compiled)
    return later, seen._replace(used=np.abs(seen.residual) <= model.gate * seen.sd)


def solve_opening(state: TrackerState, params: TrackerParams) -> TrackerState:
    """The state with its opening taken as a whole, and closed where the bias has settled."""
    opening, given = state.opening, params
    assert opening is not None, "only an opening can be solved"
    prior, rows, params = opening.prior, opening.rows, state.settle_params(given)
    about, noise, apart = map_estimate.find_most_probable(state, prior, rows, params)
    total = map_estimate.compute_total_sd(params, noise, about) if state.noise_known else noise
    residuals, _ = map_estimate.linearise(rows, about)
    fits = np.abs(residuals) <= params.gate * max(total, robust_scale(residuals))
    marked = np.column_stack([rows[:, :5], fits])
    model = params.model(noise, jumps=False)
    if given.external_sd is None and len(rows) % map_estimate.MEMORY_FROM == 0:
        # each time they have doubled
        model = map_estimate.find_memory(prior, model, marked, about, total) or model
    if model.external_sd:
        first, *others = prior.scales  # the lasting error may be there at the start
        prior = prior._replace(scales=[max(first, model.external_sd**2), *others])
        opening, noise = replace(opening, prior=prior), model.noise
        lasting = {"external_sd": model.external_sd, "external_time_s": model.external_time_s}
        state = state.moved(opening=opening, **lasting)
    model = model._replace(gate=np.inf)
    earlier = max(len(rows) - STRIDE, 0)
    before, _, _ = kalman.advance(prior, model, marked[:earlier], linearised=about)
    estimate, _, _ = kalman.advance(before, model, marked[earlier:], linearised=about)
    after = replace(state, estimate=estimate, noise=noise)
    after = replace(after, jumps=_measure_jump(after, opening.before))
    magnitude = float(rows[-1, 4])
    closed = bool((apart < params.gate * after.bias_sd).all()) and _has_settled(
        after, opening, given, noise, total
    )
    if not closed and len(rows) < MOMENTS[-1]:
        wide = widen_for_nonlinearity(estimate, prior, apart, magnitude, noise)
        learns = compute_nonlinearity(wide, magnitude) < _NONLINEAR * noise
        return replace(after, estimate=wide, opening=replace(opening, outliers=0, learns=learns))
    wide = widen_for_nonlinearity(estimate, prior, apart * 0, magnitude, noise)
    after = replace(after, estimate=wide)
    recent = Recent(before=wide, middle=wide, rows=np.empty((0, 6)))
    if len(rows) >= STRIDE:  # a jump may hide in the last readings of an opening
        recent = Recent(before=before, middle=wide, rows=rows[earlier:])
    return replace(
        after,
        opening=None,
        noise_known=True,
        recent=recent,
        refused=state.refused + int((~fits).sum()),
    )


def _has_settled(
    state: TrackerState, opening: Opening, params: TrackerParams, noise: float, total: float
) -> bool:
    """Whether the filter may go on from an opening on its own, by the estimate of all its rows."""
    rows, estimate = opening.rows, state.estimate
    known = params.external_sd is not None or opening.before is not None or len(rows) >= 768
    # whether the bias walked further during these rows than it is unknown
    variance = 3 * params.walk**2 * (rows[-1, 0] - rows[0, 0])
    walked = bool(variance > np.trace(estimate.covariance[1:4, 1:4]))
    fitting = opening.outliers is not None and 4 * opening.outliers <= len(rows)
    few = not state.noise_known and len(rows) < 64
    limit = _CURVED * noise if len(rows) < _PATIENT else _NONLINEAR * total
    linear = walked or compute_nonlinearity(estimate, float(rows[-1, 4])) < limit
    return (known or walked) and fitting and linear and not few


def date_jump(
    state: TrackerState, params: TrackerParams, seen: kalman.Predictions, rows: Array
) -> tuple[float, int]:
    """How improbable it is that a jump began with the opening, and the row that fits better.

    Σ ρ(z) of what was `seen` before a row, and of what is left of `rows` from it on about the most
    probable bias of the opening, and how far that is from its prior; Cauchy's ρ, so that outliers
    decide little. Of rows that are as good, the last: a reading from before the jump taken for one
    after it spoils more.
    """
    opening = state.opening
    assert opening is not None, "a jump has opened the state"
    about, noise, _ = map_estimate.find_most_probable(state, opening.prior, opening.rows, params)
    total = map_estimate.compute_total_sd(params, noise, about)
    rho = cauchy().value
    left, _ = map_estimate.linearise(rows, about)
    old, new = rho((seen.residual / seen.sd) ** 2), rho((left / total) ** 2)
    away, _ = map_estimate.make_gaussian(opening.prior)(about[1 : len(opening.prior.diagonal)])
    cost = np.concatenate([[0.0], np.cumsum(old - new)])[:-1]
    cost += float(new.sum() + away @ away / 2)
    here = float(cost[len(rows) - len(opening.rows)])
    return here, int(np.flatnonzero(cost < cost.min() + DOUBT)[-1])


def _measure_jump(state: TrackerState, before: states.FilterState | None) -> tuple[Jump, ...]:
    """The jumps so far, the last one measured by what its opening made of the bias."""
    if before is None:
        return state.jumps
    *earlier, last = state.jumps
    shift = state.bias - before.state[1:4]
    sd = np.sqrt(np.diag(before.covariance)[1:4] + state.bias_sd**2)
    return (*earlier, replace(last, shift=shift, shift_sd=sd))
