"""The one estimator of an affine calibration: maximum likelihood from magnitude, dip and azimuth.

Which channels are known decides the fit (`channels`). Each has a noise of its own and is weighted
by what its own residuals say. Start, relax, refine: `starting_values`, then `estimate`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import NO_SHARE, AttitudeShare, split
from agonic.maths.equation.channels import Problem, compute_residuals, pieces
from agonic.maths.equation.crowding import (
    choose_evenly,
    choose_spread_rows,
    find_spread_rows,
    weigh_places,
)
from agonic.maths.equation.outliers import (
    compute_surprise,
    find_bad_readings,
    find_corroborated,
    is_no_field,
    weigh,
)
from agonic.maths.equation.starting_values import find_starts, fit_at_once
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.batch_means import STRETCHES, measure_correlation
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise, is_like_gaussian

_SEARCH_ROWS = 3000  # readings for the search; the refinement uses all
_NOISE_ROWS = 10_000  # readings that settle noises
_MAX_VARIANCES_APART = 4.0  # of each unknown, the minimum of few readings off that of all
_MAX_SURPRISE = 1.0  # by which readings are less likely: a start is no nearer to a better minimum
_MIN_SHARE_KEPT = 0.5  # of the readings: fewer than that are no measure of the others
_MAX_NOISE = 0.5  # of the field: what scatters by more is misfit, whose square corrects nothing
MAX_WRONG_SHARE = 0.05
"""Of the readings: so many may be wrong where there is no doubt about a minimum."""
_NEGLIGIBLE = 0.01  # noise over the field that leaves no doubt about a fit
MIN_INFORMATION = 1e-6
"""Of the information along the best known direction: what less is known of is not told."""
_MAX_CLEAR_SD = 0.05  # standard error over the field, or over the gain
_NEVER = 1e-9  # of its standard deviation: a term that changes by less in a part is still there


class Estimate(NamedTuple):
    """The solution on the readings that count; noise and residuals (n,) of each channel by its
    name; and the weights (n,) of all readings, the least of the channels."""

    solution: leastsq.Solution
    noise: dict[str, Noise]
    residuals: dict[str, Array]
    weights: Array


def estimate(
    problem: Problem, *, robust: bool = True, seed: int = 0, start: Array | None = None
) -> Estimate:
    """The most probable parameters, how sure they are, and the noise of each channel.

    Starts are tried on a few thousand readings, first on ones that are spread over directions: a
    sensor that lay still for most of a log says little that often. Where all of these agree with a
    minimum, another one could hold for some of them only; otherwise the best of several is taken.
    Then all readings refine it, with Tukey's loss where any stands out. The refinement takes the
    noise's own effect on the curved surface out (`affine.magnitude_residual`). Where parameters to
    `start` from are given, theirs is the minimum if nearly all readings agree with it.
    """
    near = None if start is None else find_near(problem, start, robust)
    if near is not None:
        return near
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # where nothing holds them
        return _find_minimum(problem, robust, seed)


def find_near(problem: Problem, start: Array, robust: bool) -> Estimate | None:
    """The minimum near parameters; none where not nearly all readings agree with one."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            near = refine(problem, start, robust)
        except np.linalg.LinAlgError:  # so far off that numbers overflow
            return None
    agrees = np.isfinite(near.solution.cost) and np.mean(near.weights == 0.0) < MAX_WRONG_SHARE
    return near if agrees else None


def _find_minimum(problem: Problem, robust: bool, seed: int) -> Estimate:
    """The best minimum of all readings."""
    n = len(problem.points)
    weights = weigh_places(problem.points)
    spread = choose_spread_rows(weights)
    rows = choose_spread_rows(weights, most=_SEARCH_ROWS)
    tried: list[Estimate] = []
    for chosen in (rows, choose_evenly(n, _SEARCH_ROWS)):
        few, seen = problem, spread
        if len(chosen) < n:
            few = problem.subset(chosen)
            seen = find_spread_rows(few.points)
        found = _search(few, robust, seed, seen, tried)
        if found is None:
            break
        agreed = _agrees(few, found)
        again = few is not problem or (problem.magnitude_only and not agreed)
        if not again:
            tried.append(found)
        elif not any(_is_same(found, one) for one in tried):
            start = _refine_some(problem, found.solution.params, robust)
            tried.append(refine(problem, start, robust, spread))
        if agreed or len(rows) == min(n, _SEARCH_ROWS):
            break
    return _choose_likeliest(problem, tried)


def _refine_some(problem: Problem, params: Array, robust: bool) -> Array:
    """Parameters at the minimum of some of many readings: there noises settle as well as on all."""
    n = len(problem.points)
    if n < 2 * _NOISE_ROWS:
        return params
    return refine(problem.subset(choose_evenly(n, _NOISE_ROWS)), params, robust).solution.params


def _is_same(found: Estimate, known: Estimate) -> bool:
    """Whether the minimum of few readings is that which is known of all, as far as few tell."""
    apart = found.solution.params - known.solution.params
    far = float(apart @ leastsq.inverse(found.solution.covariance) @ apart)
    return far < _MAX_VARIANCES_APART * len(apart) or _leads_to(found.solution.params, known)


