"""How probable each naming of an accelerometer's axes is beside a gyro.

Carried along by the gyro gravity stands still, so in a window of time an accelerometer feels

    f = T (−R(t)ᵀ (a + c t) + ω × u + ω̃ × v) + b + noise,

T naming its axes, R being the attitude that the rates ω turn through, a gravity, c what the gyro's
bias makes of it, and u, v velocities that the vehicle keeps in slow and in fast turns ω̃: in a gust
it only nods. Whatever else accelerates it is noise, of every axis and octave of frequency its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.one_pass import median
from agonic.maths.rotations.attitude import integrate_rates
from agonic.maths.rotations.low_pass import low_pass
from agonic.maths.rotations.vectors import skew
from agonic.units import STANDARD_GRAVITY_M_S2

WINDOW_S = 30.0
"""So long the gyro carries gravity, but for a drift; a shorter log is cut in two."""
FASTEST_HZ = 2.0
"""Faster changes are those of vibration, and of sensors that are late."""
NODDING_S = 1.0
"""Slower turns change the course."""
GYRO_BIAS_SD = float(np.radians(1.0))
SPEED_SD_M_S = 30.0
TAILS = 3.0
"""Degrees of freedom of Student's t: a stretch of road may be rougher than the next."""
_INDEPENDENT_WINDOWS = 1.9
"""Of windows that overlap by half, under a taper, for every length of a window."""
_ROUNDS = 15
_SAMPLED = 6
"""Means in a period of what changes fastest."""
_FEWEST_MEANS = 16
"""Of a window, however short."""


class _Spectra(NamedTuple):
    """Of window w, axis p and band, as if all values were independent: products of what the axes
    may feel with one another, `among` (w, 3, bands, q, q), with what they do feel, `across`
    (w, 3, bands, 3, q), and of that, `square` (w, bands, 3, 3); `values` (bands,) of each.
    """

    among: Array
    across: Array
    square: Array
    values: Array
    prior_sd: Array


def compare_namings(force: Array, rate: Array, time: Array, turns: Array) -> Array:
    """The logarithm of the probability of what an accelerometer reads in each window, (…, k, w).

    A log of pauses, or of half turns from row to row, has no windows. All that is unknown in one
    is integrated out under its prior, and the noise is the most probable one of all: marginal
    likelihood. T and −T are as probable.

    Parameters: specific force (…, n, 3) m/s², as one accelerometer or several read it, and rate
    (n, 3) rad/s at time (n,) s; `turns` (k, 3, 3) are signed permutations from the axes of the gyro
    to those of the accelerometer.
    """
    rows, starts = _cut_windows(time)
    # pauses everywhere, as between blocks of a log, or rows that no curve goes through
    if not starts or not _is_followed(rate, time):
        return np.zeros((*force.shape[:-2], len(turns), 0))
    each = _measure_spectra(force.reshape(-1, *force.shape[-2:]), rate, time, rows, starts)
    found = np.array([[_weigh(spectra, turn) for turn in turns] for spectra in each])
    return found.reshape(*force.shape[:-2], *found.shape[1:])


def _is_followed(rate: Array, time: Array) -> bool:
    """Whether rates turn by less than half a turn from row to row, and no two rows are as good as
    simultaneous: between others nothing can be carried along."""
    steps = np.diff(time)
    step = median(steps)
    return float(np.abs(rate).max()) * step < np.pi and float(steps.min()) > 1e-6 * step


