"""Sequential estimation of bias and matrix from magnitudes: a Kalman filter in U D Uᵀ factors.

The state is x = (g, bias x y z, matrix xx yy zz xy xz yz) with a symmetric matrix W; the covariance
is that of its first m numbers, the others are fixed. g is what the reference magnitude leaves out
(crust, ring current), a first-order Gauss–Markov process; bias and matrix walk at random. A reading
measures

    r(x) = (|W (raw − bias)| − F − g)/|s| = noise,    s = W û,

the distance residual of `affine.magnitude_residual` with its exact Jacobian. The covariance
is kept as U D Uᵀ, U unit upper triangular: with D not negative it stays a covariance, whatever
the rounding. Bierman's measurement update, and Agee and Turner's rank-one update for what the
unknowns walk; g is first so that its decay scales one row. They are in `ud_filter`.

Source: G. J. Bierman (1977), Factorization Methods for Discrete Sequential Estimation, Academic
Press, chapters III and V. Jumps: A. S. Willsky, H. L. Jones (1976), IEEE Transactions on Automatic
Control 21(1), 108–112, doi 10.1109/TAC.1976.1101146.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.filters import ud_filter
from agonic.maths.estimation.noise import running_batch_means

STATES = {"bias": 4, "gains": 7, "full": 10}
"""How many numbers of the state are estimated; the external field is one of them."""

COMPILE_FROM = 3000
"""Rows for which numba is worth loading."""


class Model(NamedTuple):
    """The noise model: all in the unit of the readings but for the external field, nT.

    `noise` sd of one reading on one axis; `external_sd` and `external_time_s` of g; `walk` sd of
    the change of each bias, `matrix_walk` of each entry of the matrix, in one second (they grow
    with √t); `gate` standard deviations beyond which a reading is refused; `jump_level` the
    statistic (χ² with three degrees of freedom) above which a jump is announced, 0 for never;
    `jump_sd` the expected size of a jump.
    """

    noise: float
    external_sd: float = 0.0
    external_time_s: float = 600.0
    walk: float = 0.0
    matrix_walk: float = 0.0
    gate: float = 5.0
    jump_level: float = 50.0
    jump_sd: float = 2000.0


class FilterState(NamedTuple):
    """What the filter holds: `state` (10,), U D Uᵀ of its first m numbers, `watch` (12,).

    `columns` (m, m) has the columns of U as its rows, `diagonal` (m,) is D; `watch` the sums of
    the jump test, the mean square of normalised innovations, the time of the last reading, and what
    the jump test usually comes to; `batches` the sums by which errors that last show.
    """

    state: Array
    columns: Array
    diagonal: Array
    watch: Array
    batches: running_batch_means.RunningBatchMeans

    @property
    def places(self) -> tuple[int, int]:
        """Where bias and matrix begin in the state."""
        return 1, 4

    @property
    def bias(self) -> Array:
        """Bias x y z, (3,)."""
        first, _ = self.places
        return self.state[first : first + 3]

    @property
    def matrix(self) -> Array:
        """Matrix xx yy zz xy xz yz, (6,)."""
        return self.state[self.places[1] :]

    @property
    def coefficients(self) -> Index:
        """Which numbers of the state bias and matrix are, those that are estimated, (k,)."""
        bias, matrix = self.places
        return np.concatenate(
            [np.arange(bias, bias + 3), np.arange(matrix, max(len(self.diagonal), matrix))]
        )

    @property
    def time(self) -> float:
        """That of the last reading, s."""
        return float(self.watch[ud_filter.TIME])

    @property
    def consistency(self) -> float:
        """Innovations over their stated sd, rms of the last thousand; about 1."""
        return float(np.sqrt(self.watch[ud_filter.SCALE] / ud_filter.CLIPPED_SQUARE))

    @property
    def covariance(self) -> Array:
        """U D Uᵀ, (m, m)."""
        return np.asarray((self.columns.T * self.diagonal) @ self.columns)

    @property
    def inflation(self) -> running_batch_means.Inflation:
        """By how much each standard error is too small, because errors last."""
        return running_batch_means.compute_inflation(self.batches, self.covariance)


class Predictions(NamedTuple):
    """What was predicted of each reading before it was used, a row a reading.

    `residual` (n,) |W (raw − bias)| − F − g, and its sd, nT; `used` (n,) whether it passed the
    gate; `innovation` (n,) normalised and clipped, as the jump test sees it; `jacobian` (n, 10)
    by the state, normalised.
    """

    residual: Array
    sd: Array
    used: Mask
    innovation: Array
    jacobian: Array


def start_filter(state: Array, covariance: Array, time: float) -> FilterState:
    """A filter from a covariance (m, m); `time` is that of the reading before the first.

    >>> b = start_filter(np.zeros(10), np.diag([1.0, 4, 4, 4]), 0.0)
    >>> b.diagonal.tolist(), np.allclose(b.covariance, np.diag([1.0, 4, 4, 4]))
    ([1.0, 4.0, 4.0, 4.0], True)
    """
    m = len(covariance)
    columns, diagonal, rest = np.eye(m), np.zeros(m), np.array(covariance, dtype=np.float64)
    for j in range(m - 1, -1, -1):
        diagonal[j] = max(rest[j, j], 0.0)
        if diagonal[j] > 0.0:
            columns[j, :j] = rest[:j, j] / diagonal[j]
            rest[:j, :j] -= diagonal[j] * np.outer(columns[j, :j], columns[j, :j])
    watch = np.zeros(ud_filter.WATCHED)
    watch[ud_filter.SCALE], watch[ud_filter.USUAL], watch[ud_filter.TIME] = 1.0, 1.0, time
    batches = running_batch_means.start(len(state))
    return FilterState(np.array(state, dtype=np.float64), columns, diagonal, watch, batches)


def add_variance(before: FilterState, sd: ArrayLike) -> FilterState:
    """The filter with standard deviations, one or (3,), added to those of the bias."""
    columns, diagonal = before.columns.tolist(), before.diagonal.tolist()
    for i, variance in enumerate(np.broadcast_to(np.square(sd), 3).tolist(), start=1):
        ud_filter.add_variance(i, variance, columns, diagonal, [0.0] * 10)
    return before._replace(columns=np.array(columns), diagonal=np.array(diagonal))


def widen_for_jump(before: FilterState, jump_sd: float) -> FilterState:
    """The filter after a possible jump: `jump_sd` added to each bias, the test restarted."""
    watch = np.array([*[0.0] * ud_filter.SCALE, *before.watch[ud_filter.SCALE :]])
    return add_variance(before, jump_sd)._replace(watch=watch)


def advance(
    before: FilterState,
    model: Model,
    rows: Array,
    *,
    linearised: Array | None = None,
    compiled: bool | None = None,
) -> tuple[FilterState, Predictions, bool]:
    """The filter after some readings, what was predicted of each, and whether a jump was seen.

    Stops after the reading at which a jump shows, so `Predictions` may be shorter than the rows.

    Parameters: rows (n, 6) of time (s), raw x y z, reference magnitude (nT), and 1 for a reading
    that may be used, 0 for one that must not be; linearised (10,) takes every residual as linear
    about that state: with it and without walk the result is a Gauss–Newton step of the batch fit
    from there; compiled asks for numba (`None`: for many rows), used where it is installed.
    """
    n = len(rows)
    wanted = is_worth_compiling(n) if compiled is None else compiled
    run = ud_filter.compile_filter() if wanted else None
    sums = before.batches
    parts: Any
    fixed = linearised is not None
    about = before.state if linearised is None else linearised
    if run is None:
        parts = lists = _to_lists(before)
        seen: Any = [[0.0] * ud_filter.SEEN for _ in range(n)]
        room: Any = [[0.0] * 10 for _ in range(3)]
        about = about.tolist()
        done, jump = ud_filter.run(rows.tolist(), *lists, tuple(model), about, fixed, seen, room)
    else:
        parts = tuple(map(np.array, before[:4]))
        seen, room = np.zeros((n, ud_filter.SEEN)), np.zeros((3, 10))
        done, jump = run(np.ascontiguousarray(rows), *parts, tuple(model), about, fixed, seen, room)
    table = np.array(seen[:done]).reshape(-1, ud_filter.SEEN)
    found = Predictions(table[:, 0], table[:, 1], table[:, 2] > 0.0, table[:, 3], table[:, 4:])
    taken = table if np.logical_and.reduce(found.used) else table[found.used]
    sums = running_batch_means.add(sums, taken[:, 4:], taken[:, 0] / taken[:, 1])
    x, columns, diagonal, watch = (np.asarray(part) for part in parts)
    return FilterState(x, columns, diagonal, watch, sums), found, bool(jump)


def _to_lists(before: FilterState) -> tuple[Any, Any, Any, Any]:
    """State, factors and sums of the jump test as the kernel takes them without numba."""
    x, columns, diagonal, watch, _ = before
    return x.tolist(), columns.tolist(), diagonal.tolist(), watch.tolist()


def is_worth_compiling(rows: int) -> bool:
    """Whether numba is to be used for so many rows: for many, and for few once it is loaded."""
    return rows >= COMPILE_FROM or ud_filter.compile_filter.cache_info().currsize > 0


def join_predictions(parts: Sequence[Predictions]) -> Predictions:
    """What was seen of consecutive pieces."""
    return Predictions(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def find_onset(seen: Predictions) -> int:
    """The row at which a jump began: where the test over all rows after it is largest.

    Source: the generalised likelihood ratio of Willsky and Jones (1976), over the onset.
    """
    w, z = seen.jacobian[::-1, 1:4], seen.innovation[::-1]
    information = np.cumsum(w[:, :, None] * w[:, None, :], axis=0) + 1e-12 * np.eye(3)
    score = np.cumsum(w * z[:, None], axis=0)
    statistic = np.einsum("ki,kij,kj->k", score, np.linalg.pinv(information), score)
    return len(z) - 1 - int(np.argmax(statistic))
