"""How late readings come beside the attitude: variable projection over stretches of time.

A field that is constant in n reads raw(t) = A R(t − τ)ᵀ B + b, which is linear in unknowns once the
latency τ is known: raw(t) = Γ vec R(t − τ) + b, with R = rot_nb. Γ (3, 9) and b (3,) are free in
every stretch, so no calibration, no field and no mounting has to be known, attitude may drift, and
a magnet that comes or goes spoils one stretch. They are projected out (Golub & Pereyra 1973, with
Kaufman's 1975 Jacobian); τ remains. The smooth attitude is shifted, never the noisy readings:
interpolated noise is smaller between rows than on them, which would draw τ away from the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.attitude.maths.path import Path, attitude_path, gyro_path
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.one_pass import find_length, median

MOST_ROWS = 12_000
"""Rows that are compared with the attitude, evenly spread; of a gyro all are integrated."""

_SUPPORTED = 1e-8  # part of a stretch's largest mean square; 5 nT of 50 000 are below the noise
_MEDIAN_NORM = 1.5382  # median length of three Gaussian numbers, √(median of χ²₃)
_FEWEST = 30  # rows of a stretch, for ten regressors
_SCAN_S = 0.02  # a hand's fastest motion takes ten times as long
_SCAN_RAD = 0.1  # a tenth of what turns a residual beside its derivative
_CLEARLY = 50.0  # of a logarithm: what regressors that hardly show make of noise is less
_SHRUNK = 3.0  # variances of the noise, one an axis: what noise alone fits is not motion
_BLOCKS = 40
_ITERATIONS = 20
_SETTLED = 0.05  # of a standard error
_DRIFT_RAD_S = 1e-4  # 0.06° in ten seconds
_FIRST_STEPS = 4  # weights follow the residuals; a bias is put in, its rest projected out


class Record(NamedTuple):
    """The rows that take part: `time` (n,), `raw` (n, 3), the first row of each stretch, and n."""

    time: Array
    raw: Array
    edges: Index

    def thin(self, most: int) -> Record:
        """Some of the rows, evenly spread, that about so many are left: every so many as long as a
        stretch keeps `_FEWEST`, and then every so many stretches."""
        shortest = int(np.diff(self.edges).min(initial=len(self.time)))
        every = max(1, min(len(self.time) // most, shortest // _FEWEST))
        edges = -(-self.edges // every)
        time, raw = self.time[::every], self.raw[::every]
        skipped = max(1, len(time) // most)
        kept = np.flatnonzero(np.arange(len(edges) - 1) % skipped == 0)
        rows = np.isin(np.repeat(np.arange(len(edges) - 1), np.diff(edges)), kept)
        ends = np.cumsum(np.diff(edges)[kept])
        return Record(time[rows], raw[rows], np.concatenate([[0], ends]).astype(np.intp))


class Estimate(NamedTuple):
    """The latency, its standard error, residuals per axis without and with it, rows that count."""

    latency_s: float
    sd_s: float
    before: float
    after: float
    n: int


class _Projected(NamedTuple):
    """Residuals (n, 3), and by how much they fall (k, n, 3) with latency and with drifts."""

    residuals: Array
    slopes: Array


def runs(time: Array) -> list[Index]:
    """The rows between gaps: intervals above five usual ones and above 50 ms."""
    interval = np.diff(time)
    limit = max(5 * median(interval), 0.05) if len(interval) else 0.0
    return np.split(np.arange(len(time)), np.flatnonzero(interval > limit) + 1)


def record(time: Array, raw: Array, margin_s: float, stretch_s: float) -> Record:
    """The rows that keep `margin_s` from ends and gaps, cut into stretches of about `stretch_s`."""
    kept, edges, count = [np.zeros(0, dtype=np.intp)], [0], 0
    for run in runs(time):
        inside = run[(time[run] > time[run[0]] + margin_s) & (time[run] < time[run[-1]] - margin_s)]
        if len(inside) < _FEWEST:
            continue
        span = time[inside[-1]] - time[inside[0]]
        pieces = max(1, min(round(span / stretch_s), len(inside) // _FEWEST))
        kept.append(inside)
        edges += [count + len(inside) * (k + 1) // pieces for k in range(pieces)]
        count += len(inside)
    rows = np.concatenate(kept)
    return Record(time[rows], raw[rows], np.array(edges)).thin(MOST_ROWS)


def estimate_attitude(record: Record, time: Array, rot_nb: Array, limit_s: float) -> Estimate:
    """The latency, within ± `limit_s`, of readings beside recorded attitudes (m, 3, 3)."""
    path = attitude_path(time, rot_nb)
    return _refine(record, lambda _: path, limit_s)


def estimate_gyro(record: Record, time: Array, rotation_rate: Array, limit_s: float) -> Estimate:
    """The latency of readings beside a gyro (m, 3) rad/s, whose bias is estimated with it."""
    return _refine(record, lambda bias: gyro_path(time, rotation_rate + bias), limit_s)


def _refine(record: Record, path_at: Callable[[Array], Path], limit_s: float) -> Estimate:
    """Gauss–Newton on latency and gyro bias from a scan, with Tukey's weights anew at each step."""
    weights, bias = np.ones(len(record.time)), np.zeros(3)
    path = path_at(bias)
    latency = _scan(record, path, limit_s)
    for turn in range(_ITERATIONS):
        seen = _projected(record, path, latency, weights)
        weights, noise = _weigh_rows(record, seen.residuals)
        z, fall, drift = _standardise(seen, weights, noise)
        trust = _weigh_blocks(z, fall)
        information = float((trust * fall**2).sum())
        if not information > 0:
            break
        step = float((trust * fall * z).sum()) / information
        latency, before = float(np.clip(latency + step, -limit_s, limit_s)), latency
        if turn < _FIRST_STEPS and np.abs(drift).max(initial=0.0) > _DRIFT_RAD_S:
            bias = bias + drift
            path = path_at(bias)
        elif turn >= _FIRST_STEPS and (latency - before) ** 2 * information < _SETTLED**2:
            break
    return _conclude(record, path, latency, weights)


