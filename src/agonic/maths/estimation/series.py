"""One station's readings in the order they were taken: anomalies, direction and rate of change.

Running medians and means are taken over blocks of rows and drawn straight from one to the next:
the same to the accuracy needed here as a window that slides, and many times faster.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.one_pass import median

BLOCK = 32  # rows; a burst of outliers shorter than half of it does not move the median
ANOMALOUS = 6.0  # standard deviations
_BLOCKS, _LEAST = 60, 9  # short recordings of a wide range have shorter blocks
_SPAN_S, _LONGEST_S, _FEWEST = 20.0, 60.0, 6  # over which a rate is taken: seconds, and rows
_TURN = 0.1  # of the range: what temperature must go back by to have turned
_TURN_C = 1.5


def compute_running_mean(values: Array, block: int = BLOCK) -> Array:
    """The running mean of each column of values (n, c), (n, c)."""
    return _draw_lines(values, block, np.mean)[0]


def _draw_lines(values: Array, block: int, middle: Callable[..., Array]) -> tuple[Array, Array]:
    """What `middle` makes of each block, joined by straight lines through the blocks' middles.

    The lines go on to the first and the last row, at the slope of the nearest two blocks. Returns
    the lines, and how far each goes from block to block and bends at its ends, (n, c) both.
    """
    n = len(values)
    count = max(n // max(block, 1), 1)
    size = n // count
    first = values[: count * size].reshape(count, size, -1)
    knots = middle(first, axis=1)
    if n > count * size:  # the last block takes the rows that are left over
        knots[-1] = middle(values[(count - 1) * size :], axis=0)
    if count == 1:
        return np.broadcast_to(knots, values.shape).copy(), np.zeros(values.shape)
    at = (np.arange(n) - (size - 1) / 2) / size
    left = np.clip(at.astype(np.intp), 0, count - 2)
    share = (at - left)[:, None]
    steps = np.diff(knots, axis=0)
    bends = np.abs(np.diff(steps, axis=0, prepend=steps[:1], append=steps[-1:]))
    moving = np.abs(steps) + np.maximum(bends[:-1], bends[1:])
    if count > 2:  # the lines that go on beyond the first and last middle bend as their neighbours
        moving[0] += bends[1]
        moving[-1] += bends[-2]
    return knots[left] + steps[left] * share, moving[left]


def find_anomalies(field: Array) -> Mask:
    """Rows (n,) of field (n, 3) that stand out of the running median on some axis.

    The scale is the median absolute residual; for readings in coarse steps at least half a step.
    The limit of `ANOMALOUS` standard deviations grows with the number of rows, so that of honest
    readings hardly one is ever taken, and where the median itself moves, by as much as it does.
    """
    n = len(field)
    block = min(BLOCK, max(n // _BLOCKS, _LEAST))
    if n < 2 * block:
        return np.zeros(n, dtype=bool)
    middle, moving = _draw_lines(field, block, np.median)
    left = np.abs(field - middle)
    limit = max(ANOMALOUS, float(np.sqrt(2 * np.log(6 * n))) + 1)
    return np.asarray((left > limit * _scale(left, field) + moving).any(axis=1))


def _scale(left: Array, field: Array) -> Array:
    """Standard deviation of each axis from its absolute residuals."""
    steps = np.abs(np.diff(field, axis=0))
    step = np.where(steps > 0, steps, np.inf).min(axis=0)
    least = np.where(np.isfinite(step), step / 2, 0.0)
    return np.maximum(MAD_TO_SD * np.median(left, axis=0), least)


def find_heating(temperature: Array) -> Mask:
    """Rows (n,) recorded while the temperature rose, or stayed where it had risen to.

    It has turned once it goes back by a tenth of the range; the turn is at the extreme before."""
    block = min(BLOCK, max(len(temperature) // 20, 1))
    smooth = compute_running_mean(temperature[:, None], block)[:, 0]
    turn = max(_TURN * float(np.ptp(smooth)), _TURN_C)
    rising = np.zeros(len(smooth), dtype=bool)
    start = 0
    for stop, up in _legs(smooth, turn):
        rising[start:stop] = up
        start = stop
    return rising


def _legs(smooth: Array, turn: float) -> list[tuple[int, bool]]:
    """The row after each stretch in one direction, and whether the temperature rose in it."""
    every = max(len(smooth) // 4000, 1)
    coarse = smooth[::every]
    legs: list[tuple[int, bool]] = []
    low = high = 0
    up: bool | None = None
    for row, value in enumerate(coarse.tolist()):
        low = row if value < coarse[low] else low
        high = row if value > coarse[high] else high
        if up is not True and value - coarse[low] > turn:
            if up is False:
                legs.append((low * every, False))
            up, high = True, row
        elif up is not False and coarse[high] - value > turn:
            if up is True:
                legs.append((high * every, True))
            up, low = False, row
    return [*legs, (len(smooth), bool(up))]


def compute_rates(time: Array, temperature: Array, span_s: float = _SPAN_S) -> Array:
    """dT/dt (n,), °C/s, taken over about `span_s`, longer where that holds few rows."""
    n = len(time)
    pace = median(np.diff(time)) if n > 1 else 1.0
    rows, most = (round(span / max(pace, 1e-9)) for span in (span_s, max(span_s, _LONGEST_S)))
    block = min(max(rows, min(_FEWEST, most), 1), max(n // 4, 1))
    knots = np.arange(0, n, block)
    if n < 3 or len(knots) < 3:
        return np.zeros(n)
    sums = np.add.reduceat(np.stack([time, temperature], axis=1), knots, axis=0)
    t, level = (sums / np.diff(np.append(knots, n))[:, None]).T
    return np.asarray(np.interp(time, t, np.gradient(level, t)))
