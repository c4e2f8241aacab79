"""`start` and `update`: a calibration followed from reading to reading."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Opening, Recent, TrackerParams, TrackerState
from agonic.errors import AgonicError, UnitError
from agonic.inflight.tracking import gyro
from agonic.inflight.tracking import opening as openings
from agonic.inflight.tracking.jump import reopen, settle_before_jump
from agonic.inflight.tracking.result import Coefficients
from agonic.maths.estimation.filters import kalman, states
from agonic.maths.rotations.polar import split_rotation

_LEAST = 1e-14  # of the field and gain, squared: variance that every prior has at least


def start(
    calibration: Affine | Thermal | Interference | None,
    params: TrackerParams,
    *,
    epoch: datetime | None = None,
    gyro: bool = False,
) -> TrackerState:
    """The state before the first reading.

    Parameters
    ----------
    calibration : the prior at the start; without covariance it is but a guess; `None`:
        nothing, for readings in nT. Of a `Thermal` the constants move, of an `Interference` bias
        and matrix; `update` then takes readings that went through `TrackerState.at_middle`.
    params : how it is followed.
    epoch : UTC moment of time zero of the readings.
    gyro : whether readings come with the rates of a gyro.

    Raises `AgonicError` for a calibration of another kind.
    """
    if calibration is None:
        base = Affine(bias=np.zeros(3), matrix=np.eye(3))
    elif isinstance(calibration, Thermal):
        base = calibration.at(calibration.centre_C)
    elif isinstance(calibration, Interference):
        base = calibration.at(np.zeros(calibration.coefficients.shape[1]))
    elif type(calibration) is Affine:
        base = calibration
    else:
        raise AgonicError(
            "a tracker follows an Affine, a Thermal or an Interference, not a "
            f"{type(calibration).__name__}; apply that to the readings first and follow what "
            "remains"
        )
    six, rest = split_rotation(base.matrix, base.covariance, base.gauge)
    noise = params.noise or base.noise
    table = states.BESIDE_GYRO if gyro else states.BY_MAGNITUDE
    known = np.zeros(table.sizes["full"])
    known[table.places["bias"]], known[table.places["matrix"]] = base.bias, six
    return TrackerState(
        base=base,
        turned=rest,
        estimate=states.start_filter(known, np.zeros((1, 1)), -np.inf),
        noise=noise or 0.0,
        noise_known=noise is not None,
        epoch=epoch,
        ground=calibration if isinstance(calibration, Thermal) else None,
        aboard=calibration if isinstance(calibration, Interference) else None,
    )


def update(
    state: TrackerState,
    params: TrackerParams,
    time: ArrayLike,
    raw: ArrayLike,
    magnitude: ArrayLike,
    *,
    rate: ArrayLike | None = None,
    compiled: bool | None = None,
) -> tuple[TrackerState, Coefficients]:
    """The state after one reading or many; many in one call or in several come to the same.

    Parameters
    ----------
    state, params : from `start` or the last update, and as given to `start`.
    time : s, one or (n,), increasing, later than the state's.
    raw : (3,) or (n, 3), in the unit of the calibration.
    magnitude : what the field should have been, nT, one or (n,); beside a gyro 0 where not known.
    rate : (3,) or (n, 3), rad/s, of a gyro in the axes of the calibrated field, if started so.
    compiled : numba or not; `None`: for many readings, where it is installed.

    Returns the new state, and `Coefficients`.

    Source: Bierman (1977), UD filter; see docs/theory/tracking.
    """
    one = _read_one(state, time, raw, magnitude)
    if one is not None:
        return _take_one(state, params, one)
    rows = make_rows(state, time, raw, rate, magnitude)
    first = float(rows[0, 0])
    if first <= state.time or (len(rows) > 1 and (np.diff(rows[:, 0]) <= 0).any()):
        raise AgonicError(
            f"times must increase from reading to reading, beyond the last one seen "
            f"({state.time:g} s); pass on only what is new"
        )
    if state.n == 0:
        begin = _begin if state.turn is None else gyro.begin
        state = begin(state, state.settle_params(params), rows[0])
    elif len(rows) == 1 and state.turn is None:
        return _take_one(state, params, rows[0].tolist())
    before, done = state, 0
    moments: tuple[TrackerState, ...] = ()
    seen: list[kalman.Predictions] = []
    fast = kalman.is_worth_compiling(len(rows)) if compiled is None else compiled
    while done < len(rows):
        piece = rows[done : done + _length(state, params, rows[done:, 0])]
        moments += _find_moment(state, params, float(piece[0, 0]))
        if state.turn is None:
            state, predicted = _step(state, params, piece, fast)
        else:
            state, predicted = gyro.step(state, state.settle_params(params), piece, fast)
        seen.append(predicted)
        done = state.n - before.n
    whole = seen[0]
    if len(seen) > 1:
        whole = kalman.Predictions(*map(np.concatenate, zip(*seen, strict=True)))
    residual, sd, field = whole.residual, whole.sd, None
    if state.turn is not None:
        residual, sd = (np.sqrt((one**2).mean(axis=1)) for one in (residual, sd))
        field = whole.field @ state.turned.rotation.T
    return state, Coefficients(
        state=state,
        residual=residual,
        residual_sd=sd,
        used=whole.used,
        jumps=state.jumps[len(before.jumps) :],
        moments=moments,
        field=field,
    )


def _find_moment(
    state: TrackerState, params: TrackerParams, time: float
) -> tuple[TrackerState, ...]:
    """The state, where a moment of the history comes before a reading's time."""
    last, every = state.time, params.history_s
    return (state,) if every > 0 and isfinite(last) and time // every > last // every else ()


