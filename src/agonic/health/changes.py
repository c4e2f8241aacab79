"""Two sensors in one log, or a bias that was another for a while: whether, when and by how much."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.health.evidence import (
    MOST_ROWS,
    OUTLIERS_DOUBTFUL,
    SHIFT_DOUBTFUL,
    SHIFT_OVER_NOISE,
    SHIFT_REFUSED,
    Evidence,
)
from agonic.health.finding import Finding, figure
from agonic.health.moments import describe_moments
from agonic.health.outliers import find_stretches
from agonic.maths.equation.bias_states import find_bias_states
from agonic.maths.equation.crowding import choose_evenly, choose_spread_rows
from agonic.maths.estimation.changes.bias_change import (
    find_bias_change,
    find_seen_shift,
    refit_residuals,
)
from agonic.maths.estimation.robust.least_median import Pair, fit_two_spheres
from agonic.maths.one_pass import median

SIGNIFICANT = 30.0
"""Fall of χ² by a bias of its own, sought over all stretches, that chance does not reach."""
MOST_STRETCHES = 3
"""Biases beside that of most rows that are told apart."""


CROWDED = 0.6
"""Outliers of which that share comes in stretches are no accidents."""


HOLDS = 0.03
"""Noise over the field below which a fit holds for most of the readings."""
AT_END = 0.01
"""Of the log: a stretch that ends so near to the end of the log ends with it."""
GAP = 0.05
"""Of the log: a shorter gap within a longer stretch of another bias is none."""


class Changed(NamedTuple):
    """The finding, and the noise that it leaves of the readings."""

    finding: Finding
    noise: float


class _Change(NamedTuple):
    """The rows between which the bias was another, how far off it was, what of that no other
    ellipsoid for all rows takes up, and the noise without."""

    edges: Index
    shift: float
    seen: float
    noise: float

    @property
    def stands_out(self) -> bool:
        """Whether readings, not the fit alone, show so large a shift."""
        return self.seen >= SHIFT_OVER_NOISE * self.noise


def find_change(e: Evidence, *, attitude_aided: bool = False) -> Changed | None:
    """The finding that two sensors are mixed, or that the bias was another from one row to another.

    Whether there was a change is asked in three ways; where it was, and how large, then is one
    question for all. An attitude-aided fit is not asked for two sensors.
    """
    rows = choose_evenly(len(e.readings), MOST_ROWS)
    pair = None if attitude_aided else _pair(e, rows)
    if pair is not None and (mixed := _check_mixed(pair)) is not None:
        return Changed(mixed, 0.0)
    rough = _second_population(e, rows, pair) or _stretch_of_its_own(e) or _find_crowded_outliers(e)
    if rough is None:
        return None
    placed = _place(e, rough)
    return Changed(_describe(e, placed), placed.noise)


def _describe(e: Evidence, change: _Change) -> Finding:
    """The finding that the bias was another between two rows, or from one row on."""
    n = len(e.readings)
    size = change.shift if change.stands_out else min(change.seen, change.shift)
    share = float(np.diff(change.edges)[::2].sum()) / n
    inner = change.edges[(change.edges > AT_END * n) & (change.edges < (1 - AT_END) * n)]
    return Finding(
        "field changed",
        "refuse" if change.stands_out and size >= SHIFT_REFUSED * e.radius else "check",
        f"the bias moved by about {figure(size)} {e.unit} "
        f"({100 * size / e.radius:.0f} % of the field) "
        f"{describe_moments(inner, e.time)}: something magnetic, or a current, was added or "
        "removed",
        "calibrate the stretches before and after separately, with everything in its final place",
        tuple((inner if e.time is None else e.time[inner]).astype(float).tolist()),
        bias_sd=size * float(np.sqrt(share * (1 - share) / 3)),
    )


def _place(e: Evidence, rough: _Change) -> _Change:
    """The rows at which the bias changed, by what each reading fits better.

    Where the bias of most rows is known, those rows are searched once more: a second stretch with
    yet another bias stands out then.
    """
    rows = choose_evenly(len(e.readings), MOST_ROWS)
    holds = e.noise < HOLDS * e.radius
    if holds:
        points = (e.readings[rows] - e.bias) @ e.shape.T / e.radius
    else:
        points = e.readings[rows] / e.radius
    changed = np.zeros(len(rows), dtype=bool)
    guess = (rows >= rough.edges[0]) & (rows < rough.edges[1])
    shift, noise = 0.0, rough.noise
    for _ in range(MOST_STRETCHES):
        rest = np.flatnonzero(~changed)
        states = find_bias_states(points[rest], guess[rest])
        if states is None:
            break
        changed[rest[states.changed]] = True
        shift = max(shift, states.shift * e.radius)
        noise = states.noise * e.radius
        rest = rest[~states.changed]
        more = _find_stretch(*states.most.measure(points[rest]))
        if more is None:
            break
        guess = np.zeros(len(rows), dtype=bool)
        guess[rest[more.edges[0] : more.edges[1]]] = True
    if not shift or changed.all():
        return rough
    seen = find_seen_shift(*_on_the_surface(e, rows), changed) if holds else shift
    edges = np.flatnonzero(np.diff(changed.astype(np.int8), prepend=0, append=0))
    edges = _bridge(edges, len(changed))
    return _Change(np.append(rows, len(e.readings))[edges], shift, seen, noise)


def _bridge(edges: Index, n: int) -> Index:
    """Edges without short gaps within a stretch.

    Where the field points across a shift, readings fit either bias for a while.
    """
    while len(edges) >= 4:
        lengths = np.diff(edges)
        gaps, beside = lengths[1::2], np.maximum(lengths[:-1:2], lengths[2::2])
        short = np.flatnonzero((gaps < GAP * n) & (2 * gaps < beside))
        if not len(short):
            break
        k = 2 * short[np.argmin(gaps[short])] + 1
        edges = np.delete(edges, [k, k + 1])
    return edges


def _stretch_of_its_own(e: Evidence) -> _Change | None:
    """A bias that was another for a while, by more than the noise can hide."""
    rows = choose_spread_rows(e.crowding, most=MOST_ROWS)
    residuals, normals, places = _on_the_surface(e, rows)
    found = _find_stretch(residuals / e.radius, normals, places)
    if found is None:
        return None
    return _Change(
        np.append(rows, len(e.readings))[found.edges],
        found.shift * e.radius,
        found.seen * e.radius,
        found.noise * e.radius,
    )


def _find_stretch(residuals: Array, normals: Array, places: Array) -> _Change | None:
    """A stretch of rows with a bias of its own; lengths over the radius."""
    found = find_bias_change(residuals, normals, places)
    if found is None or found.significance < SIGNIFICANT:
        return None
    if found.shift < max(SHIFT_DOUBTFUL, SHIFT_OVER_NOISE * found.noise):
        return None
    return _Change(np.array([found.start, found.stop]), found.shift, found.seen, found.noise)


def _on_the_surface(e: Evidence, rows: Index) -> tuple[Array, Array, Array]:
    """Residuals, normals, and the foot points relative to the centre, over the radius."""
    residuals, normals = e.residuals[rows], e.normals[rows]
    feet = e.readings[rows] - residuals[:, None] * normals
    return residuals, normals, (feet - e.bias) / e.radius


def _find_crowded_outliers(e: Evidence) -> _Change | None:
    """Outliers that come in stretches: the fit holds for the rest of the log only."""
    outlier = e.weights == 0.0
    if not OUTLIERS_DOUBTFUL < outlier.mean() < 1.0:
        return None
    stretches = find_stretches(outlier)
    if sum(outlier[a : b + 1].sum() for a, b in stretches) < CROWDED * outlier.sum():
        return None
    longest = stretches[np.argmax(np.diff(stretches, axis=1))] + [0, 1]
    size = np.sqrt(3) * median(np.abs(e.residuals[outlier]))
    return _Change(longest, size, size, e.noise)


def _check_mixed(pair: Pair) -> Finding | None:
    """Two sensors in one log: the readings lie on two spheres, row by row."""
    second = pair.side[pair.side != 0] > 0
    share = float(second.mean())
    if (second[1:] != second[:-1]).mean() <= share * (1 - share):  # half of what chance would give
        return None
    return Finding(
        "two sensors mixed",
        "refuse",
        f"{100 * min(share, 1 - share):.0f} % of the readings lie on a second sphere, row by "
        "row among the others: two sensors are mixed in one log",
        "separate them (a sensor column, --sensor) and calibrate each by itself",
    )


def _second_population(e: Evidence, rows: Index, pair: Pair | None) -> _Change | None:
    """A field that changed: the readings lie on two spheres, each for a while."""
    if pair is None:
        return None
    edges, crowding = _stretch(pair.side[pair.side != 0] > 0)
    if crowding < 0.3:
        return None
    shift = pair.shift * e.radius
    return _Change(rows[pair.side != 0][edges], shift, shift, e.noise)


def _pair(e: Evidence, rows: Index) -> Pair | None:
    """Two spheres of radius about one through readings that one ellipsoid does not hold, or None.

    Sought among calibrated readings where the fit holds for most of them, otherwise among raw
    ones; accepted where the pair leaves much less than one full ellipsoid (noise alone makes the
    nearer of any two spheres 0.7 times as far as one, or more).
    """
    holds = e.noise < HOLDS * e.radius
    if holds and (e.weights == 0.0).mean() < 0.12:
        return None
    readings = (e.readings[rows] - e.bias) / e.radius
    pair = fit_two_spheres(readings @ e.shape.T if holds else readings)
    if pair is None:
        return None
    left = np.abs(refit_residuals(*_on_the_surface(e, rows))) / e.radius
    better = np.minimum(pair.distance, 0.2).mean() < 0.65 * np.minimum(left, 0.2).mean()
    return pair if better else None


def _stretch(member: Mask) -> tuple[Index, float]:
    """The two rows between which members crowd, and how much: 1 all in one stretch, 0 evenly.

    A crowd bends the running count of members less their share; evenly mixed ones do not.
    """
    share = float(member.mean())
    count = np.cumsum(member - share)
    crowding = float(np.ptp(count)) / (len(member) * max(share * (1 - share), 1e-12))
    return np.sort([np.argmin(count), np.argmax(count)]), crowding
