"""Bias and matrix beside a gyro: a Kalman filter in U D Uᵀ factors that carries the field along.

The state is x = (field h x y z, bias b, gyro bias β, delay τ, matrix xx yy zz xy xz yz) with a
symmetric matrix W; the covariance is that of its first m numbers. A field that stands still turns
in the sensor, and a late reading shows what it was,

    dh/dt = −(ω − β) × h,    raw = b + W⁻¹ (h + τ (ω − β) × h) + noise.

Between readings h is turned as a whole, at the mean of the rates at both, and takes up the gyro's
noise, what the rates may leave unseen and what the field changes on the way; bias, gyro bias and
matrix walk. The field stands first, so that turning it leaves U triangular but for three rows and
columns, which one Gram–Schmidt mends. In field and bias alone all is linear, so nothing has to be
known to begin with.

Source: C. L. Thornton (1976), JPL Technical Memorandum 33-798, the propagation; G. J. Bierman
(1977), Factorization Methods for Discrete Sequential Estimation, the measurement; the model:
J. L. Crassidis, K.-L. Lai, R. R. Harman (2005), Journal of Guidance, Control, and Dynamics 28(1),
115–120, and M. Kok, T. B. Schön (2016), IEEE Sensors Journal 16(14), 5679–5689, with the field
itself in the place of an attitude.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation.filters import kalman, ud_filter
from agonic.maths.estimation.noise import running_batch_means
from agonic.maths.estimation.turning import motion, reading

STATES = {"bias": 10, "gains": 13, "full": 16}
"""How many numbers of the state are estimated."""
ROW = 9
"""Numbers of a reading: time, raw x y z, rate x y z, magnitude (0: not known), 1 or 0 for use."""

_ROOM = 8


class TurnModel(NamedTuple):
    """The noise model.

    `noise` sd of one reading on one axis; `gyro_noise` rad/√s; `field_walk` nT/√s, what the field
    itself changes on the way; `walk`, `gyro_walk` (rad/s) and `matrix_walk` sd of the change of
    bias, gyro bias and matrix in one second; `external_sd` nT, `external_time_s` the error of the
    reference magnitude; `gate`, `jump_level`, `jump_sd` as in `kalman.Model`; `late_s` and
    `away` are the sd of a delay and of a relative error of the matrix that are not estimated.
    """

    noise: float
    gyro_noise: float
    field_walk: float
    walk: float = 0.0
    gyro_walk: float = 0.0
    matrix_walk: float = 0.0
    external_sd: float = 0.0
    external_time_s: float = 600.0
    gate: float = 5.0
    jump_level: float = 50.0
    jump_sd: float = 2000.0
    late_s: float = 0.0
    away: float = 0.0


class TurnState(kalman.FilterState):
    """What the filter holds, as a `FilterState`: `state` (16,), and `watch` (21,)."""

    __slots__ = ()

    @property
    def places(self) -> tuple[int, int]:
        """Where bias and matrix begin in the state."""
        return 3, 10

    @property
    def field(self) -> Array:
        """The field in the sensor's axes now, (3,), nT."""
        return self.state[:3]

    @property
    def field_sd(self) -> Array:
        """Its standard error, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def gyro_bias(self) -> Array:
        """What the gyro reads too much, (3,), rad/s."""
        return self.state[6:9]

    @property
    def delay_s(self) -> float:
        """How late the readings are behind the gyro's."""
        return float(self.state[9])

    @property
    def unseen_turn(self) -> float:
        """Sd of what the sensor turns between two readings beside what both rates say, rad."""
        return float(np.sqrt(self.watch[reading.UNSEEN]))

    @property
    def time(self) -> float:
        """That of the last reading, s."""
        return float(self.watch[reading.TIME])

    @property
    def lost_s(self) -> float:
        """Seconds since a reading fitted its prediction."""
        return float(self.watch[reading.LOST])

    @property
    def consistency(self) -> float:
        """Innovations over their stated sd, rms of the last thousand; about 1."""
        return float(np.sqrt(self.watch[reading.SCALE] / reading.CLIPPED_SQUARE))

    @property
    def inflation(self) -> running_batch_means.Inflation:
        """By how much each standard error is too small, because errors last; that of the bias."""
        shown = running_batch_means.compute_inflation(self.batches, self.covariance[3:6, 3:6])
        factor = np.full(len(self.diagonal), shown.factor.max())
        factor[3:6] = shown.factor
        return shown._replace(factor=factor)


class TurnSeen(NamedTuple):
    """What was predicted of each reading before it was used, a row a reading.

    `residual` (n, 3) raw less its prediction and its sd (n, 3), in the unit of the readings; `used`
    (n,) whether it passed the gate; `field` (n, 3) and `bias` (n, 3) after it.
    """

    residual: Array
    sd: Array
    used: Mask
    field: Array
    bias: Array


