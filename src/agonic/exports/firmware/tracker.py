"""A followed calibration as C99: the same filter, in single precision, on the controller."""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.errors import AgonicError
from agonic.exports.banner import write_banner
from agonic.exports.firmware import c_text as c
from agonic.exports.firmware.writer import Firmware, write_files
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.filters import jump_test, kalman, motion
from agonic.maths.estimation.filters.states import FilterState, Model, forget_sums

READINGS = 24
ELAPSED_S, TURNING_S = 0.5, 0.05
"""Between the readings of a self-test, by the magnitude and beside a gyro."""
_BY_MAGNITUDE = ("start", "algebra", "magnitude", "jump_test", "jump", "calls", "results", "save")
_BESIDE_GYRO = (
    "turning/start",
    "algebra",
    "turning/motion",
    "turning/reading",
    "jump_test",
    "turning/calls",
    "results",
    "save",
)
_LABELS = {"external": "external field", "gyro_bias": "gyro bias"}


def write_tracker(
    params: TrackerParams, state: TrackerState, folder: Path | str, *, name: str | None = None
) -> Firmware:
    """Write a followed calibration as C99 that goes on following it on a controller.

        r = (|W (raw − bias)| − F − g)/|Wᵀû| = noise,   P = U D Uᵀ

    reading by reading in float32, in fixed memory; jumps are reported, and the estimate restarts
    from before them. Written are `{name}_tracker.h`, `{name}_tracker.c` and
    `{name}_tracker_selftest.c`.

    Source: G. J. Bierman (1977), Factorization Methods for Discrete Sequential Estimation.
    """
    _require_settled(state)
    prefix = c.make_c_name(state.base.sensor) if name is None else c.require_identifier(name)
    settled = state.settle_params(params)
    model = settled.model(state.noise)
    values = _common(state, prefix) | _numbers(state)
    values |= {name: c.write_literal(value) for name, value in model._asdict().items()}
    values |= _make_test(state, model)
    values["identity"] = str(crc32(repr(sorted(values.items())).encode()))
    parts = _BY_MAGNITUDE if state.turn is None else _BESIDE_GYRO
    folded = "" if state.turn is None else "turning/"
    for part in ("structs", "update"):
        values[part] = c.fill_template(f"tracker/{folded}{part}.h.in", values).rstrip()
    texts = c.fill_files(f"{prefix}_tracker", "tracker", parts, values)
    texts[f"{prefix}_tracker_selftest.c"] = c.fill_template("tracker/selftest.c.in", values)
    return write_files(folder, texts)


def _require_settled(state: TrackerState) -> None:
    if state.ground is not None:
        raise AgonicError(
            "the calibration that the tracker started from changes with temperature, which its C "
            "does not hold; apply that calibration to the readings and follow what remains"
        )
    if state.aboard is not None:
        raise AgonicError(
            "the calibration that the tracker started from takes out what disturbs on board, which "
            "its C does not hold; take that out of the readings before they are passed on, and "
            "follow what remains"
        )
    if not state.settled:
        raise AgonicError(
            f"the tracker has not settled after {state.n} readings; pass on more, in more "
            "directions of the field, and export it then"
        )


def _common(state: TrackerState, name: str) -> dict[str, str]:
    formula = "field = matrix (raw - bias), both followed, float32"
    at = "" if state.epoch is None else f", seconds from {state.epoch.isoformat()}"
    moment = f"the last of {state.n} readings: {state.time:.1f} s{at}"
    return {
        "name": name,
        "about": c.write_comment([*write_banner(state.calibration, formula), f"State: {moment}"]),
        "moment": " ".join(moment.split()),
        "unit_in": state.base.unit_in,
        "turn": _write_turn(state),
    }


def _write_turn(state: TrackerState) -> str:
    """The C that turns the field of the symmetric matrix into that of the calibration's gauge."""
    rotation = {"rotation": c.write_array(state.turned.rotation)}
    return c.fill_template(f"tracker/turn_{state.base.gauge}.c.in", rotation)


