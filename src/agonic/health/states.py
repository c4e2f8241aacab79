"""Two biases in one log: which rows have which. Two sensors in turn, or what came and went.

Of points p over their radius and one shape S, with a centre for either state k, the algebraic
distance from its ellipsoid is linear in all unknowns,

    e_k = pᵀp + pᵀS p − 2 q_kᵀp + c_k,   distance ≈ e_k/2.

From a guess of the rows of either, a least-squares fit and the choice of the nearer state are taken
in turn (Lloyd 1982); where states last, a switch between them has a price (Viterbi 1967).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.health.decoding import MOST_TRIED_ROWS, fit_ellipsoid, hold_shape, list_columns
from agonic.health.evidence import (
    FITTING_NOISE,
    MIN_READINGS,
    SHIFT_DOUBTFUL,
    SHIFT_OVER_NOISE,
    SHIFT_REFUSED,
    SWITCH_PRICE,
    Evidence,
)
from agonic.health.finding import Finding, describe_moments, figure
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.estimation.changes.hidden_states import find_path

MAX_DEVIATIONS = 4.0
"""Standard deviations from both ellipsoids that are as likely as belonging to neither."""
STATES_APART = 4.0
"""Standard deviations between states: by chance two are 1.6 apart, the halves of one Gaussian."""
MOST_NEITHER = 0.5
"""Of the rows of the rarer state: where more belong to neither, they are no second state."""
RADII_ALIKE = 0.8
"""Of the radii, the smaller over the larger: one magnitude is behind both."""
MOST_LEFT_LASTING = 0.65
"""Of what one ellipsoid leaves, two leave less: bends leave more, and so do halves of noise."""
MOST_LEFT_BY_ROWS = 0.5
"""The same of states row by row, which the halves of one Gaussian pretend to be."""
MOST_LEFT_BY_GUESS = 0.9
"""Of the same, what a guess leaves that is worth a try."""
MOST_OFF = 0.2
"""Of the radius: how far off a row is counts no more beyond."""
MIN_STRETCH = 0.03
"""Of the log: a stretch is longer. Less is a magnet that was passed, which outliers tell."""
EXPLAINED_NOISE = 1.5
"""Times the noise that the fitted terms leave: a split into states that leaves more is explained by
the terms."""
MIXED_REFUSED = 0.1
"""Of the field between two sensors, or of what comes and goes: less errs a row as noise may."""
MOST_EDGES = 6
"""What changes more often did not come and go: the field varies, or the model is another."""
MOST_BIASES = 3
"""Searches for a bias beside those found."""
BY_DIRECTION = 25.0
"""Of χ² with five degrees of freedom: by chance one in 7000."""
TELLING_QUANTILE, TELLING_QUANTILE_SD = 0.3, 0.385
"""Of the rows of a state, those that tell its noise: others may be of a third."""
PARTS_TRIED = 7
"""Parts of the log that are tried to be another state, one or some in succession."""
MOST_GUESSES = 6
"""That are followed: those that leave least lead to the same states."""
_LEAST = 1e-9
_NEITHER = 2


class States(NamedTuple):
    """The rows (k,) at which the bias changes, none where states take turns row by row; the share
    of rows of the rarer state; how far the biases are apart over the radius; the noise likewise."""

    edges: Index
    share: float
    shift: float
    noise: float


class _Split(NamedTuple):
    """The state of each row, 0, 1 or neither, distances (2, n) over the radius, the noise, how
    far the biases are apart, and the radii (2,)."""

    state: NDArray[np.int8]
    off: Array
    noise: float
    shift: float
    radii: Array

    @property
    def cost(self) -> float:
        """What is left of each row of the nearer state."""
        return _measure_cost(np.abs(self.off).min(axis=0))

    @property
    def second(self) -> Mask:
        """The rows of the rarer state."""
        counts = np.bincount(self.state, minlength=3)
        return np.asarray(self.state == (1 if counts[1] <= counts[0] else 0))

    @property
    def lasts(self) -> bool:
        """Whether states last over rows."""
        return _last(self.state)

    @property
    def stands_out(self) -> bool:
        """Whether these are two states, and not the halves of one, or one and what is left of it.
        Where they last, each is seen by many rows that follow one another."""
        if not RADII_ALIKE < self.radii[0] / max(self.radii[1], 1e-9) < 1 / RADII_ALIKE:
            return False
        if self.lasts:
            return self.shift > SHIFT_OVER_NOISE * self.noise
        neither = self.state == _NEITHER
        if np.count_nonzero(neither) > MOST_NEITHER * np.count_nonzero(self.second):
            return False
        other = np.where(self.state == 1, self.off[0], self.off[1])[~neither]
        apart = np.sqrt(np.mean(np.minimum(np.abs(other), 1.0) ** 2))
        return bool(apart >= STATES_APART * self.noise)


def _measure_cost(off: Array) -> float:
    """The mean distance, of strange rows no more than `MOST_OFF`."""
    return float(np.minimum(np.abs(off), MOST_OFF).mean())


def check_states(e: Evidence, left: float | None) -> Finding | None:
    """The finding that two sensors are mixed, or that the bias was another for a while. It is told
    where it leaves as little as terms do: `left`, noise and memory over the radius, if there are
    any. Of few readings, 36 with ten outliers, 13 unknowns put half on either ellipsoid."""
    if len(e.readings) < 5 * MIN_READINGS:
        return None
    raw, at = (e.readings - e.bias) / e.radius, (e.residuals / e.radius, e.normals)
    try:
        found = (
            None if e.noise < FITTING_NOISE * e.radius else find_states(raw, *at, e.weights == 0.0)
        )
        if found is None:
            found = find_states(raw @ e.shape.T, *at, e.weights == 0.0)
    except np.linalg.LinAlgError:  # readings of no ellipsoid
        return None
    if found is None:
        return None
    explained = left is not None and found.noise > EXPLAINED_NOISE * left
    if len(found.edges) and (explained or found.shift < SHIFT_DOUBTFUL):
        return None
    if not len(found.edges):
        grave = found.shift >= MIXED_REFUSED
        return Finding(
            "two sensors mixed",
            "refuse" if grave else "check" if found.shift >= SHIFT_DOUBTFUL else "note",
            f"{100 * found.share:.0f} % of the readings lie on a second sphere, row by row among "
            "the others: two sensors are mixed in one log",
            "separate them (a sensor column, --sensor) and calibrate each by itself",
        )
    few = len(found.edges) <= 2
    moments = found.edges if e.time is None else e.time[found.edges]
    return Finding(
        "field changed",
        "refuse" if found.shift >= (SHIFT_REFUSED if few else MIXED_REFUSED) else "check",
        f"the bias moved by about {figure(found.shift * e.radius)} {e.unit} "
        f"({100 * found.shift:.0f} % of the field) {describe_moments(found.edges, e.time)}: "
        "something magnetic, or a current, was added or removed",
        "calibrate the stretches before and after separately, with everything in its final place",
        tuple(moments.astype(float).tolist()),
    )


def find_states(points: Array, residuals: Array, normals: Array, rejected: Mask) -> States | None:
    """Two biases among the rows of a fit; None where there is one. Of what lasts, the rows of the
    commonest state are searched once more, for a third bias. Parameters: points (n, 3) of the
    calibrated field over its magnitude, residuals (n,) and normals (n, 3) of the fit in the same
    unit, and which rows it rejected (n,)."""
    rows = choose_evenly(len(points), MOST_TRIED_ROWS)
    points, rejected = points[rows], rejected[rows]
    residuals, normals = residuals[rows], normals[rows]
    changed, first, rest = np.zeros(len(rows), dtype=bool), None, np.arange(len(rows))
    strange = rejected
    for _ in range(MOST_BIASES):
        guesses = _guess(points[rest], residuals[rest], normals[rest], strange[rest], rows[rest])
        split = _find_split(points[rest], guesses)
        if split is None or (first is not None and not split.lasts):
            break
        first = first or split
        changed[rest[split.second]] = True
        if not split.lasts:
            break
        strange = np.zeros(len(rows), dtype=bool)
        strange[rest[split.state == _NEITHER]] = True
        rest = np.flatnonzero(~changed)
    if first is None:
        return None
    edges = _find_edges(changed) if first.lasts else np.zeros(0, dtype=np.intp)
    if first.lasts and not 0 < len(edges) <= MOST_EDGES:
        return None
    radius = float(first.radii.mean())
    return States(rows[edges], float(changed.mean()), first.shift / radius, first.noise / radius)


def _find_edges(changed: Mask) -> Index:
    """The rows at which stretches begin and end, without those that are short."""
    edges = np.flatnonzero(np.diff(changed)) + 1
    while len(edges) > 1:
        k = int(np.argmin(np.diff(edges)))
        if edges[k + 1] - edges[k] > MIN_STRETCH * len(changed):
            break
        edges = np.delete(edges, [k, k + 1])
    return edges


def spreads_by_direction(residuals: Array, normals: Array) -> bool:
    """Whether squares of residuals go with the direction, as of a bias that is one of two. n R² of
    the regression of r² on the squares of the normals is χ² of five by chance (Breusch and Pagan
    1979)."""
    square = residuals**2
    design = _list_squares(normals)
    left = square - _regress(square, design) @ design
    told = 1.0 - float(np.var(left)) / max(float(np.var(square)), 1e-300)
    return len(square) * told > BY_DIRECTION


def _list_squares(normals: Array) -> Array:
    """Squares and products of the normals' components, and one, (7, n)."""
    a, b, c = normals.T
    return np.stack([a * a, b * b, c * c, a * b, a * c, b * c, np.ones(len(a))])


