"""Readings that the loss left out: how many, and whether they come together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.health.evidence import OUTLIERS_DOUBTFUL, Evidence
from agonic.health.finding import Finding, figure
from agonic.health.gathered import find_gathered
from agonic.health.moments import describe_stretches
from agonic.maths.estimation.changes.hidden_states import find_path
from agonic.maths.one_pass import median

STRETCH_S = 1.0
STRETCH_SHARE = 0.01
"""A stretch of outliers that lasts as long, or holds that share of the rows, is worth a look."""
_WITHIN = 0.7  # of the readings of a disturbed stretch are outliers
_SHARES = (0.01, 0.3)  # of outliers in the rest, at least and at most
_PRICE = 15.0  # in log-likelihood, to begin a stretch or end it


def find_outliers(e: Evidence) -> Finding | None:
    """Readings that the loss left out, with the times at which they come together."""
    outlier = e.weights == 0.0
    scattered = check_outliers(int(outlier.sum()), len(outlier))
    if scattered is None or outlier.all():
        return scattered
    stretches = find_stretches(outlier)
    long = np.array([s for s in stretches if _is_long(s, e.time, len(outlier))])
    if not len(long):
        return _name_gathered(e, scattered)
    apart = np.zeros(len(outlier), dtype=bool)
    for first, last in long:
        apart[first : last + 1] = True
    size = float(np.percentile(np.abs(e.residuals[apart & outlier]), 90))
    what = (
        f"{scattered.what}, most of them {describe_stretches(long, e.time)}, where the magnitude "
        f"is off by up to {figure(size)} {e.unit}: something magnetic passed, or a current flowed, "
        "and a heading at those times is wrong"
    )
    return replace(scattered, what=what)


def _name_gathered(e: Evidence, scattered: Finding) -> Finding:
    """Outliers that gather where an axis reads something, or the sensor looks one way, are none."""
    gathered = find_gathered(e)
    if gathered is None:
        return scattered
    size = median(np.abs(e.residuals[gathered.rows]))
    count = int(gathered.rows.sum())
    return Finding(
        "outliers",
        "check",
        f"{scattered.what}; {count} of them gather {gathered.where}, where the magnitude is off by "
        f"{figure(size)} {e.unit}: the sensor errs there, or something magnetic is near in that "
        "attitude",
        "a heading from such readings is wrong, whatever the calibration; turn the sensor away "
        "from steel, and look whether it errs there again",
    )


def find_stretches(outlier: Mask) -> Index:
    """The first and last rows (k, 2) of stretches in which outliers (n,) come together.

    The likeliest path between two shares of outliers, one for the stretches and one for the rest
    (Viterbi 1967).

    >>> find_stretches(np.repeat([False, True, False], [50, 20, 50])).tolist()
    [[50, 69]]
    """
    n = len(outlier)
    start = np.flatnonzero(np.r_[True, outlier[1:] != outlier[:-1]])  # of runs that are alike
    out, length = outlier[start], np.diff(np.r_[start, n])
    inside, rest = np.zeros(len(start), dtype=bool), float(outlier.mean()) / 2
    for _ in range(3):
        share = np.array([np.clip(rest, *_SHARES), _WITHIN])[:, None]
        cost = -np.log(np.where(out, share, 1 - share))
        inside = find_path(cost * length, _PRICE) == 1
        if inside.all():
            break
        rest = float(np.average(out[~inside], weights=length[~inside]))
    edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(np.int8)))
    return np.append(start, n)[edges].reshape(-1, 2) - [0, 1]


def _is_long(stretch: Index, time: Array | None, n: int) -> bool:
    first, last = stretch
    if last - first + 1 >= STRETCH_SHARE * n:
        return True
    return time is not None and bool(time[last] - time[first] >= STRETCH_S)


def check_outliers(count: int, total: int) -> Finding | None:
    """Readings that the loss left out, so many of all.

    >>> check_outliers(3, 1000).sentence
    '3 readings (0.3 %) do not fit and were left out'
    """
    if not count:
        return None
    share = count / total
    doubtful = share > OUTLIERS_DOUBTFUL
    return Finding(
        "outliers",
        "check" if doubtful else "note",
        f"{count} readings ({figure(100 * share)} %) do not fit and were left out",
        "look for disturbances at those times" if doubtful else "",
    )