def _numbers(state: TrackerState) -> dict[str, str]:
    """What the filter holds, with the columns of U above its diagonal one after the other."""
    estimate = state.estimate
    m = len(estimate.scales)
    packed = [estimate.upper[j][i] for j in range(m) for i in range(j)]
    numbers = {
        "states": str(m),
        "unknowns": _name_unknowns(estimate),
        "packed": str(len(packed)),
        "x": c.write_array(estimate.state),
        "columns": c.write_array(packed),
        "diagonal": c.write_array(estimate.diagonal),
    }
    if state.turn is None:
        return numbers
    rate = np.array(estimate.watched[motion.RATE : motion.UNSEEN])
    return numbers | {
        "rate": c.write_array(rate[:3]),
        "change": c.write_array(rate[3:6]),
        "bent": c.write_literal(rate[6]),
        "axes": c.write_array(state.turned.rotation),
    }


def _name_unknowns(estimate: FilterState) -> str:
    """The states of which some numbers are estimated, in words."""
    places, m = estimate.table.places, len(estimate.scales)
    named = [_LABELS.get(name, name) for name, place in places.items() if place.stop <= m]
    diagonal = places["matrix"].start < m < places["matrix"].stop
    return ", ".join([*named, "diagonal of the matrix"] if diagonal else named)


def _make_test(state: TrackerState, model: Model) -> dict[str, str]:
    """Readings, and what the filter in double precision makes of them."""
    estimate = state.estimate
    if state.turn is None:
        rows, elapsed = _make_readings(state, model), ELAPSED_S
        known = rows[:, 1:5]
        words = {"columns_known": "raw, magnitude", "passed": "row, row[3]"}
    else:
        rows, elapsed = _make_turned(state.turn, model), TURNING_S
        rates = rows[:, 4:7] @ state.turned.rotation.T
        known = np.column_stack([rows[:, 1:4], rates, rows[:, 7]])
        words = {"columns_known": "raw, rate, magnitude", "passed": "row, row + 3, row[6]"}
    begun = forget_sums(estimate).watching(
        {jump_test.TIME: 0.0, jump_test.SCALE: 1.0, jump_test.USUAL: 1.0}
    )
    after, _, _ = kalman.advance(begun, model._replace(jump_level=0.0), rows, compiled=False)
    largest = float(np.abs(rows[:, 1:4]).max())
    return words | {
        "tests": str(len(rows)),
        "elapsed": c.write_literal(elapsed),
        "width": str(known.shape[1]),
        "bias_at": str(estimate.table.places["bias"].start),
        "known": c.write_array(known),
        "bias": c.write_array([after.bias, after.find_sd("bias")]),
        "share": c.write_literal(0.02),  # of a standard error, of bias and standard error
        "least": c.write_literal(8 * float(np.finfo(np.float32).eps) * largest),
    }


def _make_readings(state: TrackerState, model: Model) -> Array:
    """Rows (n, 6) all around of a field as long as the last one, half the noise off."""
    rng = np.random.default_rng(0)
    magnitude = float(np.float32(state.magnitude))
    direction = rng.normal(size=(READINGS, 3))
    field = magnitude * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    matrix = unpack_symmetric(state.estimate.matrix)
    raw = np.linalg.solve(matrix, field.T).T + state.estimate.bias
    raw += 0.5 * model.noise * rng.uniform(-1, 1, raw.shape)
    rows = np.column_stack(
        [np.zeros(READINGS), raw, np.full(READINGS, magnitude), np.ones(READINGS)]
    )
    rows = rows.astype(np.float32).astype(np.float64)
    rows[:, 0] = ELAPSED_S * np.arange(1, READINGS + 1)
    return np.asarray(rows)


def _make_turned(turn: FilterState, model: Model) -> Array:
    """Rows (n, 9) of the field as the sensor turns about one axis after the other."""
    rng = np.random.default_rng(0)
    rate = np.repeat(1.5 * np.eye(3), READINGS // 3, axis=0) + turn.gyro_bias
    last, field = np.array(turn.watched[motion.RATE : motion.RATE + 3]), turn.field
    inverse = np.linalg.inv(unpack_symmetric(turn.matrix))
    rows = np.empty((READINGS, turn.table.row))
    for k, now in enumerate(rate):
        mean = 0.5 * (now + last) - turn.gyro_bias
        field, last = Rotation.from_rotvec(-TURNING_S * mean).apply(field), now
        true = now - turn.gyro_bias
        shown = field + turn.delay_s * np.cross(true, field)
        raw = turn.bias + inverse @ shown + 0.3 * model.noise * rng.uniform(-1, 1, 3)
        size = float(np.linalg.norm(field))
        rows[k] = [TURNING_S * (k + 1), *raw, *now, size, 1.0]
    return rows
