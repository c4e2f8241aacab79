"""The stretches of a log between the moments at which its bias changed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health import Finding

CHANGED = "field changed"
MARGIN = 0.02
"""Of a stretch: so near to a change its readings may be of either side."""


def find_change(findings: Iterable[Finding]) -> Finding | None:
    """What findings say of a bias that changed."""
    return next((finding for finding in findings if finding.name == CHANGED), None)


def list_stretches(changed: Finding, time: Array) -> list[tuple[float, float]]:
    """The intervals without a change, by the clock of the log, the longest first.

    >>> import numpy as np
    >>> moved = Finding("field changed", "refuse", "the bias moved", moments=(2.0, 9.0))
    >>> list_stretches(moved, np.arange(21.0))
    [(9.0, 20.0), (2.0, 9.0), (0.0, 2.0)]
    """
    begin, end = float(time[0]), float(time[-1])
    edges = [begin, *(moment for moment in sorted(changed.moments) if begin < moment < end), end]
    found = list(pairwise(edges)) if len(edges) > 2 else []
    return sorted(found, key=lambda pair: pair[0] - pair[1])


def find_rows(time: Array, first: float, last: float) -> Mask:
    """The rows of a stretch, but for those next to a change."""
    margin = MARGIN * (last - first)
    begin = first + margin * (first > time[0])
    end = last - margin * (last < time[-1])
    return np.asarray((time >= begin) & (time <= end))


def describe_stretch(changed: Finding, first: float, last: float) -> Finding:
    """What is said of a calibration that is of one stretch."""
    return replace(
        changed,
        severity="check",
        what=f"{changed.what}; this calibration is of the stretch from t = {first:.1f} s to "
        f"{last:.1f} s alone, and so is its standard error: at other times the bias is another by "
        "as much",
        move="use it only for how things were then; for another stretch give its times (--between "
        "START,STOP)",
    )
