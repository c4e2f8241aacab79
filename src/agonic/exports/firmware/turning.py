"""What the C of a tracker beside a gyro takes: numbers, and readings whose outcome is known."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.exports.firmware.c_text import write_array, write_literal
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.turning import filter as turning
from agonic.maths.estimation.turning import reading

TESTS = 24
ELAPSED_S = 0.05
SHARE = 0.02
"""Of a standard error: what the self-test allows the bias and the standard error itself."""


def describe_turn(
    turn: turning.TurnState, model: turning.TurnModel, rotation: Array
) -> dict[str, str]:
    """Values of the templates: the noise model, the last rate, and known readings.

    `rotation` (3, 3) from the axes of the symmetric matrix to those of gyro and field.
    """
    names = {
        "noise": model.noise,
        "gyro_noise": model.gyro_noise,
        "field_walk": model.field_walk,
        "walk": model.walk,
        "gyro_walk": model.gyro_walk,
        "matrix_walk": model.matrix_walk,
        "external": model.external_sd,
        "external_time": model.external_time_s,
        "gate": model.gate,
        "jump_level": model.jump_level,
        "jump_sd": model.jump_sd,
    }
    return {name: write_literal(value) for name, value in names.items()} | {
        "rate": write_array(turn.watch[reading.RATE : reading.RATE + 3]),
        "change": write_array(turn.watch[reading.RATE + 3 : reading.RATE + 6]),
        "bent": write_literal(turn.watch[reading.RATE + 6]),
        "axes": write_array(rotation),
        **_make_test(turn, model, rotation),
    }


def _make_test(
    turn: turning.TurnState, model: turning.TurnModel, rotation: Array
) -> dict[str, str]:
    """Readings while the sensor turns, and what the filter in double precision makes of them."""
    rows = _make_readings(turn, model)
    begun = turning.forget_sums(turn._replace(watch=turn.watch.copy()))
    begun.watch[reading.TIME] = 0.0
    begun.watch[reading.SCALE] = begun.watch[reading.USUAL] = 1.0
    after, _, _ = turning.advance(begun, model, rows, compiled=False)
    sd = np.sqrt(np.diag(after.covariance)[3:6])
    known = np.column_stack([rows[:, 1:4], rows[:, 4:7] @ rotation.T, rows[:, 7]])
    largest = float(np.abs(rows[:, 1:4]).max())
    return {
        "width": "7",
        "columns_known": "raw, rate, magnitude",
        "passed": "row, row + 3, row[6]",
        "bias_at": "3",
        "tests": str(len(rows)),
        "elapsed": write_literal(ELAPSED_S),
        "known": write_array(known),
        "bias": write_array([after.bias, sd]),
        "share": write_literal(SHARE),
        "least": write_literal(8 * float(np.finfo(np.float32).eps) * largest),
    }


def _make_readings(turn: turning.TurnState, model: turning.TurnModel) -> Array:
    """Rows (n, 9) of the field as the sensor turns about one axis after the other."""
    rng = np.random.default_rng(0)
    rate = np.repeat(1.5 * np.eye(3), TESTS // 3, axis=0) + turn.gyro_bias
    last, field = turn.watch[reading.RATE : reading.RATE + 3], turn.field.copy()
    inverse = np.linalg.inv(unpack_symmetric(turn.matrix))
    rows = np.empty((TESTS, turning.ROW))
    for k, now in enumerate(rate):
        mean = 0.5 * (now + last) - turn.gyro_bias
        field, last = Rotation.from_rotvec(-ELAPSED_S * mean).apply(field), now
        true = now - turn.gyro_bias
        shown = field + turn.delay_s * np.cross(true, field)
        raw = turn.bias + inverse @ shown + 0.3 * model.noise * rng.uniform(-1, 1, 3)
        size = float(np.linalg.norm(field))
        rows[k] = [ELAPSED_S * (k + 1), *raw, *now, size, 1.0]
    return rows
