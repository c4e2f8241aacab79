"""Sequential estimation of bias and matrix: one Kalman filter, two tables of states.

What is estimated stands in a table: how many numbers each state has, how it goes on in time, and
what a reading says of it. The covariance is that of the first m numbers; the others are fixed.

By the magnitude, with W symmetric and g what the reference leaves out (crust, ring current),

    x = (g, bias, W xx yy zz xy xz yz),    r(x) = (|W (raw − bias)| − F − g)/|s| = noise,  s = W û,

the distance residual of `affine.magnitude_residual`; g is a first-order Gauss–Markov process.

Beside a gyro the field h itself is carried along. A field that stands still turns in the sensor at
the rates ω less the gyro's bias β, and a reading that is late by τ shows what it was,

    x = (h, bias, β, τ, W),    dh/dt = −(ω − β) × h,    raw = bias + W⁻¹ (h + τ (ω − β) × h).

In field and bias alone all is linear, so nothing has to be known to begin with. Bias, gyro bias and
matrix walk at random.

The covariance is kept as U D Uᵀ, U unit upper triangular: with D not negative it stays a
covariance, whatever the rounding. What decays or turns stands first, so that U stays triangular but
for few rows (`factors`, `motion`, `reading`).

Source: G. J. Bierman (1977), Factorization Methods for Discrete Sequential Estimation, Academic
Press, chapters III and V; C. L. Thornton (1976), JPL Technical Memorandum 33-798, the propagation.
Jumps: A. S. Willsky, H. L. Jones (1976), IEEE Transactions on Automatic Control 21(1), 108–112, doi
10.1109/TAC.1976.1101146. Beside a gyro: J. L. Crassidis, K.-L. Lai, R. R. Harman (2005), Journal of
Guidance, Control, and Dynamics 28(1), 115–120, and M. Kok, T. B. Schön (2016), IEEE Sensors Journal
16(14), 5679–5689, with the field itself in the place of an attitude.
"""

from __future__ import annotations

import functools
import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation.filters import factors, jump_test, motion, reading, states
from agonic.maths.estimation.filters.states import FilterState, Model
from agonic.maths.estimation.noise import running_batch_means

COMPILE_FROM = 3000
"""Rows for which numba is worth loading."""


class Predictions(NamedTuple):
    """What was predicted of each reading before it was used, a row a reading.

    `residual` and its `sd`: (n,) |W (raw − bias)| − F − g, nT; beside a gyro (n, 3) raw less its
    prediction, in the unit of the readings. `used` (n,) whether it passed the gate; `innovation`
    (n,) or (n, 3), normalised, and `shown`, (n, 10) or (n, 3, 3), what each says of the states of
    which batch means are kept. Beside a gyro `field` (n, 3) after the reading.
    """

    residual: Array
    sd: Array
    used: Mask
    innovation: Array
    shown: Array
    field: Array


def advance(
    before: FilterState,
    model: Model,
    rows: Array,
    *,
    linearised: Array | None = None,
    compiled: bool | None = None,
) -> tuple[FilterState, Predictions, bool]:
    """The filter after some rows (n, 6) or (n, 9), what was predicted of each, and whether a jump
    was seen, at which it stops.

    `linearised` (10,) takes every residual by the magnitude as linear about that state: without
    walk the result is a Gauss–Newton step of the batch fit from there; `compiled` asks for numba
    (`None`: for many rows), used where it is installed.
    """
    n, table = len(rows), before.table
    wanted = is_worth_compiling(n) if compiled is None else compiled
    kernel = compile_filter() if wanted else None
    fixed = linearised is not None
    turning = True if before.beside_gyro else None
    seen: Any
    x: Any
    columns: Any
    about: Any
    if kernel is None:
        x, columns, diagonal, watch = _copy_lists(before)
        about = x if linearised is None else linearised.tolist()
        seen, room = [[0.0] * table.seen for _ in rows], [[0.0] * 16 for _ in range(reading.ROOM)]
        given = (rows.tolist(), x, columns, diagonal, watch, model, about)
        done, jump = run(*given, fixed, turning, seen, room)
    else:
        x, columns, diagonal, watch = map(np.array, before[:4])
        seen, space = np.zeros((n, table.seen)), np.zeros((reading.ROOM, 16))
        about = before.state if linearised is None else linearised
        known = (np.ascontiguousarray(rows), x, columns, diagonal, watch, model, about)
        done, jump = kernel(*known, fixed, turning, seen, space)
    kept = np.array(seen[:done] if done else np.empty((0, table.seen)))
    residual, sd, used, *others = [kept[:, place] for place in table.kept]
    found = Predictions(residual, sd, used > 0.0, *others)
    batches = _sum_batches(before.batches, found)
    return FilterState(x, columns, diagonal, watch, batches), found, bool(jump)


