"""The C header of a calibration that changes with temperature: `write_c` writes it.

field = A(T) (raw − b(T) − rate dT/dt),   float32, each number a polynomial by Horner's rule
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.calibration.steps import find_magnitude
from agonic.exports.banner import format_float32, write_banner
from agonic.exports.convert import list_left_out, reduce
from agonic.exports.firmware.c_text import (
    fill_template,
    write_array,
    write_comment,
    write_flash,
)
from agonic.exports.polynomials import RATE, Polynomials, fit_polynomials

TESTS = 7
"""Known readings of the self-test, over the range of temperatures."""
FASTEST_C_S = 0.05  # of the known readings: 3 °C a minute


def make_thermal_header(calibration: Calibration, name: str) -> tuple[str, tuple[str, ...]]:
    """The text of the header, and warnings."""
    found = fit_polynomials(calibration)
    middle = calibration.at((found.low_C + found.high_C) / 2)  # type: ignore[attr-defined]
    reduce(middle)  # refuses what no header can hold
    rate = RATE in found.signals
    table = _table(found, rate)
    known, tolerance = _known(calibration, found, table)
    formula = (
        f"field = A (raw - b{' - rate dT/dt' if rate else ''}), float32, polynomials of order "
        f"{len(table) - 1} in x = (T - {found.centre_C:g}) / {found.half_range_C:g}, T in C; "
        f"beyond {found.clamp_C[0]:g} to {found.clamp_C[1]:g} C that of the nearest edge"
    )
    warnings = list_left_out(middle)
    text = fill_template(
        "headers/thermal.h.in",
        {
            "name": name,
            "GUARD": name.upper(),
            "about": write_comment(write_banner(calibration, formula, warnings)),
            "flash": write_flash(),
            "unit_in": calibration.unit_in,
            "unit_out": calibration.unit_out,
            "frame_in": calibration.frame_in,
            "powers": str(len(table)),
            "highest": str(len(table) - 1),
            "numbers": str(table.shape[1]),
            "table": write_array(table),
            "scale": write_array([found.centre_C, found.half_range_C]),
            "range": write_array(found.clamp_C),
            "tests": str(len(known)),
            "columns": str(known.shape[1]),
            "known": write_array(known, "    "),
            "tolerance": format_float32(tolerance),
            **_of_rate(calibration, rate),
        },
    )
    return text, warnings


def _of_rate(calibration: Calibration, rate: bool) -> dict[str, str]:
    """The pieces of the header that are there where the bias lags behind the temperature."""
    pieces = {
        "and_rate": f"; rate (3), {calibration.unit_in} per degree C a second",
        "minus_rate": " - rate dT/dt",
        "rate_words": ", and its\n   rate of change, degrees C a second",
        "rate_argument": ", float rate_C_s",
        "rate_term": " - value[12 + i] * rate_C_s",
        "rate_known": ", AGONIC_READ(known[k][4])",
        "rate_column": ", rate",
    }
    return pieces if rate else dict.fromkeys(pieces, "")


def _table(found: Polynomials, rate: bool) -> Array:
    """(p, 12) or with the rate (p, 15): a row a power, as the C holds it."""
    p = len(found.bias)
    columns = [found.bias, found.matrix.reshape(p, 9)]
    if rate:
        columns.append(found.coefficients[:, :, found.signals.index(RATE)])
    return np.concatenate(columns, axis=1)


def _known(calibration: Calibration, found: Polynomials, table: Array) -> tuple[Array, float]:
    """Readings, temperature, rate and field (n, 7 or 8) in double, and how far float32 may be off.

    The error of Horner's rule is below 2 p units in the last place of Σ|k_j||x|ʲ (Higham, Accuracy
    and Stability of Numerical Algorithms, 2002, section 5.1); seven roundings more lie on the way.
    """
    rng = np.random.default_rng(0)
    levels = np.linspace(found.low_C, found.high_C, TESTS).astype(np.float32).astype(np.float64)
    directions = rng.normal(size=(TESTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    x = (levels - found.centre_C) / found.half_range_C
    sizes = np.abs(x)[:, None] ** np.arange(len(table)) @ np.abs(table)
    values = x[:, None] ** np.arange(len(table)) @ table
    bias, matrix = values[:, :3], values[:, 3:12].reshape(-1, 3, 3)
    size = find_magnitude(calibration) or float(np.linalg.norm(matrix[0] @ bias[0])) or 1.0
    raw = np.linalg.solve(matrix, size * directions[:, :, None])[:, :, 0] + bias
    raw = raw.astype(np.float32).astype(np.float64)
    rates = FASTEST_C_S * rng.uniform(-1, 1, TESTS).astype(np.float32).astype(np.float64)
    columns = {
        name: np.zeros((TESTS, 3) if name == "second" else TESTS) for name in calibration.needs
    }
    columns |= {"temperature": levels} | ({RATE: rates} if RATE in found.signals else {})
    field = calibration.correct(raw, **columns)
    reach = np.abs(raw) + sizes[:, :3]
    largest = np.einsum("nij,nj->ni", sizes[:, 3:12].reshape(-1, 3, 3), reach).max()
    tolerance = (8 + 2 * len(table)) * np.finfo(np.float32).eps * largest
    beside = [levels[:, None], *([rates[:, None]] if RATE in found.signals else [])]
    return np.concatenate([raw, *beside, field], axis=1), float(f"{tolerance:.1g}")