def start_filter(state: Array, covariance: Array, time: float) -> TurnState:
    """A filter from a covariance (m, m); `time` is that of the reading before the first."""
    plain = kalman.start_filter(state, covariance, 0.0)
    watch = np.zeros(reading.WATCHED)
    watch[reading.SCALE], watch[reading.USUAL], watch[reading.TIME] = 1.0, 1.0, time
    return TurnState(
        plain.state, plain.columns, plain.diagonal, watch, running_batch_means.start(3)
    )


def widen_for_jump(before: TurnState, sd: float, field_sd: float = 0.0) -> TurnState:
    """The filter after a possible jump: standard deviations added to each bias and to the field,
    the test restarted."""
    columns, diagonal = before.columns.tolist(), before.diagonal.tolist()
    for i, added in enumerate([field_sd] * 3 + [sd] * 3):
        ud_filter.add_variance(i, added * added, columns, diagonal, [0.0] * len(diagonal))
    wide = before._replace(columns=np.array(columns), diagonal=np.array(diagonal))
    return forget_sums(wide)


def forget_sums(before: TurnState) -> TurnState:
    """The filter with its jump test restarted."""
    watch = before.watch.copy()
    watch[: reading.SCALE] = watch[reading.LOST] = 0.0
    return before._replace(watch=watch)


def advance(
    before: TurnState, model: TurnModel, rows: Array, *, compiled: bool | None = None
) -> tuple[TurnState, TurnSeen, bool]:
    """The filter after rows (n, 9), what was predicted of each, and whether a jump was seen.

    Stops after the reading at which a jump shows. `compiled` as in `kalman.advance`.
    """
    n = len(rows)
    wanted = n >= kalman.COMPILE_FROM if compiled is None else compiled
    kernel = compile_filter() if wanted else None
    parts: Any
    seen: Any
    if kernel is None:
        parts = [part.tolist() for part in before[:4]]
        seen = [[0.0] * reading.SEEN for _ in range(n)]
        room = [[0.0] * 16 for _ in range(_ROOM)]
        x, columns, diagonal, watch = parts
        done, jump = run(rows.tolist(), x, columns, diagonal, watch, tuple(model), seen, room)
    else:
        parts = [np.array(part) for part in before[:4]]
        seen, space = np.zeros((n, reading.SEEN)), np.zeros((_ROOM, 16))
        done, jump = kernel(np.ascontiguousarray(rows), *parts, tuple(model), seen, space)
    table = np.array(seen[:done]).reshape(-1, reading.SEEN)
    used = table[:, 6] > 0.0
    batches = running_batch_means.add(
        before.batches, _find_shown(table[used]).reshape(-1, 3), table[used, 13:16].ravel()
    )
    found = TurnSeen(table[:, :3], table[:, 3:6], used, table[:, 16:19], table[:, 19:22])
    x, columns, diagonal, watch = (np.asarray(part) for part in parts)
    return TurnState(x, columns, diagonal, watch, batches), found, bool(jump)


def _find_shown(table: Array) -> Array:
    """What each innovation shows of the bias, all else being unknown as it is, (n, 3, 3).

    P⁻¹ G, with P the covariance of the bias and G by how much it follows: a row an innovation.
    """
    gain = table[:, 22:31].reshape(-1, 3, 3)
    covariance = np.empty((len(table), 3, 3))
    low = np.tril_indices(3)
    covariance[:, *low] = table[:, 31:37]
    covariance[:, *low[::-1]] = table[:, 31:37]
    return np.asarray(np.linalg.solve(covariance, gain).swapaxes(1, 2))


def run(
    rows: Any, x: Any, columns: Any, diagonal: Any, watch: Any, model: Any, seen: Any, room: Any
) -> tuple[int, bool]:
    """`advance` in place, on lists or arrays; gives the rows done and whether a jump was seen.

    `seen` takes a line a row; `room` is eight lines of sixteen numbers to work in.
    """
    for done in range(len(rows)):
        row = rows[done]
        elapsed = row[0] - watch[reading.TIME]
        rate = motion.find_mean_rate(row, elapsed, watch, reading.RATE, x)
        watch[reading.TIME] = row[0]
        unseen = motion.find_unseen_turn(row, elapsed, watch, reading.RATE)
        motion.turn(rate, elapsed, unseen, model, x, columns, diagonal, room)
        if reading.take(row, elapsed, model, x, columns, diagonal, watch, seen[done], room):
            return done + 1, True
    return len(rows), False


@functools.cache
def compile_filter() -> Callable[..., tuple[int, bool]] | None:
    """`run` compiled by numba, or `None` without it."""
    parts = (*ud_filter.PARTS, *motion.PARTS, *reading.PARTS)
    return ud_filter.compile_parts(run, parts)
