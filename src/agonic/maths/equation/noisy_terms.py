"""What noise of a recorded current does to a fit: it draws the slopes towards zero.

What a current x does is K x, and x is recorded with noise of its own. Least squares then finds K
too small, by the share of x that is noise, and the bias too large. A current mostly changes slowly
and its noise does not: h is what is left of x by a smooth course. If the field follows x (1 − κ)h
less, κ is 0 where the quick part is the current's own and 1 where it is the ammeter's noise:

    field = W (raw − bias − K (x − κ h)).

κ is one number for each x, found by one step from the estimate, and averaged with its being none.
The fit is made again with x − κ h.

Source: errors in variables with the smooth part as an instrument (W. A. Fuller, Measurement Error
Models, 1987, section 1.4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate, refine
from agonic.maths.estimation.filters.whittaker import FEWEST, smooth
from agonic.maths.estimation.inference import average_over_term
from agonic.maths.estimation.leastsq import inverse

_NOISY = 0.5  # probability that a column is noisy, before the readings are seen
_TELLING = 1.0  # variance of a share: a column that hardly moves the readings tells none of it
_SEEN = 1e-4  # of the column: less does nothing


class Corrected(NamedTuple):
    """The problem with terms less their noise, and its estimate."""

    problem: Problem
    estimate: Estimate


def correct_for_current_noise(problem: Problem, estimate: Estimate, robust: bool) -> Corrected:
    """The problem with the noise of terms taken off, as far as that is sure, and its estimate.

    Parameters: the problem of the readings that were fitted, in order of time.
    """
    solution = estimate.solution
    unchanged = Corrected(problem, estimate)
    if problem.terms is None or len(problem.terms) < FEWEST:
        return unchanged
    quick = np.stack([column - smooth(column).values for column in problem.terms.T], axis=1)
    if (quick.std(axis=0) < _SEEN).any():
        return unchanged
    by, noise, spread = _find_noise(problem, estimate, quick)
    noisy = np.zeros(len(noise))
    for k in np.flatnonzero((noise > 0.0) & (np.diag(spread) < _TELLING)):
        found = average_over_term(noise[[k]], spread[[k]][:, [k]], slice(0, 1), _NOISY)
        noisy[k] = found.params[0]
    if not noisy.any():
        return unchanged
    params = problem.move(solution.params, -by @ noisy)
    grown = _measure_slopes(problem, params) / _measure_slopes(problem, solution.params)
    share = np.minimum(noisy / np.maximum(grown, 1.0), 1.0)
    calmed = problem._replace(terms=problem.terms - share * quick)
    return Corrected(calmed, refine(calmed, params, robust))


def _measure_slopes(problem: Problem, params: Array) -> Array:
    """The size of the slopes of each term, (k,)."""
    assert problem.terms is not None
    m, k = problem.basis.shape[1], 3 * problem.terms.shape[1]
    return np.asarray(np.linalg.norm(params[m : m + k].reshape(3, -1), axis=0))


def _find_noise(problem: Problem, estimate: Estimate, quick: Array) -> tuple[Array, Array, Array]:
    """By how much parameters (m, k) fall with each κ, κ (k,), and its covariance (k, k)."""
    params, m = estimate.solution.params, problem.basis.shape[1]
    slopes = params[m : m + 3 * quick.shape[1]].reshape(3, -1)
    known = inverse(estimate.solution.information + problem.prior_information(params))
    shared, gradient = np.zeros((len(params), len(slopes.T))), np.zeros(len(slopes.T))
    information, scatter = np.zeros((len(gradient),) * 2), np.zeros((len(gradient),) * 2)
    sd = estimate.noise["magnitude"].sd
    for channel, of in estimate.noise.items():
        found = zip(*pieces(problem, channel, sd)(params), strict=True)
        r, jacobian = (np.concatenate(side) for side in found)
        added = -(jacobian[:, :3] @ slopes) * quick
        weighted = added * (estimate.weights / of.sd**2 / of.correlation)[:, None]
        shared += jacobian.T @ weighted
        gradient += r @ weighted
        information += added.T @ weighted
        scatter += weighted.T @ weighted * of.sd**2
    by = known @ shared
    response = inverse(information - shared.T @ by)
    return by, -response @ gradient, response @ scatter @ response
