"""A CSV table of a calibration's numbers with their standard errors, for people and papers.

MR: the twelve numbers of a compass system, multiplied out.

    field_i = MR_i0 + MR_i1 raw_x + MR_i2 raw_y + MR_i3 raw_z,   i = 1, 2, 3 for x, y, z

Each with its standard error; MR_i0 is −matrix @ bias. A table for people and for controllers whose
firmware has this form.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.steps import compute_composed_covariance
from agonic.calibration.thermal import Thermal
from agonic.exports.banner import write_banner
from agonic.exports.convert import Export, hold_sources, list_left_out, reduce, write_rows
from agonic.exports.temperature import (
    RATE,
    changes_with_temperature,
    fit_polynomials,
    hold_temperature,
)
from agonic.maths.equation.affine import join, model_basis

COLUMNS = ("parameter", "value", "standard_error", "unit")
Row = tuple[str, float, float | None, str]
NAMES = (*(f"bias_{i}" for i in "xyz"), *(f"matrix_{i}{j}" for i in "xyz" for j in "xyz"))


def write_table(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write the twelve numbers of field = matrix @ (raw − bias), a row each, below # comments.

    Parameters: `calibration`; `path` of the file; `temperature_C`. Of one that changes with
    temperature each number is a polynomial, with a row for each power (`bias_x_0`, `bias_x_1`, …);
    or with `temperature_C` it is held there.

    Standard errors are left empty where the calibration carries none; entries that its gauge fixes
    have none to carry.

    >>> from tempfile import TemporaryDirectory
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_table(mag, folder + "/mag.csv")
    ...     [row for row in export.path.read_text().split() if row.startswith("bias_x")]
    ['bias_x,3000.0,,nT']
    """
    formula = "one number a row"
    if changes_with_temperature(calibration) and temperature_C is None:
        rows, warnings = _over_temperature(calibration)
        formula += ", the coefficient of the power at its end of x = (T - centre) / half_range"
    else:
        one, lost = hold_temperature(calibration, temperature_C)
        one, held = hold_sources(one)
        rows, warnings = _plain(one), (*lost, *held)
    return _write("table", path, write_banner(calibration, formula, warnings), rows, warnings)


def _write(
    target: str,
    path: Path | str,
    banner: Iterable[str],
    rows: Iterable[Row],
    warnings: tuple[str, ...],
) -> Export:
    """Numbers with their standard errors and units as CSV, below lines of # comments."""
    lines = (",".join("" if one is None else str(one) for one in row) for row in (COLUMNS, *rows))
    return write_rows(target, path, banner, lines, warnings)


def _plain(calibration: Calibration) -> list[Row]:
    """The twelve numbers."""
    bias, matrix = reduce(calibration)
    numbers = join(bias, matrix).tolist()
    return list(zip(NAMES, numbers, _errors(calibration), _units(calibration), strict=True))


def _over_temperature(calibration: Calibration) -> tuple[list[Row], tuple[str, ...]]:
    """The coefficients of the twelve polynomials, their scale and range, and the rates."""
    found = fit_polynomials(calibration)
    middle = calibration.at((found.low_C + found.high_C) / 2)  # type: ignore[attr-defined]
    reduce(middle)  # refuses a mix of two magnetometers
    units = _units(calibration)
    p, numbers = len(found.bias), found.table
    errors, of_rate = _errors_of_powers(calibration, p)
    rows: list[Row] = [
        (f"{name}_{k}", float(numbers[k, j]), errors[k][j], units[j])
        for j, name in enumerate(NAMES)
        for k in range(p)
    ]
    if RATE in found.signals:
        rates = found.coefficients[0, :, found.signals.index(RATE)].tolist()
        rows += [
            (f"rate_{axis}", value, error, f"{calibration.unit_in}/(C/s)")
            for axis, value, error in zip("xyz", rates, of_rate, strict=True)
        ]
    scale = {
        "centre": found.centre_C,
        "half_range": found.half_range_C,
        "lowest": found.low_C,
        "highest": found.high_C,
    }
    rows += [(name, float(value), None, "C") for name, value in scale.items()]
    return rows, list_left_out(middle)


