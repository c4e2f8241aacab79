"""`FilterState`: what the filter of `kalman` holds by a table of states."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index
from agonic.maths.estimation.filters import factors, jump_test, motion
from agonic.maths.estimation.noise import running_batch_means


class Table(NamedTuple):
    """The states of a filter: where each stands, and how many numbers are estimated by what is
    solved for; numbers of a row of readings, numbers `seen` of each, and where among these stand
    the parts that are `kept` as `Predictions`; the states of which batch means are summed, and the
    mean square of a clipped innovation."""

    places: dict[str, slice]
    sizes: dict[str, int]
    row: int
    seen: int
    kept: tuple[slice | int, ...]
    batched: slice
    clipped_square: float


BY_MAGNITUDE = Table(
    {"external": slice(0, 1), "bias": slice(1, 4), "matrix": slice(4, 10)},
    {"bias": 4, "gains": 7, "full": 10},
    row=6,
    seen=14,
    kept=(0, 1, 2, 3, slice(4, 14), slice(0, 0)),
    batched=slice(0, 10),
    clipped_square=0.97756,
)
"""A row is time, raw x y z, reference magnitude, and 1 or 0 for use. The mean square is that of a
standard normal number clipped at 2.5."""
BESIDE_GYRO = Table(
    {
        "field": slice(0, 3),
        "bias": slice(3, 6),
        "gyro_bias": slice(6, 9),
        "delay": slice(9, 10),
        "matrix": slice(10, 16),
    },
    {"bias": 10, "gains": 13, "full": 16},
    row=9,
    seen=34,
    kept=(slice(0, 3), slice(3, 6), 6, slice(13, 16), slice(19, 34), slice(16, 19)),
    batched=slice(3, 6),
    clipped_square=0.9258,
)
"""A row is time, raw x y z, rate x y z, magnitude (0: not known), and 1 or 0 for use. The mean
square is that of min(χ², 2.5²)/3, χ² of three degrees of freedom."""
TABLES = {table.sizes["full"]: table for table in (BY_MAGNITUDE, BESIDE_GYRO)}


class Model(NamedTuple):
    """The noise model, in the unit of the readings where nothing else is said.

    `noise` sd of one reading on one axis; `external_sd`, nT, and `external_time_s` the error of the
    reference magnitude; `walk`, `gyro_walk` (rad/s) and `matrix_walk` sd of the change of bias,
    gyro bias and each entry of the matrix in one second (they grow with √t); `gate` standard
    deviations beyond which a reading is refused; `jump_level` the statistic (χ² with three degrees
    of freedom) above which a jump is announced, 0 for never; `jump_sd` the expected size of a jump.

    `gyro_noise` rad/√s; `field_walk` nT/√s, what the field itself changes on the way; `late_s` and
    `away` are the sd of a delay and of a relative error of the matrix that are not estimated.
    """

    noise: float
    external_sd: float = 0.0
    external_time_s: float = 600.0
    walk: float = 0.0
    matrix_walk: float = 0.0
    gate: float = 5.0
    jump_level: float = 50.0
    jump_sd: float = 2000.0
    gyro_noise: float = 0.0
    field_walk: float = 0.0
    gyro_walk: float = 0.0
    late_s: float = 0.0
    away: float = 0.0


class FilterState(NamedTuple):
    """What the filter holds, in lists, on which Python is faster than NumPy on arrays this small,
    or in the arrays of the compiled filter.

    `numbers` of the state; U D Uᵀ of its first m as `upper`, which has the columns of U as its
    lines, and `scales`, which is D; `watched` the sums of the jump test and what else is averaged
    (the places are in `jump_test`); `batches` the sums by which errors that last show.
    """

    numbers: Any
    upper: Any
    scales: Any
    watched: Any
    batches: running_batch_means.RunningBatchMeans

    @property
    def table(self) -> Table:
        """Where each state stands."""
        return TABLES[len(self.numbers)]

    @property
    def beside_gyro(self) -> bool:
        """Whether the field is carried along by a gyro."""
        return self.table is BESIDE_GYRO

    @property
    def state(self) -> Array:
        """All numbers of the state."""
        return np.array(self.numbers)

    @property
    def columns(self) -> Array:
        """The columns of U as rows, (m, m)."""
        return np.array(self.upper)

    @property
    def diagonal(self) -> Array:
        """D, (m,)."""
        return np.array(self.scales)

    @property
    def watch(self) -> Array:
        """What is watched."""
        return np.array(self.watched)

    @property
    def bias(self) -> Array:
        """Bias x y z, (3,)."""
        return self.find("bias")

    @property
    def matrix(self) -> Array:
        """Matrix xx yy zz xy xz yz, (6,)."""
        return self.find("matrix")

    @property
    def field(self) -> Array:
        """The field in the sensor's axes now, (3,), nT; beside a gyro."""
        return self.find("field")

    @property
    def gyro_bias(self) -> Array:
        """What the gyro reads too much, (3,), rad/s."""
        return self.find("gyro_bias")

    @property
    def delay_s(self) -> float:
        """How late the readings are behind the gyro's."""
        return float(self.find("delay")[0])

    def find(self, name: str) -> Array:
        """A state by its name in the table."""
        return np.array(self.numbers[self.table.places[name]])

    def find_sd(self, name: str) -> Array:
        """The standard errors of a state by its name in the table, as the filter states them."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[self.table.places[name]]))

    @property
    def coefficients(self) -> Index:
        """Which numbers of the state bias and matrix are, those that are estimated, (k,)."""
        bias, matrix = (self.table.places[name] for name in ("bias", "matrix"))
        m = len(self.scales)
        chosen: Index = np.r_[bias, matrix.start : max(m, matrix.start)]
        return chosen

    @property
    def time(self) -> float:
        """That of the last reading, s."""
        return float(self.watched[jump_test.TIME])

    @property
    def unseen_turn(self) -> float:
        """Sd of what the sensor turns between two readings beside what both rates say, rad."""
        return float(np.sqrt(self.watched[motion.UNSEEN]))

    @property
    def consistency(self) -> float:
        """Innovations over their stated sd, rms of the last thousand; about 1."""
        return float(np.sqrt(self.watched[jump_test.SCALE] / self.table.clipped_square))

    @property
    def covariance(self) -> Array:
        """U D Uᵀ, (m, m)."""
        columns = self.columns
        return np.asarray((columns.T * self.diagonal) @ columns)

    @property
    def inflation(self) -> running_batch_means.Inflation:
        """By how much each standard error is too small, because errors last; beside a gyro that of
        the bias, and the largest of it for the others."""
        batched = self.table.batched
        shown = running_batch_means.compute_inflation(
            self.batches, self.covariance[batched, batched]
        )
        factor = np.full(len(self.scales), shown.factor.max())
        factor[batched] = shown.factor
        return shown._replace(factor=factor)

    def watching(self, sums: dict[int, float]) -> FilterState:
        """The filter with some of what it watches replaced, by their places."""
        return self._replace(watched=[sums.get(k, v) for k, v in enumerate(self.watched)])


def start_filter(state: ArrayLike, covariance: Array, time: float) -> FilterState:
    """A filter from a covariance (m, m); `time` is that of the reading before the first."""
    m = len(covariance)
    columns, diagonal, rest = np.eye(m), np.zeros(m), np.array(covariance, dtype=np.float64)
    for j in range(m - 1, -1, -1):
        diagonal[j] = max(rest[j, j], 0.0)
        if diagonal[j] > 0.0:
            columns[j, :j] = rest[:j, j] / diagonal[j]
            rest[:j, :j] -= diagonal[j] * np.outer(columns[j, :j], columns[j, :j])
    numbers = np.asarray(state, dtype=np.float64).tolist()
    watched = [0.0] * jump_test.WATCHED
    watched[jump_test.SCALE], watched[jump_test.USUAL], watched[jump_test.TIME] = 1.0, 1.0, time
    batched = TABLES[len(numbers)].batched
    batches = running_batch_means.start(batched.stop - batched.start)
    return FilterState(numbers, columns.tolist(), diagonal.tolist(), watched, batches)


def add_variance(before: FilterState, sd: ArrayLike, name: str = "bias") -> FilterState:
    """The filter with standard deviations, one or one for each, added to those of a state."""
    place, room = before.table.places[name], [0.0] * len(before.scales)
    columns, diagonal = before.columns.tolist(), before.diagonal.tolist()
    sds = np.broadcast_to(np.asarray(sd, dtype=np.float64), place.stop - place.start)
    for i, own in enumerate(sds.tolist(), start=place.start):
        factors.walk(own, 1.0, i, i + 1, columns, diagonal, room)
    return before._replace(upper=columns, scales=diagonal)


def widen_for_jump(before: FilterState, sd: float, field_sd: float = 0.0) -> FilterState:
    """The filter after a possible jump: `sd` added to each bias, and `field_sd` to the field beside
    a gyro; the test restarted."""
    wide = add_variance(before, field_sd, "field") if field_sd else before
    return forget_sums(add_variance(wide, sd))


def forget_sums(before: FilterState) -> FilterState:
    """The filter with its jump test restarted."""
    return before.watching(dict.fromkeys((*range(jump_test.SCALE), jump_test.LOST), 0.0))
