"""Change points and outliers in series of a few values: steps to another level, single values off.

Each place where a step or an outlier could be joins the design of `drift_model` alone, and the one
that chance would make least often is kept, its tail times the number of places and of series
looked at (Bonferroni); then the rest is looked through again with it in the design. A line, a walk
and scatter of unknown size are allowed for all along, so that a slope is no step.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.history.maths.drift_model import (
    Posterior,
    Series,
    compute_posterior,
    compute_tail_probabilities,
)
from agonic.maths.one_pass import median

MIN_VALUES = 8
"""With fewer values a change cannot be told from scatter of unknown size."""
MIN_LAST = 5
"""From so many values on the last one is compared with those before it."""
_WINDOW = 96  # values looked through at a time; windows overlap by half
_SHARES = (0.9, 0.05, 0.05)  # of the chance, for change points that none, one or two others hide


class ChangePoint(NamedTuple):
    """From value number `place` on the level is another; or, `outlier`, that value alone is off.
    `p_value` is how often chance makes one like it anywhere; `where` which series it was seen
    in."""

    place: int
    outlier: bool
    p_value: float
    where: tuple[int, ...]

    def column(self, n: int) -> Array:
        """What it adds to each of n values."""
        rows = np.arange(n)
        return np.asarray(rows == self.place if self.outlier else rows >= self.place, dtype=float)


def find_change_points(many: Sequence[Series], chance: float) -> list[ChangePoint]:
    """The change points in series of the same times, in the order in which they were found."""
    found: list[ChangePoint] = []
    while len(found) < 20:
        new = _next(many, found, chance)
        if new is None:
            break
        found.append(new)
    return found


def _next(
    many: Sequence[Series], found: Sequence[ChangePoint], chance: float
) -> ChangePoint | None:
    """The next change point that chance would hardly make. Two change points can hide each other.
    Where none stands out though something jumps, the most suspect one joins the design for the time
    being and the others are looked at again, with the places of both counted."""
    n = len(many[0].time) if many else 0
    # a step before every value but the first and the last, an outlier at each but the ends
    every = [ChangePoint(k, stray, 1.0, ()) for stray in (False, True) for k in range(1, n - 1)]
    last, allowed_for, ways = ChangePoint(n - 1, True, 1.0, ()), [*found], len(many)
    for share in _SHARES:
        if n - len(allowed_for) < MIN_LAST or (share != _SHARES[0] and not any(map(_jumps, many))):
            break
        known = [join_design(series, allowed_for, k) for k, series in enumerate(many)]
        allowed = 0.5 * share * chance
        if last.place not in [change.place for change in allowed_for]:
            new = _test(known, last, ways, allowed)
            if new:
                return new
        if n - len(allowed_for) < MIN_VALUES:
            break
        candidates = [s for s in every if not _is_taken(s, allowed_for)]
        suspect = _find_suspect(known, candidates)
        if suspect is None:
            break
        ways *= len(candidates)
        new = _test(known, suspect, ways, allowed)
        if new:
            return new
        allowed_for.append(suspect._replace(where=tuple(range(len(many)))))
    return None


def _jumps(series: Series) -> bool:
    """Whether some value lies much further from the one before than values commonly do."""
    steps = np.diff(series.value)
    away = np.abs(steps - median(steps))
    # a step or outlier that is hidden by another is larger
    return bool(away.max() > 8.0 * median(away))


def join_design(series: Series, found: Sequence[ChangePoint], k: int) -> Series:
    """A series, the k-th, with the change points seen in it in its design; outliers in all."""
    n = len(series.time)
    columns = [s.column(n) for s in found if s.outlier or k in s.where]
    return series._replace(design=np.concatenate([series.design, np.reshape(columns, (-1, n))]))


def estimate_size(series: Series, change: ChangePoint) -> Posterior:
    """The posterior of a series when a change point joins its design, last."""
    column = change.column(len(series.time))
    return compute_posterior(series._replace(design=np.concatenate([series.design, column[None]])))


def _is_taken(change: ChangePoint, found: Sequence[ChangePoint]) -> bool:
    """Whether it is found already, or is the same: next to an outlier a step is none."""
    return any(
        (change.place, change.outlier) == (s.place, s.outlier)
        or (s.outlier and change.place == s.place)
        for s in found
    )


def _find_suspect(known: Sequence[Series], candidates: Sequence[ChangePoint]) -> ChangePoint | None:
    """The candidate with the least tail in any series, on a coarse grid of the sizes."""
    n = len(known[0].time)
    best: tuple[float, ChangePoint | None] = (np.inf, None)
    for rows in _windows(n):
        inside = [s for s in candidates if rows.start < s.place < rows.stop - 1]
        if not inside:
            continue
        columns = np.stack([s.column(n)[rows] for s in inside])
        for _, part in _stack([_part(series, rows) for series in known]):
            tails = compute_tail_probabilities(part, columns).min(axis=0)
            k = int(np.argmin(tails))
            if tails[k] < best[0]:
                best = (float(tails[k]), inside[k])
    return best[1]


def _test(
    known: Sequence[Series], change: ChangePoint, looks: int, chance: float
) -> ChangePoint | None:
    """The change with its tail and the series it shows in; None where chance would do."""
    tails = _tails(known, change)
    p_value = float(tails.min()) * looks
    if not p_value < chance:
        return None
    where = tuple(np.flatnonzero(tails * len(known) < chance).tolist())
    return change._replace(p_value=p_value, where=where)


def _tails(known: Sequence[Series], change: ChangePoint) -> Array:
    """How often chance makes a change as large in each series, with the values around it."""
    rows = [r for r in _windows(len(known[0].time)) if r.start + _WINDOW // 4 <= change.place]
    window = rows[-1] if rows else next(_windows(len(known[0].time)))
    column = change.column(len(known[0].time))[window]
    tails = np.ones(len(known))
    for which, part in _stack([_part(series, window) for series in known]):
        wide = np.broadcast_to(column, (*part.value.shape[:-1], 1, len(column)))
        joint = part._replace(design=np.concatenate([part.design, wide], axis=-2))
        size = joint.design.shape[-2]
        if np.linalg.matrix_rank(joint.design[0]) == size:
            tails[which] = compute_posterior(joint).p_value(size - 1)
    return tails


def _windows(n: int) -> Iterator[slice]:
    """Stretches of values that are looked at together."""
    for start in range(0, max(n - _WINDOW // 2, 1), _WINDOW // 2):
        yield slice(start, min(start + _WINDOW, n))


def _part(series: Series, rows: slice) -> Series:
    """A stretch of a series, with the columns of its design that change there."""
    design = series.design[:, rows]
    moving = np.ptp(design, axis=1) > 0
    moving[0] = True
    time, value, variance = (values[rows] for values in series[:3])
    return Series(time - time[0], value, variance, design[moving])


def _stack(parts: Sequence[Series]) -> Iterator[tuple[Index, Series]]:
    """Series with as many columns each, put together, and which they are."""
    width = np.array([len(part.design) for part in parts])
    for columns in np.unique(width):
        which = np.flatnonzero(width == columns)
        chosen = [parts[k] for k in which.tolist()]
        yield which, Series(*(np.stack(values) for values in zip(*chosen, strict=True)))
