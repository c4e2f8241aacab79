"""A CSV table of a calibration's numbers with their standard errors, for people and papers."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.errors import LogError
from agonic.io.atomic import write_atomically
from agonic.io.calfile import read_bytes
from agonic.io.export import Export, banner, left_out, reduced
from agonic.kernels.affine import join, model_basis, split

COLUMNS = ("parameter", "value", "standard_error", "unit")
NAMES = (*(f"bias_{i}" for i in "xyz"), *(f"matrix_{i}{j}" for i in "xyz" for j in "xyz"))


def write_table(calibration: Calibration, path: Path | str) -> Export:
    """Write the twelve numbers of field = matrix @ (raw − bias), a row each, below # comments.

    Standard errors are left empty where the calibration carries none; entries that its gauge fixes
    have none to carry.

    >>> from tempfile import TemporaryDirectory
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_table(mag, folder + "/mag.csv")
    ...     parse_table(export.path)["bias_x"]
    (3000.0, None, 'nT')
    """
    bias, matrix = reduced(calibration)
    units = (calibration.unit_in,) * 3 + (f"{calibration.unit_out}/{calibration.unit_in}",) * 9
    warnings = left_out(calibration)
    stream = StringIO()
    stream.writelines(f"# {line}\n" for line in banner(calibration, "one number a row", warnings))
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(COLUMNS)
    table.writerows(
        zip(NAMES, join(bias, matrix).tolist(), _errors(calibration), units, strict=True)
    )
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
    parameters: Mapping[str, tuple[float, float | None, str]], raw: ArrayLike
) -> NDArray[np.float64]:
    """The field (…, 3) of readings, in the units of the table."""
    bias, matrix = split(np.array([parameters[name][0] for name in NAMES]))
    return np.asarray((np.asarray(raw) - bias) @ matrix.T)


def _errors(calibration: Calibration) -> list[float | None]:
    """Standard errors of the twelve numbers, from the nine that a fit estimates."""
    if not isinstance(calibration, Affine) or calibration.covariance is None:
        return [None] * len(NAMES)
    basis = model_basis("full", calibration.gauge)
    m = basis.shape[1]
    variance = np.einsum("ij,jk,ik->i", basis, calibration.covariance[:m, :m], basis)
    return [
        float(np.sqrt(v)) if row.any() else None for v, row in zip(variance, basis, strict=True)
    ]