def _choose_likeliest(problem: Problem, tried: Sequence[Estimate]) -> Estimate:
    """The minimum about which the readings are the least unlikely; the only one as it is.

    A circle driven level is a sphere about its own centre as well, in which no reading dips as its
    attitude says, and readings at rest are one of noise: those are no minima where there is
    another.
    """
    if len(tried) == 1:
        return tried[0]
    sound = [one for one in tried if not is_no_field(problem, one.solution.params, one.noise)]
    return min(sound or tried, key=lambda found: compute_surprise(problem, *_list_parts(found)))


def _list_parts(found: Estimate) -> tuple[Array, dict[str, Noise], dict[str, Array]]:
    return found.solution.params, found.noise, found.residuals


def _search(
    few: Problem, robust: bool, seed: int, spread: Index, known: Sequence[Estimate]
) -> Estimate | None:
    """The best minimum from several starts, or the first that all readings agree with.

    Nothing where all starts lead to minima that are known. `spread` rows are over all that was
    seen.
    """
    at_once = fit_at_once(few, robust)
    tried: list[Estimate] = []
    if at_once is not None:
        found = refine(few, at_once, robust, spread)
        if _agrees(few, found):
            return found
    algebraic = at_once if few.magnitude_only else None
    for start in find_starts(few, algebraic, robust, seed):
        if any(_leads_to(start, one) for one in (*known, *tried)):
            continue
        anew = _refine_anew(few, start, robust, spread, (*known, *tried))
        if anew is None:
            continue
        tried.append(anew)
        if _agrees(few, anew):
            break
    return _choose_likeliest(few, tried) if tried else None


def _leads_to(start: Array, found: Estimate) -> bool:
    """Whether a start is so near to a minimum, within a standard error of each unknown, that it
    leads there."""
    apart = start - found.solution.params
    return bool(apart @ leastsq.inverse(found.solution.covariance) @ apart < len(apart))


def refine(problem: Problem, params: Array, robust: bool, spread: Index | None = None) -> Estimate:
    """The minimum on all readings that count, from a near start; noise level and correlation of
    each channel are taken from its residuals, its size from those of rows `spread` over all that
    was seen, where these are known."""
    rows = find_spread_rows(problem.points) if spread is None else spread
    found = _refine_anew(problem, params, robust, rows, ())
    assert found is not None
    return found


def _refine_anew(
    problem: Problem, params: Array, robust: bool, rows: Index, known: Sequence[Estimate]
) -> Estimate | None:
    """The same, or nothing as soon as the way leads to a minimum that is known, or where readings
    are so much less likely from the start that it leads to none that is better."""
    channels, count = problem.channels, len(params)
    residuals = {channel: compute_residuals(problem, channel, params) for channel in channels}
    typical = None if len(rows) == len(problem.points) else rows
    least = max(problem.rounding, 1e-9)
    unknowns = {channel: count + problem.eliminated.get(channel, 0) for channel in channels}
    noise = {
        c: estimate_noise(r, robust, unknowns[c], typical, least) for c, r in residuals.items()
    }
    alike = [_list_parts(one) for one in known if len(one.weights) == len(problem.points)]
    if alike:
        least_known = min(compute_surprise(problem, *one) for one in alike)
        if compute_surprise(problem, params, noise, residuals) > least_known + _MAX_SURPRISE:
            return None
    counted = np.ones(len(problem.points), dtype=bool)
    for _ in range(8 if problem.magnitude_only else 12):  # several noises settle more slowly
        part = problem if counted.all() else problem.subset(np.flatnonzero(counted))
        solution = solve_with_noise(part, noise, params)
        params, assumed = solution.params, noise
        if any(_leads_to(params, one) for one in known):
            return None
        left = dict(zip(channels, np.split(solution.residuals, len(channels)), strict=True))
        if typical is not None:
            typical = np.flatnonzero(np.isin(np.flatnonzero(counted), rows))
        noise = {c: estimate_noise(r, robust, unknowns[c], typical, least) for c, r in left.items()}
        if problem.shared is not None:  # what an inertial unit feels is wrong for seconds
            noise = _correlate(part, noise, params)
        residuals = left
        if part is not problem:
            residuals = {c: compute_residuals(problem, c, params) for c in channels}
        weights = weigh(residuals, assumed)
        used = counted
        settled = all(noise[channel].settled(assumed[channel]) for channel in channels)
        if problem.magnitude_only:
            of = assumed["magnitude"]
            sd = min(of.sd, _MAX_NOISE) * np.sqrt(of.correlation)
            fewer = counted & find_corroborated(problem, solution, weights, sd)
            counted = fewer if fewer.any() else counted
        elif settled:
            fewer = counted & ~find_bad_readings(residuals, assumed)
            counted = fewer if fewer.mean() > _MIN_SHARE_KEPT else counted
        if settled and np.array_equal(used, counted):
            break
    return Estimate(solution, noise, residuals, weights * used)