def _regress(values: Array, design: Array) -> Array:
    """How values (n,) go with the rows of a design (7, n), (7,)."""
    return np.asarray(np.linalg.lstsq(design @ design.T, design @ values, rcond=1e-12)[0])


def _find_split(points: Array, guesses: Iterator[Mask]) -> _Split | None:
    """The best split from any of the guesses, None where none is one."""
    one = _measure_cost(_fit(points, np.zeros(len(points), dtype=np.int8))[0][0])
    weighed = []
    for guess in guesses:
        if MIN_READINGS <= np.count_nonzero(guess) <= len(guess) - MIN_READINGS:
            off, _, _ = _fit(points, guess.astype(np.int8))
            weighed.append((_measure_cost(np.where(guess, off[1], off[0])), guess))
    likely = sorted(
        (pair for pair in weighed if pair[0] < MOST_LEFT_BY_GUESS * one), key=lambda p: p[0]
    )
    tried = [_alternate(points, guess) for _, guess in likely[:MOST_GUESSES]]
    found = (split for split in tried if split is not None)
    best = min(found, key=lambda split: split.cost, default=None)
    if best is None or not best.stands_out:
        return None
    share = MOST_LEFT_LASTING if best.lasts else MOST_LEFT_BY_ROWS
    return best if best.cost < share * one else None