def _conclude(record: Record, path: Path, latency: float, weights: Array) -> Estimate:
    """The estimate with its standard error √(Σ J ρ Jᵀ)/H, ρ the correlation of the residuals. H,
    the curvature of the cost, is the change of the score over one interval of time: in ΣJ² the
    noise of an attitude would pass for motion."""
    half = median(np.diff(record.time)) / 2
    seen = _projected(record, path, latency, weights)
    noise = _weigh_rows(record, seen.residuals)[1]
    z, fall, _ = _standardise(seen, weights, noise)
    trust = _weigh_blocks(z, fall)
    scores = []
    for at in (latency - half, latency + half):
        there = _standardise(_projected(record, path, at, weights), weights, noise)
        scores.append(float((trust * there[0] * there[1]).sum()))
    curvature = (scores[0] - scores[1]) / (2 * half)
    # by the correlation of z or by batches of time, whichever is larger
    by_batches = (_compute_batch_variance(z, fall, count) for count in _BATCHES)
    scatter = max(_scatter(z, trust * fall), *by_batches)
    sd = np.sqrt(scatter) / curvature if curvature > 0 else np.inf
    at_once = _fit_stretches(record, path, 0.0, weights)
    none = at_once.residuals[at_once.inside]
    counted = int((weights * trust[:, 0] > 0).sum())
    return Estimate(latency, float(sd), _size(none), _size(seen.residuals), counted)