def _read_one(
    state: TrackerState, time: ArrayLike, raw: ArrayLike, magnitude: ArrayLike
) -> list[float] | None:
    """The row of one reading that needs no further check; else `None`."""
    if not isinstance(time, float) or not isinstance(magnitude, float):
        return None
    if state.n == 0 or state.estimate.beside_gyro:
        return None
    row = [float(time), *np.asarray(raw, dtype=np.float64).ravel().tolist(), float(magnitude), 1.0]
    fits = len(row) == 6 and isfinite(sum(row)) and row[4] > 0.0
    return row if fits and row[0] > state.estimate.time else None


def _take_one(
    state: TrackerState, params: TrackerParams, row: list[float]
) -> tuple[TrackerState, Coefficients]:
    """`update` by one reading and the magnitude, on lists alone."""
    opening = state.opening
    model = state.settle_params(params).model(state.noise, jumps=opening is None)
    taken = row if opening is None or opening.learns else [*row[:5], 0.0]
    estimate, seen, jumped = kalman.take_one(state.estimate, model, taken)
    used = seen[2] > 0.0 if opening is None else abs(seen[0]) <= model.gate * seen[1]
    after = _follow_up(state, params, estimate, np.array([row]), int(not used), jumped)
    jumps = after.jumps[len(state.jumps) :]
    residual, sd = np.array([[seen[0]], [seen[1]]])
    moments = _find_moment(state, params, row[0])
    return after, Coefficients(after, residual, sd, np.array([used]), jumps, moments)


def _begin(state: TrackerState, params: TrackerParams, row: Array) -> TrackerState:
    """The state with its prior, now that the field is known; opened where it is not yet linear."""
    m = states.BY_MAGNITUDE.sizes[params.solve]
    six = state.estimate.state[4:]
    gain = float(np.mean(six[:3]))
    size = float(row[4]) / gain
    fresh = state.base.covariance is None
    moved = params.bias_sd or (size if fresh else size / 20)
    away = params.matrix_sd or (0.1 * gain if fresh else 0.0)
    covariance = np.zeros((10, 10))
    covariance[1:, 1:] = state.turned.covariance[:9, :9]
    spread = [(params.external_sd or 0.0) ** 2, *[moved**2] * 3, *[away**2] * 6]
    least = [0.0, *[_LEAST * size**2] * 3, *[_LEAST * gain**2] * 6]
    covariance += np.diag(spread) + np.diag(least)
    noise = state.noise if state.noise_known else 0.01 * size
    prior = states.start_filter(state.estimate.state, covariance[:m, :m], float(row[0]))
    opened = Opening(prior=prior, rows=np.empty((0, 6)))
    recent = Recent(before=prior, middle=prior, rows=np.empty((0, 6)))
    ready = state.noise_known and openings.is_nearly_linear(prior, float(row[4]), noise)
    return replace(
        state,
        estimate=prior,
        noise=noise,
        opening=None if ready else opened,
        recent=recent if ready else None,
    )