def take_one(
    before: FilterState, model: Model, row: list[float]
) -> tuple[FilterState, list[float], bool]:
    """`advance` by one reading and the magnitude, on lists alone; of the reading a line as the
    table says."""
    x, columns, diagonal, watch = _copy_lists(before)
    seen, room = [0.0] * states.BY_MAGNITUDE.seen, ([0.0] * 10, [0.0] * 10, [0.0] * 10)
    _, jump = run((row,), x, columns, diagonal, watch, model, x, False, None, (seen,), room)
    batches = before.batches
    if seen[2] > 0.0:
        batches = running_batch_means.add_one(batches, seen[4:], seen[0] / seen[1])
    return FilterState(x, columns, diagonal, watch, batches), seen, jump


def _copy_lists(before: FilterState) -> tuple[Any, ...]:
    """Numbers, columns, scales and what is watched, to be worked on as lists."""
    x, columns, diagonal, watch = (
        part.tolist() if isinstance(part, np.ndarray) else part.copy() for part in before[:4]
    )
    return x, [column.copy() for column in columns], diagonal, watch


def _sum_batches(
    before: running_batch_means.RunningBatchMeans, found: Predictions
) -> running_batch_means.RunningBatchMeans:
    """The sums with what the readings that were used show."""
    shown, innovation = found.shown, found.innovation
    if innovation.ndim == 1:
        innovation = found.residual / found.sd
    if not found.used.all():
        shown, innovation = shown[found.used], innovation[found.used]
    if innovation.ndim > 1:
        shown, innovation = _find_shown(shown).reshape(-1, 3), innovation.ravel()
    return running_batch_means.add(before, shown, innovation)


def _find_shown(table: Array) -> Array:
    """What each innovation beside a gyro shows of the bias, all else being unknown as it is,
    (n, 3, 3).

    P⁻¹ G, with P the covariance of the bias and G by how much it follows: a row an innovation.
    """
    gain = table[:, :9].reshape(-1, 3, 3)
    covariance = np.empty((len(table), 3, 3))
    low = np.tril_indices(3)
    covariance[:, *low] = table[:, 9:]
    covariance[:, *low[::-1]] = table[:, 9:]
    return np.asarray(np.linalg.solve(covariance, gain).swapaxes(1, 2))


def run(
    rows: Any,
    x: Any,
    columns: Any,
    diagonal: Any,
    watch: Any,
    model: Any,
    about: Any,
    linearised: bool,
    turning: Any,
    seen: Any,
    room: Any,
) -> tuple[int, bool]:
    """`advance` in place, on lists or arrays; gives the rows done and whether a jump was seen.

    `turning` is `None` without a gyro, which numba then compiles nothing for; `seen` takes a line a
    row; `room` is eight lines of sixteen numbers to work in.
    """
    for done in range(len(rows)):
        row = rows[done]
        elapsed = row[0] - watch[jump_test.TIME]
        watch[jump_test.TIME] = row[0]
        if turning is None:
            motion.decay(elapsed, model, x, columns, diagonal, room[0])
            jump = reading.take_magnitude(
                row, model, x, columns, diagonal, watch, about, linearised, seen[done], room
            )
        else:
            motion.turn(row, elapsed, model, x, columns, diagonal, watch, room)
            jump = reading.take_vector(
                row, elapsed, model, x, columns, diagonal, watch, seen[done], room
            )
        if jump:
            return done + 1, True
    return len(rows), False


@functools.cache
def compile_filter() -> Callable[..., tuple[int, bool]] | None:
    """`run` and what it calls compiled by numba, or `None` without it.

    What numba keeps on the disk it compiles anew where this file has changed; a change of another
    one has to be seen here.
    """
    try:
        numba = importlib.import_module("numba")
        extending = importlib.import_module("numba.extending")
    except ImportError:
        return None
    modules = (factors, jump_test, motion, reading)
    for module in modules:
        for part in vars(module).values():
            if inspect.isfunction(part) and part.__module__ == module.__name__:
                extending.register_jitable(part)
    kernel: Any
    try:
        kernel = numba.njit(cache=True)(run)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(run)
        return cast(Callable[..., tuple[int, bool]], kernel)
    files = [Path(str(module.__file__)) for module in modules]
    changed = max((file.stat().st_mtime for file in files if file.is_file()), default=0.0)
    for index in Path(kernel.stats.cache_path).glob("*.run-*.nbi"):
        if index.stat().st_mtime < changed:
            index.unlink(missing_ok=True)
    return cast(Callable[..., tuple[int, bool]], kernel)


def is_worth_compiling(rows: int) -> bool:
    """Whether numba is to be used for so many rows: for many, and for few once it is loaded."""
    return rows >= COMPILE_FROM or compile_filter.cache_info().currsize > 0