def _standardise(seen: _Projected, weights: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Residuals and slopes (n, 3) along latency in units of the noise, weighted; step of drifts."""
    slope, drift = _profile_drifts(seen, weights / noise**2)
    unit = (np.sqrt(weights) / noise)[:, None]
    return seen.residuals * unit, slope * unit, drift


def _weigh_blocks(z: Array, fall: Array) -> Array:
    """Tukey's weight (n, 1) of the block of a row: small where a disturbance spoils the block. A
    block's score g = Σ J z over √h, h = Σ J², is judged by the scatter of those of all blocks."""
    each, more = divmod(len(z), _BLOCKS)  # the first blocks have a row more
    starts = np.arange(_BLOCKS) * each + np.minimum(np.arange(_BLOCKS), more)
    g = np.add.reduceat((z * fall).sum(axis=1), starts)
    h = np.add.reduceat((fall**2).sum(axis=1), starts)
    h += 1e-3 * h.max() + 1e-300
    weights, far = np.ones(len(g)), g
    for _ in range(20):
        far = (g - h * (weights @ g) / (weights @ h)) / np.sqrt(h)
        spread = max(MAD_TO_SD * median(np.abs(far)), 1e-300)
        weights = np.maximum(tukey().weight((far / spread) ** 2), 1e-9)
    return np.repeat(weights, np.diff(starts, append=len(z)))[:, None]


def _scan(record: Record, path: Path, limit_s: float) -> float:
    """The best latency of a coarse grid: Σ n log σ over stretches is least. A step of the grid is a
    small turn at the rate of this log; about its lowest minima, and about zero, it is halved down
    to `_SCAN_S`, as Gauss–Newton may settle on the lesser of two optima a few milliseconds apart.
    Farther from zero is what is clearly better."""
    square = float((path.entries(record.time, 1) ** 2).sum(axis=1).mean())  # |dR/dt|² is 2 ω²
    rate = float(np.sqrt(square / 2))
    each = max(1, round(min(limit_s / _SCAN_S, limit_s * rate / _SCAN_RAD)))
    weights = np.ones(len(record.time))

    @cache
    def cost(latency: float) -> tuple[float, float]:
        found = _fit_stretches(record, path, latency, weights)
        noise = _weigh_rows(record, found.residuals[found.inside])[1]
        return 3 * float(np.log(noise).sum()), latency

    def halve(best: tuple[float, float]) -> tuple[float, float]:
        step = limit_s / each
        while step > 1.5 * _SCAN_S:
            step /= 2
            beside = np.clip((best[1] - step, best[1] + step), -limit_s, limit_s)
            best = min(best, *map(cost, beside.tolist()))
        return best

    grid = [cost(k * limit_s / each) for k in range(-each, each + 1)]
    around = zip([(np.inf, 0.0), *grid], grid, [*grid[1:], (np.inf, 0.0)], strict=False)
    minima = sorted(here for before, here, after in around if here < min(before, after))
    near, lowest = halve(min(grid[each - 1 : each + 2])), min(map(halve, minima[:3]))
    best = grid[each]
    for other in (near, lowest):
        best = other if other[0] < best[0] - _CLEARLY else best
    return best[1]


class _Fitted(NamedTuple):
    """The weighted least squares of all stretches, each filled up with rows that do not count: the
    numbers of the `rows` (s, l), which are `inside`; what projects (s, l, 10) and what makes that
    of the regressors (s, 10, 10); weights (s, l, 1), numbers found (s, 10, 3), residuals."""

    rows: Index
    inside: Mask
    basis: Array
    scaled: Array
    weights: Array
    found: Array
    residuals: Array


def _fit_stretches(record: Record, path: Path, latency: float, weights: Array) -> _Fitted:
    """The readings of every stretch beside the attitude as late as that."""
    at = record.time - latency
    entries = np.column_stack([np.ones(len(at)), path.entries(at)])
    rows, inside = _fill_up(record.edges)
    x, w, raw = entries[rows], (weights[rows] * inside)[..., None], record.raw[rows]
    power, axes = np.linalg.eigh(x.swapaxes(1, 2) @ (w * x))
    seen = power > _SUPPORTED * power[:, -1:]
    scaled = axes * (seen / np.sqrt(np.where(seen, power, 1.0)))[:, None]
    basis = x @ scaled
    found = basis.swapaxes(1, 2) @ (w * raw)
    return _Fitted(rows, inside, basis, scaled, w, found, raw - basis @ found)


def _fill_up(edges: Index) -> tuple[Index, Mask]:
    """The rows of stretches, filled up to the longest, (s, l), and which of them are theirs."""
    lengths = np.diff(edges)
    places = np.arange(lengths.max())
    inside = places < lengths[:, None]
    return np.where(inside, edges[:-1, None] + places, edges[:-1, None]), inside


def _projected(record: Record, path: Path, latency: float, weights: Array) -> _Projected:
    """Residuals of the weighted least squares of every stretch, and Kaufman's slopes."""
    at = record.time - latency
    changes = np.concatenate([-path.entries(at, 1)[None], path.find_drifts(at)])
    rows, inside, basis, scaled, w, found, residuals = _fit_stretches(
        record, path, latency, weights
    )
    freedom = w.sum(axis=(1, 2)) - np.count_nonzero(scaled.any(axis=1), axis=1)
    noise = (w * residuals**2).sum(axis=(1, 2)) / np.maximum(freedom, 1.0)
    size = (found**2).sum(axis=2)
    size[size < 1e-300] = np.inf  # nothing was found: there is nothing to shrink
    clear = np.maximum(1.0 - _SHRUNK * noise[:, None] / size, 0.0)
    moved = changes[:, rows] @ (scaled @ (clear[..., None] * found))[:, 1:]
    slopes = moved - basis @ (basis.swapaxes(1, 2) @ (w * moved))
    return _Projected(residuals[inside], slopes[:, inside])


def _weigh_rows(record: Record, residuals: Array) -> tuple[Array, Array]:
    """Tukey weight and standard deviation (n,) of each row, from the residuals of its stretch."""
    far = np.linalg.norm(residuals, axis=1)
    rows, inside = _fill_up(record.edges)
    ordered = np.sort(np.where(inside, far[rows], np.inf), axis=1)
    lengths = np.diff(record.edges)
    middle = np.stack([(lengths - 1) // 2, lengths // 2], axis=1)
    medians = np.take_along_axis(ordered, middle, axis=1).mean(axis=1)
    noise = np.repeat(medians / _MEDIAN_NORM, lengths)
    noise = np.maximum(noise, max(1e-9 * float(np.abs(record.raw).max()), 1e-150))
    return tukey().weight((far / noise) ** 2 / 3), noise


def _profile_drifts(seen: _Projected, weights: Array) -> tuple[Array, Array]:
    """The slope (n, 3) along latency, less what drifts explain of it; and the step of drifts."""
    along, drifts = seen.slopes[0], seen.slopes[1:]
    if not len(drifts):
        return along, np.zeros(0)
    weighted = (drifts * weights[:, None]).reshape(len(drifts), -1)
    solve = np.linalg.pinv(weighted @ drifts.reshape(len(drifts), -1).T, hermitian=True)
    share = solve @ (weighted @ along.ravel())
    return along - np.tensordot(share, drifts, 1), solve @ (weighted @ seen.residuals.ravel())


def _size(residuals: Array) -> float:
    """Standard deviation per axis from the median length."""
    return median(find_length(residuals)) / _MEDIAN_NORM


_BATCHES = (6, 12, 40)  # of time, in which scores scatter


def _scatter(z: Array, fall: Array) -> float:
    """The variance of Σ s, s = J·z: Σ s² (1 + 2 Σ_k ρ_k c_k), lags up to where ρ is lost in noise.
    ρ is the correlation of the residuals and c that of J, which are independent of each other."""
    rho, along = _correlations(z), _correlations(fall)
    quiet = np.flatnonzero(rho < 2 / np.sqrt(z.size))
    last = int(quiet[0]) if len(quiet) else len(rho)
    scores = (fall * z).sum(axis=1)
    return float(scores @ scores) * max(1 + 2 * float(rho[1:last] @ along[1:last]), 0.0)


def _compute_batch_variance(z: Array, fall: Array, count: int) -> float:
    """The variance of Σ s by the scatter of the sums of batches of time, widened by Student's t.
    Batches count by their information: a log with three turns has three, however long it is. No
    batch is left out or trusted less, since a turn that disagrees is what errors in turns look
    like. The widening is that of the interval of 95 %."""
    batches = np.array_split(np.arange(len(z)), count)
    g = np.array([(z[rows] * fall[rows]).sum() for rows in batches])
    h = np.array([(fall[rows] ** 2).sum() for rows in batches])
    freedom = max(h.sum() ** 2 / max((h**2).sum(), 1e-300) - 1.0, 1.0)
    g = g - h * (g.sum() / max(h.sum(), 1e-300))
    return float((g @ g) * (freedom + 1.0) / freedom * compute_widening(freedom) ** 2)


def _correlations(rows: Array) -> Array:
    """Σ_i x_i · x_{i+k} / Σ_i x_i · x_i of rows (n, 3), for k up to a quarter of them."""
    size = 1 << (2 * len(rows) - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(rows, size, axis=0)) ** 2
    sums = np.fft.irfft(spectrum.sum(axis=1), size)[: max(len(rows) // 4, 1)]
    return np.asarray(sums / max(sums[0], 1e-300))
