"""A CSV table of a calibration's numbers with their standard errors, for people and papers."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.thermal import Thermal
from agonic.errors import LogError
from agonic.exports.convert import Export, banner, left_out, reduced
from agonic.exports.fixed_temperature import held
from agonic.exports.polynomials import RATE, changes, polynomials
from agonic.logs.contents import read_bytes
from agonic.maths.equation.affine import join, model_basis, split

COLUMNS = ("parameter", "value", "standard_error", "unit")
Row = tuple[str, float, float | None, str]
NAMES = (*(f"bias_{i}" for i in "xyz"), *(f"matrix_{i}{j}" for i in "xyz" for j in "xyz"))


def write_table(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write the twelve numbers of field = matrix @ (raw − bias), a row each, below # comments.

    Of one that changes with temperature each number is a polynomial, with a row for each power
    (`bias_x_0`, `bias_x_1`, …); or with `temperature_C` it is held there.

    Standard errors are left empty where the calibration carries none; entries that its gauge fixes
    have none to carry.

    >>> from tempfile import TemporaryDirectory
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_table(mag, folder + "/mag.csv")
    ...     parse_table(export.path)["bias_x"]
    (3000.0, None, 'nT')
    """
    formula = "one number a row"
    if changes(calibration) and temperature_C is None:
        rows, warnings = _over_temperature(calibration)
        formula += ", the coefficient of the power at its end of x = (T - centre) / half_range"
    else:
        one, lost = held(calibration, temperature_C)
        rows, warnings = _plain(one), (*lost, *left_out(one))
    stream = StringIO()
    stream.writelines(f"# {line}\n" for line in banner(calibration, formula, warnings))
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(COLUMNS)
    table.writerows(rows)
    return Export(path=write_atomically(path, stream.getvalue()), target="table", warnings=warnings)


def parse_table(path: Path | str) -> dict[str, tuple[float, float | None, str]]:
    """Value, standard error (None where empty) and unit of each parameter of a table."""
    lines = read_bytes(path).decode(errors="replace").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    try:
        return {
            row["parameter"]: (
                float(row["value"]),
                float(row["standard_error"]) if row["standard_error"] else None,
                row["unit"],
            )
            for row in rows
        }
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(f"not a table of {', '.join(COLUMNS)} ({error})", path=path) from None


def apply_table(
    parameters: Mapping[str, tuple[float, float | None, str]],
    raw: ArrayLike,
    *,
    temperature_C: ArrayLike | None = None,
    rate_C_s: ArrayLike = 0.0,
) -> Array:
    """The field (…, 3) of readings, in the units of the table."""
    if temperature_C is None:
        bias, matrix = split(np.array([parameters[name][0] for name in NAMES]))
        return np.asarray((np.asarray(raw) - bias) @ matrix.T)
    order = max(int(name.rsplit("_", 1)[1]) for name in parameters if name.startswith("bias_x_"))
    terms = [[parameters[f"{name}_{k}"][0] for name in NAMES] for k in range(order + 1)]
    x = (np.asarray(temperature_C) - parameters["centre"][0]) / parameters["half_range"][0]
    values = x[..., None] ** np.arange(order + 1) @ np.array(terms)
    rate = [parameters.get(f"rate_{axis}", (0.0,))[0] for axis in "xyz"]
    left = np.asarray(raw) - values[..., :3] - np.asarray(rate_C_s)[..., None] * rate
    matrix = values[..., 3:].reshape(*x.shape, 3, 3)
    return np.asarray(np.einsum("...ij,...j->...i", matrix, left))


def _plain(calibration: Calibration) -> list[Row]:
    """The twelve numbers."""
    bias, matrix = reduced(calibration)
    numbers = join(bias, matrix).tolist()
    return list(zip(NAMES, numbers, _errors(calibration), _units(calibration), strict=True))


def _over_temperature(calibration: Calibration) -> tuple[list[Row], tuple[str, ...]]:
    """The coefficients of the twelve polynomials, their scale and range, and the rates."""
    found = polynomials(calibration)
    middle = calibration.at((found.low_C + found.high_C) / 2)  # type: ignore[attr-defined]
    reduced(middle)  # refuses a mix of two magnetometers
    units = _units(calibration)
    p = len(found.bias)
    numbers = np.concatenate([found.bias, found.matrix.reshape(p, 9)], axis=1)
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
    return rows, left_out(middle)


def _units(calibration: Calibration) -> tuple[str, ...]:
    return (calibration.unit_in,) * 3 + (f"{calibration.unit_out}/{calibration.unit_in}",) * 9


def _errors(calibration: Calibration) -> list[float | None]:
    """Standard errors of the twelve numbers, from the nine that a fit estimates."""
    if not isinstance(calibration, Affine) or calibration.covariance is None:
        return [None] * len(NAMES)
    return _spread(calibration.covariance, calibration.gauge)


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
