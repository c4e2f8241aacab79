"""Numbers that were decoded wrongly, found by what puts them back on one path and one ellipsoid.

A sensor that turns reads along a smooth path on an ellipsoid. Under the right inverse of a logger's
fault its readings do; as they were logged they step by powers of two. With b the distance of a
reading from the mean of its neighbours, or from the ellipsoid, and s the usual one,

    cost = Σ ln(1 + min(b/s, 100)²),

minus the log-likelihood of Cauchy's distribution, in which no single row decides. A fault is named
where its inverse costs far less; several are undone one after the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.errors import CoverageError, check_choice
from agonic.health.evidence import MIN_READINGS, MOST_ROWS
from agonic.health.finding import Finding, figure, sort_findings
from agonic.health.miscoding import KINDS, WORDS, Kind
from agonic.health.scale import find_steps
from agonic.maths.equation.crowding import choose_evenly, choose_spread_rows, weigh_places
from agonic.maths.one_pass import find_length, median
from agonic.new_rows import find_changed, find_fresh
from agonic.samples import Samples
from agonic.units import RAW

MOST_TRIED_ROWS = 2000
"""Rows that are enough to tell of all."""
SHAPE_SD = 0.1
"""Of soft iron, as a prior where few orientations leave the shape open."""
MIN_CHANGE = 1e-3
"""Of their range: what changes readings by less changes no heading."""
MIN_LIKELIHOOD_GAIN = 40.0
"""Of log-likelihood: twice what the best of some forty inverses gains by chance."""
MAX_CONTRARY = 5.0
"""The same, by which path or ellipsoid may speak against a fault by chance."""
MAX_SCATTER = 0.1
"""Of the field: where readings scatter by more about one ellipsoid, nothing was put right."""
LOST_DOUBTFUL = 0.01
"""Of the readings: a logger that loses more asks for a look."""
LOST_READING_PRICE = 2.0
"""Of log-likelihood, of a reading that is given up: it has to be worth it."""


class Measured(NamedTuple):
    """Samples as they were measured, which rows (n,) are left of those logged, what was found."""

    samples: Samples
    kept: Mask
    findings: tuple[Finding, ...]


_FOUND: WeakKeyDictionary[Samples, Measured | None] = WeakKeyDictionary()


class Undone(NamedTuple):
    """A fault undone: readings (n, 3), NaN where one is lost, on which axes, in which unit."""

    kind: Kind
    field: Array
    axes: Mask
    unit: float
    gain: float = 0.0


def undo_decoding(samples: Samples) -> Measured:
    """The samples as they were measured, and what had been done to their numbers. Raises
    `CoverageError` where that is known and cannot be undone, or where the readings never change."""
    if samples not in _FOUND:
        _FOUND[samples] = _find_and_undo(samples)
    return _FOUND[samples] or Measured(samples, np.ones(len(samples), dtype=bool), ())


def find_decoding(samples: Samples) -> tuple[Finding, ...]:
    """What was done to the numbers, for a fit that takes them as they are: it is refused."""
    told = undo_decoding(samples).findings
    return tuple(replace(one, severity="refuse") for one in told if one.severity != "note")


def read_as(samples: Samples, word: str) -> Samples:
    """The samples with their numbers read in one of the ways of `WORDS`."""
    check_choice("--as", word, WORDS)
    kind = next(kind for kind in KINDS if kind.word == word)
    units = [unit for unit in _find_units(samples.field) if unit > 0]
    unit = 1.0 if samples.unit == RAW else units[0]
    every = np.ones(3, dtype=bool)
    field = _undo_axes(kind, samples.field, every, unit)
    known = np.asarray(np.isfinite(field).all(axis=1))
    note = f"numbers read as {word}, as if {kind.what}"
    read = samples.with_columns(field=np.where(known[:, None], field, 0.0))
    return read.select(known).with_columns(notes=(*samples.notes, note))


def _find_and_undo(samples: Samples) -> Measured | None:
    """The samples without the faults that were found one after the other; None where none was."""
    runs = np.diff(np.flatnonzero(find_changed(samples.field)), append=len(samples))
    if len(samples) > 1 and runs.max() >= (1 - 2 * LOST_DOUBTFUL) * len(samples):
        few = (
            "" if len(runs) < 2 else f", but in {len(samples) - runs.max()} of {len(samples)} rows"
        )
        raise CoverageError(
            f"the readings never change{few}: the sensor is not there, or its driver does not read "
            "it",
            turns="check its wiring and its driver, or choose another sensor (--sensor)",
        )
    fresh = find_fresh(samples.field)
    rows, field = np.flatnonzero(fresh), samples.field[fresh]
    findings: list[Finding] = []
    while len(findings) < 3 and (found := _find_best(field)) is not None:
        findings.append(_tell(found, field, rows, samples.unit))
        kept = np.isfinite(found.field).all(axis=1)
        rows, field = rows[kept], found.field[kept]
    if not findings:
        return None
    some = field[
        choose_spread_rows(weigh_places(field), most=MOST_TRIED_ROWS)
    ]  # most may be at rest
    ellipsoid = fit_ellipsoid(some)
    off = np.minimum(ellipsoid.measure(some) / ellipsoid.radius, 1.0)
    spread = float(np.sqrt(np.mean(off**2)))
    if spread > MAX_SCATTER:
        still = f"undone, they still scatter by {figure(100 * spread)} % of the field"
        raise CoverageError(
            f"{findings[-1].what}; {still}", turns="correct the logger and record again"
        )
    place = np.full(len(samples), -1)
    place[rows] = np.arange(len(rows))
    place = place[np.flatnonzero(fresh)][np.cumsum(fresh) - 1]  # what only repeats goes with it
    kept = place >= 0
    measured = samples.select(kept).with_columns(field=field[place[kept]])
    return Measured(measured, kept, sort_findings(findings))


def _find_best(field: Array) -> Undone | None:
    """The fault whose inverse is by far the likeliest, by blocks of rows, undone; or None."""
    some = np.arange(len(field)) // MOST_TRIED_ROWS % (1 + len(field) // MOST_ROWS) == 0
    best: Undone | None = None
    for undone in _try_each(field[some]):
        if undone.gain > MIN_LIKELIHOOD_GAIN and (
            best is None or undone.gain > best.gain + MAX_CONTRARY
        ):
            best = undone
    if best is None or some.all():
        return best
    return best._replace(field=_undo_axes(best.kind, field, best.axes, best.unit))


def _try_each(field: Array) -> Iterator[Undone]:
    """Each inverse on all axes, on those that are the smoother by it, and on each alone."""
    if len(field) < 3:
        return
    units = sorted({float(f"{unit:.9g}") for unit in _find_units(field) if unit > 0})
    bends, ellipsoid = _measure_bends(field), fit_ellipsoid(_choose_some(field))
    every = [np.ones(3, dtype=bool), *np.eye(3, dtype=bool)]
    reach = float(np.ptp(field)) or 1.0
    for kind, unit in product(KINDS, units):
        whole = _undo_axes(kind, field, every[0], unit)
        edge = np.isnan(whole) & kind.shifts
        changed = ~(edge | (np.abs(whole - field) < MIN_CHANGE * reach)).all(axis=0)
        if not changed.any():
            continue
        after = _measure_bends(whole)
        gains = np.array([_compare(bends[:, k], after[:, k], unit / 4) for k in range(3)])
        sets = {(axes & changed).tobytes(): axes & changed for axes in [*every, gains > 0]}
        for axes in sets.values():
            path, least = float(gains[axes].sum()), MIN_LIKELIHOOD_GAIN
            if not axes.any() or path < (least if kind.shifts else -MAX_CONTRARY):
                continue
            put = np.where(axes, whole, field)
            if _stands_still(put, field):
                continue
            beside = _compare_ellipsoids(field, put, ellipsoid, unit / 4)
            if beside > -MAX_CONTRARY:
                gain = path + beside * (not kind.shifts) - LOST_READING_PRICE * _count_lost(put)
                yield Undone(kind, put, axes, unit, gain)


def _choose_some(field: Array) -> Array:
    """Readings that are enough to tell the ellipsoid of all, evenly over them."""
    return field[choose_evenly(len(field), MOST_TRIED_ROWS)]


def _compare_ellipsoids(field: Array, put: Array, ellipsoid: Ellipsoid, least: float) -> float:
    """The log-likelihood gained by readings `put` in the place of others, by their own ellipsoid
    and by that of the others, whichever is less: one that is hardly determined is another by
    chance."""
    before, after = _choose_some(field), _choose_some(put)
    own = fit_ellipsoid(after)
    off = own.measure(after)
    return min(_compare(one.measure(before), off, least) for one in (ellipsoid, own))


def _stands_still(field: Array, before: Array) -> bool:
    """Whether an axis that moved before hardly does, between few values: a reading of nothing."""
    there = np.isfinite(field).all(axis=1)
    if not there.any():
        return True
    left, had = (np.ptp(one[there], axis=0) for one in (field, before))
    still = (left <= MIN_CHANGE * had) & (np.ptp(before, axis=0) > 0.0)
    return any(len(np.unique(axis)) < MIN_READINGS for axis in field[there].T[still])


def _count_lost(field: Array) -> int:
    return int(np.isnan(field).any(axis=1).sum())


def _undo_axes(kind: Kind, field: Array, axes: Mask, unit: float) -> Array:
    """The readings with an inverse taken on some axes, where it can be."""
    columns = []
    for k in range(3):
        undone = kind.undo(np.round(field[:, k] / unit)) if axes[k] else None
        columns.append(field[:, k] if undone is None else undone * unit)
    return np.stack(columns, axis=1)


def _find_units(field: Array) -> Iterator[float]:
    """What the readings of an axis may be whole multiples of: their common divisor, steps that are
    not exact, and the last digit where the divisor is bits of it that a sensor leaves empty."""
    for places in range(5):
        scaled = field * 10.0**places
        whole = np.round(scaled)
        most = float(np.abs(scaled).max())
        if np.abs(scaled - whole).max() < 1e-6 + 1e-12 * most and most < 2.0**53:
            for divisor in np.gcd.reduce(whole.astype(np.int64), axis=0).tolist():
                yield divisor / 10.0**places
                if divisor & (divisor - 1) == 0:
                    yield 10.0**-places
            break
    else:
        yield float(np.ptp(field)) / 2.0**40  # of readings with all digits there is none
    yield float(np.max(find_steps(field)))


def _measure_bends(field: Array) -> Array:
    """How far each reading is from the mean of those beside it, (n, 3); NaN where it is lost."""
    rows = np.arange(len(field))
    bends = np.zeros(field.shape)
    for k, axis in enumerate(field.T):
        there = np.isfinite(axis)
        whole = axis if there.all() else np.interp(rows, rows[there], axis[there])
        bends[1:-1, k] = np.abs(whole[1:-1] - (whole[:-2] + whole[2:]) / 2)
        bends[~there, k] = np.nan
    return bends


class Ellipsoid(NamedTuple):
    """Of points p = (reading − centre)/size: pᵀp + pᵀS p − 2 qᵀp + c = 0, the params S, q and c."""

    centre: Array
    size: float
    params: Array

    @property
    def radius(self) -> float:
        """The radius, in the unit of the readings."""
        q, c = self.params[5:8], self.params[8]
        return self.size * float(np.sqrt(max(float(q @ q - c), 0.25)))

    def measure(self, field: Array) -> Array:
        """How far readings (k, 3) are from it, nearly; NaN where one is lost."""
        points = (field - self.centre) / self.size
        left = np.abs(np.hstack(list_columns(points)) @ self.params + np.sum(points**2, axis=1))
        return np.asarray(left / 2 * self.size**2 / self.radius)


def fit_ellipsoid(field: Array) -> Ellipsoid:
    """The ellipsoid that is nearest to most readings (k, 3).

    A prior holds the shape S: without it two planes would fit readings that jump."""
    there = field[np.isfinite(field).all(axis=1)]
    centre = np.median(there, axis=0)
    size = median(find_length(there - centre)) or 1.0
    points = (there - centre) / size
    design, square = np.hstack(list_columns(points)), np.sum(points**2, axis=1)
    prior = np.diag([hold_shape(len(points))] * 5 + [1e-9] * 4)
    weight, params = 1 / (1 + square) ** 2, np.zeros(9)
    for _ in range(15):
        weighted = design * weight[:, None]
        params = np.linalg.solve(weighted.T @ design + prior, -weighted.T @ square)
        far = np.abs(square + design @ params)
        weight = 1 / (1 + (far / max(2 * median(far), 1e-9)) ** 2)
    return Ellipsoid(centre, size, params)


def list_columns(points: Array) -> tuple[Array, Array]:
    """Columns of the shape (n, 5), and of a centre and radius (n, 4)."""
    x, y, z = points.T
    bends = np.stack([x * x - z * z, y * y - z * z, 2 * x * y, 2 * x * z, 2 * y * z], axis=1)
    return bends, np.column_stack([-2 * points, np.ones(len(points))])


def hold_shape(rows: int) -> float:
    """What a prior on the shape adds, for residuals of a hundredth."""
    return rows * (1e-2 / SHAPE_SD) ** 2


def _compare(before: Array, after: Array, least: float) -> float:
    """The log-likelihood that is gained from distances (n,) to others; NaN where one is lost."""
    usual = [median(off[np.isfinite(off)]) for off in (before, after) if np.isfinite(off).any()]
    scale = max(min(usual, default=least), least)
    off = np.stack([before, after]) / scale
    off[np.isnan(off)] = 1.0  # as a usual one
    return float(np.subtract(*np.log1p(np.minimum(off, 100.0) ** 2).sum(axis=1)))


def _tell(found: Undone, field: Array, rows: Index, unit: str) -> Finding:
    """What was done to the readings and what became of it."""
    if found.kind.word:
        put = np.where(np.isfinite(found.field), found.field, field)
        steps, smoother = np.abs(np.diff(field, axis=0)), np.abs(np.diff(put, axis=0))
        at, axis = divmod(int(np.argmax(steps - smoother)), 3)
        jump = f"{abs(np.diff(field - put, axis=0)[at, axis]):,.6g}".replace(",", " ")
        what = (
            f"readings of {'xyz'[axis]} jump by {jump} {unit} between rows {rows[at]} and "
            f"{rows[at + 1]}: {found.kind.what}, which was undone"
        )
        move = f"correct the logger; --as {found.kind.word} reads its logs"
        return Finding("decoding", "check", what, move)
    lost = _count_lost(found.field)
    doubtful, share = lost > LOST_DOUBTFUL * len(field), figure(100 * lost / len(field))
    what = f"{lost} readings ({share} %) are {found.kind.what}, and were left out"
    move = "check the logger and the program that reads it" if doubtful else ""
    return Finding("outliers", "check" if doubtful else "note", what, move)