def _units(calibration: Calibration) -> tuple[str, ...]:
    return (calibration.unit_in,) * 3 + (f"{calibration.unit_out}/{calibration.unit_in}",) * 9


def _errors(calibration: Calibration) -> list[float | None]:
    """Standard errors of the twelve numbers, from the nine that a fit estimates; of all steps."""
    if isinstance(calibration, Affine) and calibration.covariance is not None:
        return _spread(calibration.covariance, calibration.gauge)
    covariance = compute_composed_covariance(calibration)
    if covariance is None:
        return [None] * len(NAMES)
    return [float(sd) for sd in np.sqrt(np.diag(covariance))]


def _errors_of_powers(
    calibration: Calibration, p: int
) -> tuple[list[list[float | None]], list[float | None]]:
    """Standard errors of the coefficients, a list a power, and of the rates."""
    if not isinstance(calibration, Thermal) or calibration.covariance is None:
        return [[None] * len(NAMES)] * p, [None] * 3
    q, sd = calibration.degree + 1, np.sqrt(np.diag(calibration.covariance))
    m = model_basis("full", calibration.gauge).shape[1]
    by_power = [
        _spread(calibration.covariance[k : m * q : q, k : m * q : q], calibration.gauge)
        for k in range(q)
    ]
    return by_power[:p], sd[m * q :].tolist() or [None] * 3


def _spread(covariance: Array, gauge: str) -> list[float | None]:
    """Standard errors of the twelve numbers; of those that the gauge fixes, none."""
    basis = model_basis("full", gauge)
    m = basis.shape[1]
    variance = np.einsum("ij,jk,ik->i", basis, covariance[:m, :m], basis)
    return [
        float(np.sqrt(v)) if row.any() else None for v, row in zip(variance, basis, strict=True)
    ]


MR_NAMES = tuple(f"MR{i}{j}" for i in (1, 2, 3) for j in (0, 1, 2, 3))


def write_mr(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write MR10 … MR33, a row each, below # comments.

        MR_i0 = −Σ_j matrix_ij bias_j,   MR_ij = matrix_ij

    Parameters: `calibration`, an affine one or a chain of them with mountings; `path` of the file;
    `temperature_C`, where a calibration is held that changes with temperature.

    Standard errors are left empty where a step carries none.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_mr(mag, folder + "/mag.csv")
    ...     [row for row in export.path.read_text().split() if row.startswith("MR1")]
    ['MR10,-3000.0,,nT', 'MR11,1.0,,nT/nT', 'MR12,0.0,,nT/nT', 'MR13,0.0,,nT/nT']
    """
    one, lost = hold_temperature(calibration, temperature_C)
    one, held = hold_sources(one)
    warnings = (*lost, *held)
    bias, matrix = reduce(one)
    numbers = np.concatenate([-(matrix @ bias)[:, None], matrix], axis=1).ravel() + 0.0
    errors = _find_errors(one, bias, matrix)
    units = (one.unit_out, *(f"{one.unit_out}/{one.unit_in}",) * 3) * 3
    formula = "field_i = MR_i0 + MR_i1 raw_x + MR_i2 raw_y + MR_i3 raw_z"
    rows = zip(MR_NAMES, numbers.tolist(), errors, units, strict=True)
    return _write("mr", path, write_banner(calibration, formula, warnings), rows, warnings)


def _find_errors(calibration: Calibration, bias: Array, matrix: Array) -> list[float | None]:
    """Standard errors of the twelve numbers, in the order of `MR_NAMES`."""
    covariance = compute_composed_covariance(calibration)
    if covariance is None:
        return [None] * len(MR_NAMES)
    slope = np.zeros((12, 12))
    for i in range(3):
        slope[4 * i, :3] = -matrix[i]
        slope[4 * i, 3 + 3 * i : 6 + 3 * i] = -bias
        slope[4 * i + 1 : 4 * i + 4, 3 + 3 * i : 6 + 3 * i] = np.eye(3)
    spread = np.sqrt(np.diag(slope @ covariance @ slope.T))
    return [float(sd) if sd > 0 else None for sd in spread]
