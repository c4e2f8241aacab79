"""The table of known readings: what goes in is drawn here, what must come out is predicted."""

from __future__ import annotations

import itertools

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.exports.firmware.c_text import (
    fill_template,
    write_comment,
    write_literal,
)
from agonic.exports.firmware.grid import DeclinationGrid
from agonic.exports.firmware.plan import Plan
from agonic.exports.firmware.prediction import (
    CHOICE_SHARE,
    MEMBERS,
    Prediction,
    correct_readings,
    predict,
    predict_one,
)
from agonic.exports.firmware.sources import write_about
from agonic.exports.temperature import changes_with_temperature, evaluate_affine
from agonic.maths.rotations.attitude import rot_nb

MIN_CLEARANCE = 1e-3  # of a disturbance: far beyond rounding
EDGE_ANGLES_DEG = (
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 90.0),
    (0.0, 0.0, 180.0),
    (0.0, 0.0, 270.0),
    (0.0, 0.0, 359.99),
    (79.0, 0.0, 33.0),
    (-79.0, 0.0, 123.0),
    (0.0, 79.0, 213.0),
    (0.0, -79.0, 303.0),
    (50.0, -60.0, 77.0),
    (-30.0, 85.0, 10.0),
    (180.0, 0.0, 45.0),
)
"""Roll, pitch, heading: the quarters, the steepest that is allowed, and beyond it."""


def make_known_readings(plan: Plan, count: int = 40, seed: int = 0) -> dict[str, Array]:
    """Inputs in float32: the edges first, then attitudes up to 80° of tilt, the last disturbed. The
    magnetometers read the field of a place with the dip that the setup expects, or 60°, turned into
    body axes and back through each calibration."""
    rng = np.random.default_rng(seed)
    random = draw_attitudes(rng, max(count - len(EDGE_ANGLES_DEG), 3))
    roll, pitch, heading = np.concatenate([EDGE_ANGLES_DEG, random]).T
    n, k = len(roll), len(plan.calibrations)
    inputs = {"roll_deg": roll, "pitch_deg": pitch}
    turn = rot_nb(roll, pitch, heading)
    inputs["acceleration"] = -9.81 * turn[:, 2]
    inputs["acceleration"][-3] *= 1.3
    if plan.accelerometer is not None:
        inputs["acceleration"] = invert(plan.accelerometer, inputs["acceleration"])
    inputs["current_A"], inputs["throttle"] = rng.uniform(0, 30, n), rng.uniform(0, 1, n)
    for column in plan.columns:
        inputs.setdefault(column, rng.uniform(0.0, 2.0, n))
    inputs["second"] = rng.normal(size=(n, k, 3)) * _reading_sizes(plan)[:, None]
    inputs |= _temperatures(plan, n)
    inputs |= _places(plan.declination, rng, n)
    dip = np.pi / 3 if plan.dip is None else plan.dip
    field_b = np.einsum("nij,i->nj", turn, [np.cos(dip), 0.0, np.sin(dip)])
    push = np.ones((n, k, 1))
    push[-2:, :, 0] = 1.5 + 2 * plan.setup.magnitude_limit + 0.1 * np.arange(k)
    if k > 1:
        push[-5:-3, 0] = 1.5 + 2 * plan.setup.magnitude_limit  # so the second is used
    inputs["raw"] = np.stack(
        [_raw(plan, which, field_b * push[:, which], inputs) for which in range(k)], axis=1
    )
    return {name: v.astype(np.float32).astype(np.float64) for name, v in inputs.items()}


def invert(accelerometer: Affine, force: Array) -> Array:
    """The readings (n, 3) of a specific force (n, 3)."""
    return np.asarray(force @ np.linalg.inv(accelerometer.matrix).T + accelerometer.bias)


def draw_attitudes(rng: np.random.Generator, n: int, largest_tilt_deg: float = 80.0) -> Array:
    """Roll, pitch, heading (n, 3) with down anywhere within the tilt, in the body's own axes."""
    z = rng.uniform(np.cos(np.radians(largest_tilt_deg)), 1.0, n)
    around = rng.uniform(0.0, 2 * np.pi, n)
    across = np.sqrt(1 - z**2)
    roll = np.degrees(np.arctan2(across * np.sin(around), z))
    pitch = np.degrees(np.arcsin(-across * np.cos(around)))
    return np.column_stack([roll, pitch, rng.uniform(0.0, 360.0, n)])


def _reading_sizes(plan: Plan) -> Array:
    """About what each magnetometer reads on an axis (k,), in its own unit."""
    gains = np.cbrt(np.abs(np.linalg.det([c.matrix for c in plan.calibrations])))
    return np.asarray(np.array(plan.magnitudes) / gains / np.sqrt(3))


