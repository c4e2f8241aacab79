"""The stretches of a log between the moments, or the rows, at which its bias changed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.fit import Fit
from agonic.health import Finding
from agonic.maths.equation.coverage import find_rms_sd, heading_jacobian_deg
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.one_pass import find_length, median

Stretch = tuple[float, float]
"""First and last moment, or row where there are no times."""
CHANGED = "field changed"
MOST = 0.6
"""Of the log: what came and went was there for the rest of the time at most."""
MARGIN = 0.02
"""Of a stretch: so near to a change its readings may be of either side."""


def find_change(findings: Iterable[Finding]) -> Finding | None:
    """What findings say of a bias that changed, with its moments where one has them."""
    told = (finding for finding in findings if finding.name == CHANGED)
    return max(told, key=lambda finding: len(finding.moments), default=None)


def list_stretches(changed: Finding, clock: Array) -> list[Stretch]:
    """The intervals without a change, by the clock of the log, the longest first.

    >>> import numpy as np
    >>> moved = Finding("field changed", "refuse", "the bias moved", moments=(2.0, 9.0))
    >>> list_stretches(moved, np.arange(21.0))
    [(9.0, 20.0), (2.0, 9.0), (0.0, 2.0)]
    """
    return sorted(_cut(changed, clock), key=lambda pair: pair[0] - pair[1])


def list_parts(changed: Finding, clock: Array) -> list[tuple[Stretch, ...]]:
    """What may be calibrated together, the longest first: most of the log without what came and
    went again, and each stretch alone; what ends with the log, as things are now, counts twice.

    >>> import numpy as np
    >>> moved = Finding("field changed", "refuse", "the bias moved", moments=(2.0, 9.0))
    >>> list_parts(moved, np.arange(21.0))[0]
    ((0.0, 2.0), (9.0, 20.0))
    """
    found = _cut(changed, clock)
    joined = [tuple(every) for every in (found[::2], found[1::2]) if len(every) > 1]
    parts = [part for part in joined if _measure(part) > MOST * _measure(found)]
    parts += [(one,) for one in found]
    return sorted(parts, key=lambda p: _measure(p) * (1 + (p[-1][1] >= clock[-1])), reverse=True)


def _cut(changed: Finding, clock: Array) -> list[Stretch]:
    """The intervals between the changes; none where there is no change between first and last."""
    begin, end = float(clock[0]), float(clock[-1])
    edges = [begin, *(moment for moment in sorted(changed.moments) if begin < moment < end), end]
    return list(pairwise(edges)) if len(edges) > 2 else []


def _measure(part: Sequence[Stretch]) -> float:
    return sum(last - first for first, last in part)


def find_rows(clock: Array, first: float, last: float) -> Mask:
    """The rows of a stretch, but for those next to a change."""
    margin = MARGIN * (last - first)
    begin = first + margin * (first > clock[0])
    end = last - margin * (last < clock[-1])
    return np.asarray((clock >= begin) & (clock <= end))


def find_all_rows(clock: Array, part: Sequence[Stretch]) -> Mask:
    """The rows of all stretches of a part."""
    rows = [find_rows(clock, first, last) for first, last in part]
    return np.asarray(np.any(rows, axis=0))


def state_heading_deg(part: Affine, field: Array, whole: Fit) -> float:
    """The standard error of a heading by the fit to a part of a log, from that of the whole, with
    the scatter of its own field (n, 3), where the whole's holds the change."""
    size, coverage = find_length(field), whole.coverage
    assert part.magnitude is not None
    assert part.covariance is not None
    by_heading = heading_jacobian_deg(
        coverage.inclination_deg, part.magnitude, part.matrix, part.gauge, coverage.down
    )
    m = by_heading.shape[-1]  # sources on board come after
    stated = find_rms_sd(by_heading, part.covariance[:m, :m])
    own = robust_scale(size - median(size)) * 3 / float(np.trace(part.matrix))
    return float(stated) * own / whole.noise


def describe_part(changed: Finding, part: Sequence[Stretch], *, timed: bool) -> Finding:
    """What is said of a calibration that is of one part; `timed` where its clock tells seconds."""
    if timed:
        named = " and ".join(f"from t = {first:.1f} s to {last:.1f} s" for first, last in part)
        move = "; for another stretch give its times (--between START,STOP)"
    else:
        named = " and ".join(f"from row {first:.0f} to {last:.0f}" for first, last in part)
        move = ""
    kind = "stretches" if len(part) > 1 else "stretch"
    return replace(
        changed,
        severity="check",
        what=f"{changed.what}; this calibration and its standard error hold only for the {kind} "
        f"{named}; at other times the bias differs by the same amount",
        move=f"use it only for that configuration of the vehicle{move}",
    )