def _guess(
    points: Array, residuals: Array, normals: Array, rejected: Mask, rows: Index
) -> Iterator[Mask]:
    """Guesses of the rows of the second state: those rejected, or left over by a sphere through
    many; every second; some in succession; those whose residual goes
    with the shift δ that makes r² = σ² + (n·δ)²."""
    yield rejected
    left = fit_ellipsoid(points).measure(points)
    weighed = _weigh(left[None] / max(_measure_noise(left), 1e-9))
    yield np.asarray(find_path(weighed, SWITCH_PRICE) == 1)
    yield rows % 2 == 1
    part = np.arange(len(points)) * PARTS_TRIED // len(points)
    yield from ((part >= a) & (part < b) for a, b in combinations(range(PARTS_TRIED + 1), 2))
    xx, yy, zz, xy, xz, yz, _ = _regress(residuals**2, _list_squares(normals))
    square = np.array([[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, zz]])
    shift = np.linalg.eigh(square)[1][:, -1]
    yield residuals * (normals @ shift) > 0.0


def _alternate(points: Array, second: Mask) -> _Split | None:
    """The states after fits and choices in turn, rows one by one first, lasting where they last."""
    state = second.astype(np.int8)
    found, price = None, 0.0
    for _ in range(12):
        if min(np.count_nonzero(state == 0), np.count_nonzero(state == 1)) < MIN_READINGS:
            return None
        off, shift, radii = _fit(points, state)
        own = np.where(state == 1, off[1], off[0])[state != _NEITHER]
        noise = max(_measure_noise(own), 1e-9)
        before, cost = state, _weigh(off / noise)
        state = find_path(cost, price) if price else cost.argmin(axis=0).astype(np.int8)
        price = SWITCH_PRICE if _last(state) else 0.0
        found = _Split(state, off, noise, shift, radii)
        if np.array_equal(before, state):
            break
    return found


