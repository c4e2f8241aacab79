"""C: a header with the numbers, the correction as nine multiplications, and a self-test.

    field = A (raw − b),   float32

in the units and axes of the calibration, with a mounting in a chain inside the matrix. Where it
changes with temperature, b and A are polynomials of it; beyond the range the temperature of the
nearest edge counts, since a cubic runs away there, and the function says so:

    field = A(T) (raw − b(T) − rate dT/dt),   float32, each number a polynomial by Horner's rule
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.network import Network
from agonic.calibration.steps import find_magnitude, find_step
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import Export, hold_sources, list_left_out, reduce
from agonic.exports.firmware import c_text as c
from agonic.exports.temperature import (
    RATE,
    Polynomials,
    changes_with_temperature,
    fit_polynomials,
    hold_temperature,
    require_temperature,
)

READINGS = 7
"""Known readings of the self-test, over the range of temperatures."""


def make_thermal_header(calibration: Calibration, name: str) -> tuple[str, tuple[str, ...]]:
    """The text of the header, and warnings."""
    found = fit_polynomials(calibration)
    middle = calibration.at((found.low_C + found.high_C) / 2)  # type: ignore[attr-defined]
    reduce(middle)  # refuses what no header can hold
    rate = RATE in found.signals
    table = found.table[:, :12]
    if rate:
        table = np.hstack([table, found.coefficients[:, :, found.signals.index(RATE)]])
    known, tolerance = _known(calibration, found, table)
    formula = (
        f"field = A (raw - b{' - rate dT/dt' if rate else ''}), float32, polynomials of order "
        f"{len(table) - 1} in x = (T - {found.centre_C:g}) / {found.half_range_C:g}, T in C; "
        f"beyond {found.clamp_C[0]:g} to {found.clamp_C[1]:g} C that of the nearest edge"
    )
    warnings = list_left_out(middle)
    values = {
        **_describe(calibration, name, formula, warnings),
        "powers": len(table),
        "highest": len(table) - 1,
        "numbers": table.shape[1],
        "table": table,
        "scale": [found.centre_C, found.half_range_C],
        "range": found.clamp_C,
        "tests": len(known),
        "columns": known.shape[1],
        "known": c.write_array(known, "    "),
        "tolerance": format_float32(tolerance),
        "rate": rate,
    }
    return c.fill_template("headers/thermal.h.in", values), warnings


def _known(calibration: Calibration, found: Polynomials, table: Array) -> tuple[Array, float]:
    """Readings, temperature, rate and field (n, 7 or 8) in double, and how far float32 may be off.

    The error of Horner's rule is below 2 p units in the last place of Σ|k_j||x|ʲ (Higham, Accuracy
    and Stability of Numerical Algorithms, 2002, section 5.1); seven roundings more lie on the way.
    """
    rng = np.random.default_rng(0)
    levels = np.linspace(found.low_C, found.high_C, READINGS).astype(np.float32).astype(np.float64)
    directions = rng.normal(size=(READINGS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x = (levels - found.centre_C) / found.half_range_C
    sizes = np.abs(x)[:, None] ** np.arange(len(table)) @ np.abs(table)
    values = x[:, None] ** np.arange(len(table)) @ table
    bias, matrix = values[:, :3], values[:, 3:12].reshape(-1, 3, 3)
    size = find_magnitude(calibration) or float(np.linalg.norm(matrix[0] @ bias[0])) or 1.0
    raw = np.linalg.solve(matrix, size * directions[:, :, None])[:, :, 0] + bias
    raw = raw.astype(np.float32).astype(np.float64)
    rates = 0.05 * rng.uniform(-1, 1, READINGS).astype(np.float32).astype(np.float64)  # °C/s
    columns = {
        name: np.zeros((READINGS, 3) if name == "second" else READINGS)
        for name in calibration.needs
    }
    columns |= {"temperature": levels} | ({RATE: rates} if RATE in found.signals else {})
    field = calibration.correct(raw, **columns)
    reach = np.abs(raw) + sizes[:, :3]
    largest = np.einsum("nij,nj->ni", sizes[:, 3:12].reshape(-1, 3, 3), reach).max()
    tolerance = (8 + 2 * len(table)) * np.finfo(np.float32).eps * largest
    beside = [levels[:, None], *([rates[:, None]] if RATE in found.signals else [])]
    return np.concatenate([raw, *beside, field], axis=1), float(f"{tolerance:.1g}")


def write_c(
    calibration: Calibration,
    path: Path | str,
    *,
    name: str | None = None,
    temperature_C: float | None = None,
) -> Export:
    """Write a C header (C99 and C++) with `{name}_b`, `_A`, `_correct` and `_self_test`.

    Parameters: `calibration`; `path` of the header; `name`, with which its identifiers begin,
    by default that of the sensor; `temperature_C`.

    A calibration that changes with temperature becomes polynomials, and `_correct` takes the
    temperature; or with `temperature_C` it is held there. A network keeps its base and its domain:
    `_correct` takes what it needs beside the reading, and returns 0 far from its training.

    Raises `AgonicError` where `name` is not a C identifier.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_c(mag, folder + "/mag.h")
    ...     [row for row in export.path.read_text().split("\\n") if "mag_b[3]" in row]
    ['static const float mag_b[3] = {3000.0f, 0.0f, 0.0f};']
    """
    name = c.make_c_name(calibration.sensor) if name is None else c.require_identifier(name)
    if find_step(calibration, Network) is not None:
        from agonic.exports.c_network.header import make_network_header

        if temperature_C is not None:
            require_temperature("temperature" in calibration.needs, calibration)
            calibration = calibration.at(temperature_C)  # type: ignore[attr-defined]
        text, warnings = make_network_header(calibration, name)
    elif changes_with_temperature(calibration) and temperature_C is None:
        text, warnings = make_thermal_header(calibration, name)
    else:
        text, warnings = _make_affine_header(calibration, name, temperature_C)
    return Export(path=write_atomically(path, text), target="c", warnings=warnings)


def _make_affine_header(
    calibration: Calibration, name: str, temperature_C: float | None
) -> tuple[str, tuple[str, ...]]:
    """The text of the header, and warnings."""
    one, lost = hold_temperature(calibration, temperature_C)
    one, held = hold_sources(one)
    bias, matrix = reduce(one)
    raw, expected, tolerance = _example(one, bias, matrix)
    formula, warnings = "field = A (raw - b), float32", (*lost, *held)
    values = {
        **_describe(calibration, name, formula, warnings),
        "b": bias,
        "A": matrix,
        "known": [*raw, *expected],
        "tolerance": format_float32(tolerance),
    }
    return c.fill_template("headers/affine.h.in", values), warnings


def _describe(
    calibration: Calibration, name: str, formula: str, warnings: tuple[str, ...]
) -> dict[str, str]:
    """What every header says of its calibration."""
    return {
        "name": name,
        "about": c.write_comment(write_banner(calibration, formula, warnings)),
        "unit_in": calibration.unit_in,
        "unit_out": calibration.unit_out,
        "frame_in": calibration.frame_in,
    }


def _example(calibration: Calibration, bias: Array, matrix: Array) -> tuple[Array, Array, float]:
    """A reading, its field, and how far float32 may be off. Seven roundings lie on the way (bias,
    matrix, difference, product, two sums, expected value), each of half a unit in the last place of
    numbers no larger than |matrix| (|raw| + |bias|); a little over twice that is allowed."""
    size = find_magnitude(calibration) or float(np.linalg.norm(matrix @ bias)) or 1.0
    field = size * np.array([0.48, -0.6, 0.64])
    raw = (np.linalg.solve(matrix, field) + bias).astype(np.float32).astype(np.float64)
    largest = (np.abs(matrix) @ (np.abs(raw) + np.abs(bias))).max()
    tolerance = 8 * np.finfo(np.float32).eps * largest
    return raw, matrix @ (raw - bias), float(f"{tolerance:.1g}")
