"""Noise with memory: how much of the residuals lasts, and how long, by what predicts them best.

A filter that takes lasting errors for white ones learns each of them many times: its standard
errors are too small and it sees jumps where there are none. The errors of the reference and those
of a sensor, seen along the field, are one Gauss–Markov process beside the bias (`kalman`); its size
and time are those under which the first readings are most probable.

Source: F. C. Schweppe (1965), IEEE Transactions on Information Theory 11(1), 61–70, the likelihood
by innovations.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.filters import kalman

MEMORY_FROM = 192
"""Readings that can show a memory."""
_CERTAIN = 10.0  # log-likelihood by which a memory must explain the readings better than none
_TIMES = (1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)  # readings
_SHARES = (0.15, 0.5, 0.8, 0.97)  # of the variance that lasts
_FEWEST_MEMORIES = 4  # times in the readings: of longer ones nothing is seen


def find_memory(
    prior: kalman.FilterState, model: kalman.Model, rows: Array, about: Array, total: float
) -> kalman.Model | None:
    """The noise model whose lasting part makes rows (k, 6) most probable; None where what is given
    does as well.

    Parameters: `about` (10,) the state that residuals are linear about; `total` the sd of a
    residual, in the unit of the readings.
    """
    step = float(np.median(np.diff(rows[:, 0])))
    gain = float(np.mean(about[4:7]))
    rows = rows[-2048:]
    plain = model._replace(jump_level=0.0, gate=np.inf)
    least = _compute_likelihood(prior, plain, rows, about) + _CERTAIN
    best: kalman.Model | None = None
    times = [t * step for t in _TIMES if t * _FEWEST_MEMORIES < len(rows)]
    grid = [(time, share) for time in times for share in _SHARES]
    for time, share in grid:
        tried = plain._replace(
            noise=total * float(np.sqrt(1 - share)),
            external_sd=total * gain * float(np.sqrt(share)),
            external_time_s=time,
        )
        value = _compute_likelihood(widen_external(prior, tried), tried, rows, about)
        if value > least:
            least, best = value, tried
    return best


def widen_external(prior: kalman.FilterState, model: kalman.Model) -> kalman.FilterState:
    """The prior with what the lasting error may be at its start."""
    diagonal = prior.diagonal.copy()
    diagonal[0] = max(diagonal[0], model.external_sd**2)
    return prior._replace(diagonal=diagonal)


def _compute_likelihood(
    prior: kalman.FilterState, model: kalman.Model, rows: Array, about: Array
) -> float:
    """The log-likelihood of rows by the innovations of the filter."""
    _, seen, _ = kalman.advance(prior, model, rows, linearised=about)
    used = seen.used
    return -float((np.log(seen.sd[used]) + 0.5 * (seen.residual[used] / seen.sd[used]) ** 2).sum())