def _cut_windows(time: Array) -> tuple[int, list[int]]:
    """How many rows a window has, and where each starts; none across a pause."""
    n, step = len(time), median(np.diff(time))
    rows = min(round(WINDOW_S / step), n // 2)
    count = round((n - rows) / (rows / 2)) + 1
    starts = np.unique(np.linspace(0, n - rows, count).astype(int))
    span = time[starts + rows - 1] - time[starts]
    return rows, starts[span < 1.2 * rows * step].tolist()


def _measure_spectra(
    forces: Array, rate: Array, time: Array, rows: int, starts: list[int]
) -> list[_Spectra]:
    """Those of each of several forces (s, n, 3)."""
    step = median(np.diff(time))
    every = max(1, min(int(1 / (_SAMPLED * FASTEST_HZ * step)), rows // _FEWEST_MEANS))
    means, length_s = rows // every, rows * step
    taper = np.sin(np.pi * (np.arange(means) + 0.5) / means) ** 2
    kept, band = _cut_bands(means, every * step)
    overlap = min(1.0, _INDEPENDENT_WINDOWS * len(time) / rows / len(starts))
    independent = 2 * overlap * (taper**2).mean() ** 2 / (taper**4).mean()
    edges = np.searchsorted(band, np.unique(band))
    slow = low_pass(rate, step, NODDING_S)

    def transform(values: Array) -> Array:
        seen = _average(values, every)
        return np.asarray(
            np.fft.rfft((seen - seen.mean(axis=0)) * taper[:, None, None], axis=0)[kept]
        )

    def add_up(products: Array) -> Array:
        return np.asarray(np.add.reduceat(products.real, edges) * (independent / means))

    among, across, square = list[Array](), list[Array](), list[Array]()
    for start in starts:
        part = slice(start, start + rows)
        may = transform(_spread_unknowns(rate[part], slow[part], time[part]))  # (f, 3, q)
        felt = transform(forces[:, part].swapaxes(0, 1))  # (f, s, 3)
        among.append(add_up(may[..., :, None].conj() * may[..., None, :]))
        across.append(add_up(felt[:, :, None, :, None].conj() * may[:, None, :, None, :]))
        square.append(add_up(felt[..., :, None].conj() * felt[..., None, :]))
    sds = (
        STANDARD_GRAVITY_M_S2,
        STANDARD_GRAVITY_M_S2 * GYRO_BIAS_SD * length_s / 2,
        SPEED_SD_M_S,
        SPEED_SD_M_S,
    )
    known, values = np.stack(among).swapaxes(1, 2), np.bincount(band) * independent
    felt_across = np.moveaxis(np.stack(across), 2, 0).swapaxes(2, 3)
    felt_square = np.moveaxis(np.stack(square), 2, 0)
    return [
        _Spectra(known, one, two, values, np.repeat(sds, 3))
        for one, two in zip(felt_across, felt_square, strict=True)
    ]


def _average(rows: Array, every: int) -> Array:
    """Means of so many rows."""
    means = len(rows) // every
    return np.asarray(rows[: means * every].reshape(means, every, *rows.shape[1:]).mean(axis=1))


def _cut_bands(rows: int, step: float) -> tuple[Index, Index]:
    """Which frequencies count, and the number of the band of each: the lowest two, then octaves."""
    kept = np.arange(1, max(round(FASTEST_HZ * rows * step), 4))
    kept = kept[kept <= rows // 2]
    octave = np.floor(np.log2(np.maximum(kept / 2.5, 0.5))).astype(int) + 1
    return kept, octave


def _spread_unknowns(rate: Array, slow: Array, time: Array) -> Array:
    """What gravity, its drift and two velocities make each axis feel, (n, 3, 12)."""
    carried = integrate_rates(rate, time).as_matrix().swapaxes(1, 2)
    since = (time - time.mean()) / np.ptp(time) * 2
    turning = skew(slow), skew(rate - slow)
    return np.concatenate([carried, carried * since[:, None, None], *turning], axis=2)


def _weigh(spectra: _Spectra, turn: Array) -> Array:
    """The logarithm of the probability of each window with one naming, (w,).

    The noise S of an axis and band, and the weight of each window, by expectation and maximisation.
    """
    n, sds = spectra.values, spectra.prior_sd
    windows = len(spectra.among)
    among = spectra.among.reshape(windows, -1, len(sds) ** 2)
    across = np.einsum("jp,wpbjq->wpbq", turn, spectra.across).reshape(windows, -1, len(sds))
    square = np.einsum("jp,kp,wbjk->wpb", turn, turn, spectra.square)
    shape = square.shape
    weight, noise = np.ones_like(square), np.maximum(square.mean(axis=0) / n, 1e-12)
    for _ in range(_ROUNDS):
        share = (weight / noise).reshape(windows, 1, -1)
        information = (share @ among).reshape(-1, len(sds), len(sds)) + np.diag(sds**-2.0)
        covariance = np.linalg.inv(information)
        found = covariance @ (share @ across).swapaxes(1, 2)  # (w, q, 1)
        both = np.stack([found @ found.swapaxes(1, 2), covariance], axis=3)
        taken, doubt = np.moveaxis(among @ both.reshape(windows, -1, 2), 2, 0)
        left = np.maximum(square + (taken - 2 * (across @ found)[..., 0]).reshape(shape), 0.0)
        expected = left + doubt.reshape(shape)
        weight = (TAILS + n) / (TAILS + expected / noise)
        noise = np.maximum((weight * expected).mean(axis=0) / n, 1e-12)
    told = (n * np.log(noise)).sum() + ((TAILS + n) * np.log1p(left / (TAILS * noise))).sum((1, 2))
    free = np.linalg.slogdet(information * np.outer(sds, sds))[1]
    return np.asarray(-(told + free + ((found[..., 0] / sds) ** 2).sum(axis=1)) / 2)
