"""Parts of a log: fits to some of its blocks, to judge the rows that they have not seen, and the
stretches between the moments, or the rows, at which its bias changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import FREE_PARAMETERS, Affine
from agonic.calibration.base import Calibration, correct_field
from agonic.errors import AgonicError
from agonic.health.finding import Fact, Finding, Limit, find_facts
from agonic.maths.equation.coverage import field_covariance
from agonic.maths.equation.crowding import count_orientations, weigh_places
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.angles import angle_deg
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.verification import DIP, DIP_REFUSED_DEG, Check

FitPart = Callable[[Mask], Calibration]
"""The calibration by some of the rows (n,) of a log."""
OpenParts = Callable[[Samples, Reference | None], FitPart]
"""The same from samples and their reference."""
BLOCKS = 8
AGREEMENT_LIMIT_DEG = 2.0
HALVES = "two halves of the log agree"
HALVES_REFUSED_DEG = 15.0
"""Fits to alternate parts that point so far apart, by more than they state, know no direction."""
MAX_OVER_STATED = 2.0
"""Parts may differ by so many times what their fits state."""


@dataclass(frozen=True, eq=False)
class Folds:
    """The field of each row by the fit that had not seen the row, and by the one that had.
    `magnitude_sd` is the standard error of the unseen field's magnitude, `turn_deg` that of the
    angle between the two, as the fits state them; `single` where there was a fit without each
    single block, and `seen` is by the calibration itself. Then `parts` are those fits, and `whole`
    the same of all rows."""

    unseen: Array
    seen: Array
    magnitude_sd: float
    turn_deg: float
    single: bool = False
    parts: tuple[Calibration, ...] = ()
    whole: Calibration | None = None


def fit_folds(
    samples: Samples,
    reference: Reference | None,
    calibration: Calibration,
    open_parts: OpenParts,
    *,
    refused: bool = False,
) -> Folds | None:
    """Fits without the odd and without the even blocks of time, each applied to its unseen rows.
    Where these state that half of the log leaves directions uncertain, there is a fit without each
    single block instead, unless the calibration is `refused` anyway. Blocks hold as much of what
    rows say each, so that a sensor that lay still for most of the log is not held out at rest
    only."""
    block, weights = cut_blocks(samples)
    try:
        fit_part = open_parts(samples, reference)
    except AgonicError:
        return None
    halves = partial(predict, samples, fit_part, block % 2, weights)
    if refused:
        return halves()
    field = correct_field(calibration, samples)
    if all(sees_enough(field[block % 2 == k]) for k in (0, 1)):
        half = halves(AGREEMENT_LIMIT_DEG / 2)
        if half is not None:
            return half
    single = predict(samples, fit_part, block, weights)
    if single is None:
        return halves()
    whole = fit_part(np.ones(len(samples), dtype=bool))
    return replace(single, seen=field, single=True, whole=whole)


def sees_enough(field: Array) -> bool:
    """Whether readings (n, 3) of the field may be fitted alone: they show as many orientations,
    apart by 3 % of it, as bias and a free matrix have unknowns.
    """
    reach, enough = 0.03 * median(find_length(field)), len(FREE_PARAMETERS)
    return count_orientations(field, reach, enough) == enough


def cut_blocks(samples: Samples) -> tuple[Index, Array]:
    """The block of time of each row (n,), and what each row counts (n,)."""
    weights = weigh_places(samples.field)
    told = np.cumsum(weights)
    return np.minimum((told * (BLOCKS / told[-1])).astype(int), BLOCKS - 1), weights


def predict(
    samples: Samples,
    fit_part: FitPart,
    fold: Index,
    weights: Array,
    most_deg: float = np.inf,
) -> Folds | None:
    """The field of each row by the fit to all other folds, (n,) numbered; None where one fails, and
    as soon as they state that the field may be turned by `most_deg`."""
    unseen, seen = np.empty((2, len(samples), 3))
    along, turned, count = 0.0, 0.0, int(fold.max()) + 1
    parts: list[Calibration] = []
    anywhere = _draw(weights)
    for k in range(count):
        out = fold == k
        try:
            part = fit_part(~out)
            field = correct_field(part, samples)
        except AgonicError:
            return None
        parts.append(part)
        np.copyto(unseen, field, where=out[:, None])
        np.copyto(seen, field, where=~out[:, None])
        for rows, of_turn in ((_draw(weights * out), False), (anywhere, True)):
            variances = _state_errors(part, field[rows])
            along += 0.0 if of_turn else variances[0] / count
            turned += variances[1] * min(2 / count, 1.0) if of_turn else 0.0
        if np.degrees(np.sqrt(turned)) >= most_deg:
            return None
    sd, turn = np.sqrt([along, turned])
    return Folds(unseen, seen, float(sd), float(np.degrees(turn)), parts=tuple(parts))


def _draw(weights: Array) -> Index:
    """500 rows, drawn by their weights (n,), the same ones each time."""
    told = np.cumsum(weights)
    drawn = np.random.default_rng(0).random(500) * told[-1]
    return np.asarray(np.minimum(np.searchsorted(told, drawn, side="right"), len(told) - 1))


def _state_errors(part: Calibration, some: Array) -> tuple[float, float]:
    """Variance of the magnitude of the field (n, 3) by a fit, and of its direction, rad²."""
    if not isinstance(part, Affine) or part.covariance is None or not len(some):
        return 0.0, 0.0
    size = np.maximum(find_length(some), np.finfo(float).tiny)
    spread = field_covariance(
        some / size[:, None], size[:, None], part.bias, part.matrix, part.covariance, part.gauge
    )
    along = np.einsum("ni,nij,nj->n", some, spread, some) / size**2
    across = np.trace(spread, axis1=1, axis2=2) - along
    return max(float(along.mean()), 0.0), max(float(np.mean(across / size**2)), 0.0)


def compare_folds(folds: Folds | None) -> Check:
    """Whether two halves of the log, fitted apart, point the same way."""
    apart, limit = float("nan"), AGREEMENT_LIMIT_DEG
    meaning = "half of the log is not enough for a fit, so nothing could be held out: record longer"
    if folds is not None:
        apart = float(np.sqrt(np.mean(angle_deg(folds.unseen, folds.seen) ** 2)))
        limit = max(limit, MAX_OVER_STATED * folds.turn_deg)
        way = (
            "differently: the field changed, or too few directions were visited; record again in "
            "one undisturbed place, turning slowly about all three axes"
        )
        way = "the same way" if apart <= limit else way
        meaning = f"calibrations from alternate parts of the log point {way}"
    good = apart <= limit
    return Check(name=HALVES, value=apart, limit=limit, unit="°", passed=good, meaning=meaning)


def find_refusals(checks: Sequence[Check]) -> Iterator[Finding]:
    """Findings that refuse a fit by held-out readings: their dip is wrong, or parts of the log
    contradict each other."""
    by_name = {check.name: check for check in checks}
    yield from find_facts([DIP_OFF], by_name)
    failed = (describe_failed(check) for check in checks if check.passed is False)
    yield from (finding for finding in failed if finding.severity == "refuse")


DIP_OFF = Fact(
    "attitude",
    lambda checks: checks[DIP].value if DIP in checks else None,
    Limit(refuse=DIP_REFUSED_DEG),
    "the dip of held-out readings is off by {value}°: roll and pitch are not those of this "
    "sensor's vehicle, or the field was disturbed",
    "check where roll and pitch come from and their delay, or calibrate by the magnitude alone "
    "(--method ellipsoid)",
)


def describe_failed(check: Check) -> Finding:
    """A check that failed, with its numbers; it refuses where halves know no direction."""
    unit = f" {check.unit}" if check.unit not in ("", "°") else check.unit
    limit = "" if check.limit is None else f" (limit {check.limit:.3g}{unit})"
    what = f"held-out parts fail a check: {check.name}, {check.value:.3g}{unit}{limit}"
    grave = check.name == HALVES and check.value > HALVES_REFUSED_DEG
    return Finding(check.name, "refuse" if grave else "check", what, check.meaning)


Stretch = tuple[float, float]
"""First and last moment, or row where there are no times."""
CHANGED = "field changed"
MIN_SHARE_JOINED = 0.6
"""Of the log: what came and went was there for the rest of the time at most."""
CHANGE_MARGIN = 0.02
"""Of a stretch: so near to a change its readings may be of either side."""


def find_change(findings: Iterable[Finding]) -> Finding | None:
    """What findings say of a bias that changed, with its moments where one has them."""
    told = (finding for finding in findings if finding.name == CHANGED)
    return max(told, key=lambda finding: len(finding.moments), default=None)


def list_parts(changed: Finding, clock: Array) -> list[tuple[Stretch, ...]]:
    """What may be calibrated together, the longest first: most of the log without what came and
    went again, and each stretch alone; what ends with the log, as things are now, counts twice.
    """
    found = cut_stretches(changed, clock)
    joined = [tuple(every) for every in (found[::2], found[1::2]) if len(every) > 1]
    parts = [part for part in joined if _measure(part) > MIN_SHARE_JOINED * _measure(found)]
    parts += [(one,) for one in found]
    return sorted(parts, key=lambda p: _measure(p) * (1 + (p[-1][1] >= clock[-1])), reverse=True)


def cut_stretches(changed: Finding, clock: Array) -> list[Stretch]:
    """The intervals between the changes; none where there is no change between first and last."""
    begin, end = float(clock[0]), float(clock[-1])
    edges = [begin, *(moment for moment in sorted(changed.moments) if begin < moment < end), end]
    return list(pairwise(edges)) if len(edges) > 2 else []


def _measure(part: Sequence[Stretch]) -> float:
    return sum(last - first for first, last in part)


def find_rows(clock: Array, part: Iterable[Stretch]) -> Mask:
    """The rows of stretches, but for those next to a change."""
    rows = np.zeros(len(clock), dtype=bool)
    for first, last in part:
        margin = CHANGE_MARGIN * (last - first)
        begin, end = first + margin * (first > clock[0]), last - margin * (last < clock[-1])
        rows |= (clock >= begin) & (clock <= end)
    return rows


def describe_part(changed: Finding, part: Sequence[Stretch], *, timed: bool) -> Finding:
    """What is said of a calibration that is of one part; `timed` where its clock tells seconds."""
    each = "from t = {:.1f} s to {:.1f} s" if timed else "from row {:.0f} to {:.0f}"
    named = " and ".join(each.format(*stretch) for stretch in part)
    move = "; for another stretch give its times (--between START,STOP)" if timed else ""
    kind = "stretches" if len(part) > 1 else "stretch"
    return replace(
        changed,
        severity="check",
        what=f"{changed.what}; this calibration and its standard error hold only for the {kind} "
        f"{named}; at other times the bias differs by the same amount",
        move=f"use it only for that configuration of the vehicle{move}",
    )