def solve_with_noise(problem: Problem, noise: dict[str, Noise], params: Array) -> leastsq.Solution:
    """The minimum near parameters, where the noise of each channel is known."""
    sd = min(noise["magnitude"].sd, _MAX_NOISE)
    shares = find_attitude_shares(problem, noise, params)
    return leastsq.solve_together(
        [
            leastsq.Channel(pieces(problem, c, sd, shares[c]), of.sd, of.loss, of.correlation)
            for c, of in noise.items()
        ],
        params,
        prior=problem.prior(problem.soft_iron_sd),
        tolerance=1e-2,
        move=problem.move,
    )


def estimate_part(problem: Problem, whole: Estimate, rows: Index) -> Estimate | None:
    """The estimate by rows (k,) of the problem that the `whole` is of, with its noise and weights:
    its minimum lies a few of its own standard errors from that of all readings.

    None where not nearly all of the rows agree with the whole, or they do not tell all of its
    unknowns.
    """
    weights = whole.weights[rows]
    if len(rows) < len(whole.solution.params) or np.mean(weights == 0.0) > MAX_WRONG_SHARE:
        return None
    part = problem.subset(rows[weights > 0.0])
    if part.terms is not None and (np.ptp(part.terms, axis=0) < _NEVER).any():
        return None
    try:
        solution = solve_with_noise(part, whole.noise, whole.solution.params)
    except np.linalg.LinAlgError:
        return None
    residuals = {channel: of[rows] for channel, of in whole.residuals.items()}
    return Estimate(solution, whole.noise, residuals, weights)


def find_attitude_shares(
    problem: Problem, noise: dict[str, Noise], params: Array
) -> dict[str, AttitudeShare]:
    """Which part of each channel's variance errors of the attitude make.

    Readings scatter all channels alike, σ². With errors of roll and pitch σ_t and of the heading
    σ_ψ, the dip scatters by F² σ_t² more, the azimuth by Z² σ_t² + H² σ_ψ²; of the latter the part
    F² σ_t² turns the whole field, and H² (σ_ψ² − σ_t²) its horizontal part.
    """
    shares = dict.fromkeys(noise, NO_SHARE)
    if problem.dip is None:
        return shares
    gain = float(np.trace(split(problem.basis @ params[: problem.basis.shape[1]])[1])) / 3
    if not gain > 0.0:
        return shares

    def exceed(channel: str) -> float:
        return 1.0 - min(noise["magnitude"].sd / noise[channel].sd, 1.0) ** 2

    tilt = exceed("dip")
    shares["dip"] = AttitudeShare(tilt, 0.0, gain)
    if problem.across is not None:
        both = exceed("azimuth")
        below = float(np.mean(problem.dip.vertical**2)) / float(np.mean(problem.magnitude**2))
        ratio = min(noise["dip"].sd / noise["azimuth"].sd, 1.0 / _NEGLIGIBLE) ** 2
        whole = min(tilt * ratio, both / max(below, _NEGLIGIBLE))
        shares["azimuth"] = AttitudeShare(whole, both - whole, gain)
    return shares


def _correlate(part: Problem, noise: dict[str, Noise], params: Array) -> dict[str, Noise]:
    """The noise with correlation lengths as the scores have them, where these are longer.

    Errors far below the noise of a reading decide the result where they last: residuals show
    nothing of them, sums of scores over seconds do.
    """
    found = dict(noise)
    for channel, of in noise.items():
        sides = zip(*pieces(part, channel)(params), strict=True)
        residuals, jacobian = (np.concatenate(side) for side in sides)
        z = residuals / of.sd
        scores = jacobian * (of.loss.weight(z * z) * z)[:, None]
        scores = scores / np.sqrt(np.maximum((scores**2).sum(axis=0), 1e-300))
        values, axes = np.linalg.eigh(scores.T @ scores)
        known = values > MIN_INFORMATION * values[-1]
        white = scores @ (axes[:, known] / np.sqrt(values[known]))
        blocks = np.arange(0, len(white), -(-len(white) // STRETCHES))
        sums = np.add.reduceat(white, blocks, axis=0)
        length = measure_correlation(sums, np.eye(int(known.sum())))
        found[channel] = of._replace(correlation=max(of.correlation, length))
    return found


def _agrees(problem: Problem, found: Estimate) -> bool:
    """Whether all readings lie as near to a well-determined minimum as Gaussian noise lets them.

    None was left out or counts for less in any channel, and the magnitude, which errors of the
    attitude do not reach, is as near to that of the field as Gaussian noise lets it. What is left
    must be little beside the field, so that no second surface can hide in the noise.
    """
    sd, count = found.noise["magnitude"].sd, len(found.solution.params)
    determined = np.diag(found.solution.covariance).max() < _MAX_CLEAR_SD**2
    return bool(
        found.weights.min() == 1.0
        and sd < _NEGLIGIBLE
        and (determined or not problem.magnitude_only)
        and not is_no_field(problem, found.solution.params, found.noise)  # nor a mirrored one
        and is_like_gaussian(found.residuals["magnitude"], sd, count)
    )