def _raw(plan: Plan, which: int, direction_b: Array, inputs: dict[str, Array]) -> Array:
    """The readings that the calibration turns into that field."""
    calibration = plan.setup.compasses[which].calibration
    offset = correct_readings(plan, which, np.zeros((len(direction_b), 3)), inputs)
    matrix = plan.calibrations[which].matrix
    if changes_with_temperature(calibration):
        low, high = plan.polynomials[which].clamp_C
        matrix = evaluate_affine(
            calibration, np.clip(inputs["temperature_C"][:, which], low, high)
        )[1]
    wanted = plan.magnitudes[which] * direction_b - offset
    return np.asarray(np.linalg.solve(matrix, wanted[:, :, None])[:, :, 0])


def _temperatures(plan: Plan, n: int) -> dict[str, Array]:
    """Temperatures (n, k) over the range of each, two beyond, changing by 3 °C a minute."""
    rng = np.random.default_rng(1)  # of its own, so that other setups keep their readings
    low, high = plan.temperatures[:, 2:].T
    share = rng.uniform(0.0, 1.0, (n, len(low)))
    share[6:8] = [[-0.2], [1.2]]
    rate = rng.uniform(-0.05, 0.05, (n, len(low)))
    return {"temperature_C": low + share * (high - low), "temperature_rate_C_s": rate}


def _places(grid: float | DeclinationGrid, rng: np.random.Generator, n: int) -> dict[str, Array]:
    """Places all over the grid, close to its corners, and some beyond it."""
    if not isinstance(grid, DeclinationGrid):
        return {"latitude_deg": np.zeros(n), "longitude_deg": np.zeros(n)}
    rows, columns = grid.north.shape
    up, along = rng.uniform(0.0, 1.0, (2, n))
    up[:4], along[:4] = [1e-3, 1e-3, 0.999, 0.999], [1e-3, 0.999, 0.999, 1e-3]
    up[4:6] = [-0.1, 1.1]
    latitude = grid.south + up * (rows - 1) * grid.latitude_step
    longitude = grid.west + along * (columns - 1) * grid.longitude_step
    return {"latitude_deg": latitude, "longitude_deg": (longitude + 180.0) % 360.0 - 180.0}


def write_selftest(plan: Plan, name: str) -> str:
    """The text of the self-test."""
    given = make_known_readings(plan)
    expected = predict(plan, given)
    clear = np.flatnonzero(_find_clear(plan, given))
    lines = [_entry(plan, given, expected, int(row)) for row in clear]
    return fill_template(
        "selftest.c.in",
        {
            "name": name,
            "about": write_comment(write_about(plan)),
            "tolerance": write_literal(0.01),  # degrees
            "share": write_literal(1e-5),  # of the magnitude
            "tests": str(len(lines)),
            "table": "\n".join(lines),
        },
    )


def _find_clear(plan: Plan, given: dict[str, Array]) -> Mask:
    """Which rows no rounding decides: disturbances well off the limit, and off one another's."""
    count = len(plan.calibrations)
    distance = np.array([predict_one(plan, k, given).disturbance for k in range(count)])
    clear = (np.abs(distance - 1) > MIN_CLEARANCE).all(axis=0)
    for i, j in itertools.combinations(range(count), 2):
        share = distance[j] / np.maximum(CHOICE_SHARE * distance[i], 1e-12)
        clear &= (np.abs(share - 1) > MIN_CLEARANCE) | (distance[i] <= 1)
    return np.asarray(clear)


def _entry(plan: Plan, given: dict[str, Array], expected: Prediction, row: int) -> str:
    """One known reading, in the order of the structs."""
    tilt = {"angles": ("roll_deg", "pitch_deg"), "acceleration": ("acceleration",), "level": ()}
    sources = [MEMBERS.get(name, name) for name in plan.columns]
    names = ["raw", *tilt[plan.tilt], *sources, *(["temperature_C"] if plan.warm else [])]
    if isinstance(plan.declination, DeclinationGrid):
        names += ["latitude_deg", "longitude_deg"]
    values = ", ".join(_write_nested(given[name][row]) for name in names)
    outputs = (expected.magnitude, expected.compass_deg, expected.magnetic_deg, expected.true_deg)
    numbers = ", ".join(write_literal(float(column[row])) for column in outputs)
    return f"    {{{{{values}}}, {numbers}, {expected.used[row]}, {expected.status[row]}}},"


def _write_nested(value: Array) -> str:
    if value.ndim == 0:
        return write_literal(float(value))
    return "{" + ", ".join(map(_write_nested, value)) + "}"
