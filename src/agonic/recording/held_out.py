"""Fits to parts of a log, to judge the rows that they have not seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.affine import FREE_PARAMETERS, Affine
from agonic.calibration.base import Calibration, correct_field
from agonic.errors import AgonicError
from agonic.health import Finding, figure
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
CHANCE = 2.0
"""Parts may differ by so many times what their fits state."""
_SOME = 500  # rows, drawn, that stand for all


@dataclass(frozen=True, eq=False)
class Folds:
    """The field of each row by the fit that had not seen the row, and by the one that had.

    `magnitude_sd` is the standard error of the unseen field's magnitude, `turn_deg` that of the
    angle between the two, as the fits state them; `single` where there was a fit without each
    single block, and `seen` is by the calibration itself. Then `parts` are those fits, and `whole`
    the same of all rows.
    """

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
    rows say each, so that a sensor that lay still for most of the log is not held out at rest only.
    """
    block, weights = cut_blocks(samples)
    try:
        fit_part = open_parts(samples, reference)
    except AgonicError:
        return None
    halves = partial(predict, samples, fit_part, block % 2, weights)
    if refused:
        return halves()
    field = correct_field(calibration, samples)
    several = all(sees_enough(field[block % 2 == k]) for k in (0, 1))
    half = halves(AGREEMENT_LIMIT_DEG / 2) if several else None
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

    >>> sees_enough(np.eye(3))
    False
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
    """Some rows, drawn by their weights (n,), the same ones each time."""
    told = np.cumsum(weights)
    drawn = np.random.default_rng(0).random(_SOME) * told[-1]
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
        limit = max(limit, CHANCE * folds.turn_deg)
        meaning = (
            "calibrations from alternate parts of the log point differently: the field changed, or "
            "too few directions were visited"
        )
    good = apart <= limit
    if good:
        meaning = "calibrations from alternate parts of the log point the same way"
    return Check(name=HALVES, value=apart, limit=limit, unit="°", passed=good, meaning=meaning)


def find_refusals(checks: Sequence[Check]) -> tuple[Finding | None, ...]:
    """Why unseen readings forbid to use a fit, where they do."""
    return check_unseen_dip(checks), check_halves(checks)


def check_unseen_dip(checks: Sequence[Check]) -> Finding | None:
    """The refusal of a fit by attitude whose unseen readings dip as no other of its readings."""
    off = max((check.value for check in checks if check.name == DIP), default=0.0)
    if not off > DIP_REFUSED_DEG:
        return None
    return Finding(
        "attitude",
        "refuse",
        f"the dip of held-out readings is off by {figure(off)}°: roll and pitch are not those "
        "of this sensor's vehicle, or the field was disturbed",
        "check where roll and pitch come from and their delay, or calibrate by the magnitude alone "
        "(--method ellipsoid)",
    )


def check_halves(checks: Sequence[Check]) -> Finding | None:
    """The refusal of a fit that parts of its own log contradict."""
    (halves,) = (check for check in checks if check.name == HALVES)
    if halves.passed or not halves.value > HALVES_REFUSED_DEG:
        return None
    return Finding(
        "halves contradict",
        "refuse",
        f"calibrations from alternate parts of the log point {figure(halves.value)}° apart, far "
        "more than their standard errors: the disturbances are too strong for so few orientations",
        "record again in one undisturbed place, turning slowly about all three axes",
    )


def describe_failed(check: Check) -> Finding:
    """A check that failed, with its numbers."""
    unit = f" {check.unit}" if check.unit not in ("", "°") else check.unit
    limit = "" if check.limit is None else f" (limit {check.limit:.3g}{unit})"
    what = f"held-out parts fail a check: {check.name}, {check.value:.3g}{unit}{limit}"
    return Finding(check.name, "check", what, check.meaning)