def _weigh(off: Array) -> Array:
    """What each state costs a row, neither last (k + 1, n), by distances (k, n) over the noise."""
    far = np.full((1, off.shape[1]), MAX_DEVIATIONS**2 / 2)
    return np.concatenate([np.minimum(off**2 / 2, MAX_DEVIATIONS**2), far])


def _measure_noise(off: Array) -> float:
    """The standard deviation of the nearest rows of a state."""
    return float(np.quantile(np.abs(off), TELLING_QUANTILE)) / TELLING_QUANTILE_SD


def _last(state: NDArray[np.int8]) -> bool:
    """Whether states switch less than half as often as those of rows at random."""
    told = state[state != _NEITHER]
    share = float((told == 1).mean()) if len(told) else 0.0
    return bool((told[1:] != told[:-1]).mean() < share * (1 - share)) if len(told) > 1 else False


def _fit(points: Array, state: NDArray[np.int8]) -> tuple[Array, float, Array]:
    """Distances (2, n) from the ellipsoid of either state, how far their centres are apart, and
    their radii (2,)."""
    bends, centre = list_columns(points)
    square = np.sum(points**2, axis=1)
    first, second = (state == 0)[:, None], (state == 1)[:, None]
    design = np.hstack([bends, centre * first, centre * second])
    told = state != _NEITHER
    params, hold = np.zeros(13), np.full(13, _LEAST)
    hold[:5] = hold_shape(len(points))
    weight = told.astype(float)
    for _ in range(5):
        weighted = design * weight[:, None]
        params = np.linalg.solve(weighted.T @ design + np.diag(hold), -weighted.T @ square)
        left = square + design @ params
        reach = MAX_DEVIATIONS * _measure_noise(left[told]) + 1e-12
        weight = told * np.minimum(1.0, reach / np.maximum(np.abs(left), 1e-12)) ** 3
    shape = params[:5]
    common = square + bends @ shape
    full = np.eye(3) + np.array(
        [
            [shape[0], shape[2], shape[3]],
            [shape[2], shape[1], shape[4]],
            [shape[3], shape[4], -shape[0] - shape[1]],
        ]
    )
    off = np.stack([common + centre @ params[5:9], common + centre @ params[9:13]]) / 2
    q = params[[[5, 9], [6, 10], [7, 11]]]
    centres = np.linalg.solve(full, q)
    square = np.sum(q * centres, axis=0) - params[[8, 12]]
    radii = np.sqrt(np.maximum(square, 0.0))
    return np.asarray(off), float(np.linalg.norm(centres[:, 0] - centres[:, 1])), radii