def _length(state: TrackerState, params: TrackerParams, times: Array) -> int:
    """How many of the readings to take at once: up to the next thing to be done between two."""
    if len(times) == 1:
        return 1
    if state.turn is not None:
        length = gyro.count_at_once(state, times)
    elif state.opening is not None:
        length = openings.count_until_due(len(state.opening.rows))
    else:
        assert state.recent is not None
        length = openings.STRIDE - len(state.recent.rows) % openings.STRIDE
    length = min(length, len(times))
    if params.history_s > 0:
        slot = times[:length] // params.history_s
        length = int(np.searchsorted(slot, slot[0], side="right"))
    return length


def _step(
    state: TrackerState, params: TrackerParams, rows: Array, fast: bool
) -> tuple[TrackerState, kalman.Predictions]:
    """The state after a few readings, and what was predicted of them."""
    opening = state.opening
    model = state.settle_params(params).model(state.noise, jumps=opening is None)
    if opening is None:
        estimate, seen, jumped = kalman.advance(state.estimate, model, rows, compiled=fast)
    else:
        estimate, seen = openings.predict(state.estimate, model, rows, opening.learns, fast)
        jumped = False
    refused = len(seen.used) - int(np.count_nonzero(seen.used))
    taken = rows[: len(seen.residual)]
    return _follow_up(state, params, estimate, taken, refused, jumped), seen


def _follow_up(
    state: TrackerState,
    given: TrackerParams,
    estimate: states.FilterState,
    taken: Array,
    refused: int,
    jumped: bool,
) -> TrackerState:
    """The state after the filter took some readings: what is kept of them, an opening that is due
    solved, and a jump gone back to."""
    opening, recent = state.opening, state.recent
    if opening is not None:
        outliers = None if opening.outliers is None else opening.outliers + refused
        rows = np.concatenate([opening.rows, taken])
        opening = Opening(
            prior=opening.prior,
            rows=rows,
            before=opening.before,
            outliers=outliers,
            learns=opening.learns,
        )
        refused = 0  # they are counted when the opening is closed
    elif recent is not None:
        rows, count = np.concatenate([recent.rows, taken]), len(recent.rows) + len(taken)
        recent = Recent(recent.before, recent.middle, rows)
        if not jumped and count == openings.STRIDE:
            recent = Recent(recent.before, estimate, rows)
        elif not jumped and count == 2 * openings.STRIDE:  # the first half is forgotten
            recent = Recent(recent.middle, estimate, rows[openings.STRIDE :])
    after = state.moved(
        estimate=estimate,
        opening=opening,
        recent=recent,
        n=state.n + len(taken),
        refused=state.refused + refused,
        magnitude=float(taken[-1, 4]),
    )
    if opening is not None and len(opening.rows) in openings.MOMENTS:
        whole = openings.solve_opening(after, given)
        since = openings.count_since_jump(opening, state, whole, state.settle_params(given))
        after, jumped = settle_before_jump(after, given, since) if since else whole, since > 0
    return reopen(after, given) if jumped else after


def make_rows(
    state: TrackerState,
    time: ArrayLike,
    raw: ArrayLike,
    rate: ArrayLike | None,
    magnitude: ArrayLike,
) -> Array:
    """Rows as the kernel takes them, checked: (n, 6), or beside a gyro (n, 9), with its rates in
    the axes of the symmetric matrix."""
    turns = state.turn is not None
    if turns and rate is None:
        raise AgonicError("what is followed beside a gyro needs its rates with every reading")
    field, size = np.asarray(raw, dtype=np.float64).reshape(-1, 3), 7 if turns else 4
    rows = np.ones((len(field), size + 2))
    try:
        rows[:, 0], rows[:, 1:4], rows[:, size] = time, field, magnitude
        if turns:
            rates = np.atleast_2d(np.asarray(rate, dtype=np.float64))
            rows[:, 4:7] = rates @ state.turned.rotation
    except ValueError as error:
        raise AgonicError(f"time, raw, rate and magnitude differ in length ({error})") from None
    if not len(rows):
        raise AgonicError("no readings were given")
    if not isfinite(rows.sum()):  # quicker than to ask each of the numbers
        raise AgonicError("a time, reading, rate or magnitude is not a number; leave such rows out")
    least = rows[:, size].min()
    if least < 0 or (least == 0 and not turns):
        raise UnitError("a reference magnitude must be above zero, in nT")
    return rows
