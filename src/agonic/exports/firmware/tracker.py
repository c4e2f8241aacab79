"""A followed calibration as C99: the same filter, in single precision, on the controller."""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

import numpy as np

from agonic.arrays import Array
from agonic.atomic import make_folder, write_atomically
from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.errors import AgonicError
from agonic.exports.banner import write_banner
from agonic.exports.firmware.c_text import (
    fill_template,
    make_c_name,
    require_identifier,
    write_array,
    write_comment,
    write_flash,
    write_literal,
)
from agonic.exports.firmware.size import measure_sizes
from agonic.exports.firmware.turning import SHARE, TESTS, describe_turn
from agonic.exports.firmware.writer import Firmware
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.filters import kalman

ELAPSED_S = 0.5
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
UNKNOWNS = {
    4: "external field, bias",
    7: "external field, bias, diagonal of the matrix",
    10: "external field, bias, matrix",
}
BESIDE_GYRO = {
    10: "field, bias, gyro bias, delay",
    13: "field, bias, gyro bias, delay, diagonal of the matrix",
    16: "field, bias, gyro bias, delay, matrix",
}


def write_tracker(
    params: TrackerParams, state: TrackerState, folder: Path | str, *, name: str | None = None
) -> Firmware:
    """Write a followed calibration as C99 that goes on following it on a controller.

        r = (|W (raw − bias)| − F − g)/|Wᵀû| = noise,   P = U D Uᵀ

    reading by reading in float32, in fixed memory; jumps are told and gone back to. Written are
    `{name}_tracker.h`, `{name}_tracker.c` and `{name}_tracker_selftest.c`.

    Parameters
    ----------
    params, state : those of a `Tracker` that has settled.
    folder : made where it is not there.
    name : what the C names start with; `None`: the sensor's.

    Raises `AgonicError` where the bias is not settled, or the calibration that it started from
    changes with temperature.

    Source: G. J. Bierman (1977), Factorization Methods for Discrete Sequential Estimation.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.tracking import TrackerParams
    >>> from agonic.inflight.tracking import Tracker
    >>> from agonic.reference import Reference
    >>> from agonic.simulation import simulate
    >>> tracker = Tracker(params=TrackerParams(noise=50.0))
    >>> seen = tracker.update(simulate("tumble", n=1500, noise=50.0).samples,
    ...                       Reference.constant(50_000))
    >>> with TemporaryDirectory() as folder:
    ...     written = write_tracker(tracker.params, tracker.state, folder)
    >>> [path.name for path in written.files]
    ['mag_tracker.h', 'mag_tracker.c', 'mag_tracker_selftest.c']
    """
    _require_settled(state)
    prefix = make_c_name(state.base.sensor) if name is None else require_identifier(name)
    settled = state.settle_params(params)
    values = _common(state, prefix) | _numbers(state)
    if state.turn is None:
        model = settled.model(state.noise)
        values |= _model(model) | _known(state, model)
    else:
        values |= describe_turn(state.turn, settled.turn_model(state.noise), state.turned.rotation)
    values["identity"] = str(crc32(repr(sorted(values.items())).encode()))
    parts = _BY_MAGNITUDE if state.turn is None else _BESIDE_GYRO
    folded = "" if state.turn is None else "turning/"
    for part in ("structs", "update"):
        values[part] = fill_template(f"tracker/{folded}{part}.h.in", values).rstrip()
    texts = {
        f"{prefix}_tracker.h": fill_template("tracker/header.h.in", values),
        f"{prefix}_tracker.c": "\n".join(
            fill_template(f"tracker/{part}.c.in", values) for part in parts
        ),
        f"{prefix}_tracker_selftest.c": fill_template("tracker/selftest.c.in", values),
    }
    place = make_folder(folder)
    files = tuple(write_atomically(place / file, text) for file, text in texts.items())
    source = f"{prefix}_tracker.c"
    size = measure_sizes(place / source)
    return Firmware(
        path=place, target="c", files=files, sizes={} if size is None else {source: size}
    )


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
        "GUARD": name.upper(),
        "about": write_comment([*write_banner(state.calibration, formula), f"State: {moment}"]),
        "moment": " ".join(moment.split()),
        "flash": write_flash(),
        "unit_in": state.base.unit_in,
        "turn": _write_turn(state),
    }


def _write_turn(state: TrackerState) -> str:
    """The C that turns the field of the symmetric matrix into that of the calibration's gauge."""
    rotation = {"rotation": write_array(state.turned.rotation)}
    return fill_template(f"tracker/turn_{state.base.gauge}.c.in", rotation)


def _model(model: kalman.Model) -> dict[str, str]:
    names = {
        "noise": model.noise,
        "external": model.external_sd,
        "external_time": model.external_time_s,
        "walk": model.walk,
        "matrix_walk": model.matrix_walk,
        "gate": model.gate,
        "jump_level": model.jump_level,
        "jump_sd": model.jump_sd,
    }
    return {name: write_literal(value) for name, value in names.items()}


def _numbers(state: TrackerState) -> dict[str, str]:
    """What the filter holds, with the columns of U above its diagonal one after the other."""
    estimate = state.estimate
    m = len(estimate.diagonal)
    packed = [estimate.columns[j, i] for j in range(m) for i in range(j)]
    return {
        "states": str(m),
        "unknowns": UNKNOWNS[m] if state.turn is None else BESIDE_GYRO[m],
        "packed": str(len(packed)),
        "x": write_array(estimate.state),
        "columns": write_array(packed),
        "diagonal": write_array(estimate.diagonal),
    }


def _known(state: TrackerState, model: kalman.Model) -> dict[str, str]:
    """Readings all around, and what the filter in double precision makes of them."""
    rng = np.random.default_rng(0)
    rows = _make_readings(state, model, rng)
    model = model._replace(jump_level=0.0)
    watch = np.array([*[0.0] * 9, 1.0, 0.0])
    begun = state.estimate._replace(watch=watch)
    after, _, _ = kalman.advance(begun, model, rows, compiled=False)
    sd = np.sqrt(np.diag(after.covariance)[1:4])
    largest = float(np.abs(rows[:, 1:4]).max())
    return {
        "tests": str(len(rows)),
        "elapsed": write_literal(ELAPSED_S),
        "width": "4",
        "columns_known": "raw, magnitude",
        "passed": "row, row[3]",
        "bias_at": "1",
        "known": write_array(rows[:, 1:5]),
        "bias": write_array([after.state[1:4], sd]),
        "share": write_literal(SHARE),
        "least": write_literal(8 * float(np.finfo(np.float32).eps) * largest),
    }


def _make_readings(state: TrackerState, model: kalman.Model, rng: np.random.Generator) -> Array:
    """Rows (n, 6) of a field as long as the last one, half the noise off."""
    magnitude = float(np.float32(state.magnitude))
    direction = rng.normal(size=(TESTS, 3))
    field = magnitude * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    matrix = unpack_symmetric(state.estimate.state[4:])
    raw = np.linalg.solve(matrix, field.T).T + state.estimate.state[1:4]
    raw += 0.5 * model.noise * rng.uniform(-1, 1, raw.shape)
    rows = np.column_stack([np.zeros(TESTS), raw, np.full(TESTS, magnitude), np.ones(TESTS)])
    rows = rows.astype(np.float32).astype(np.float64)
    rows[:, 0] = ELAPSED_S * np.arange(1, TESTS + 1)
    return np.asarray(rows)
