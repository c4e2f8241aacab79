"""MR: the twelve numbers of a compass system, multiplied out.

    field_i = MR_i0 + MR_i1 raw_x + MR_i2 raw_y + MR_i3 raw_z,   i = 1, 2, 3 for x, y, z

Each with its standard error; MR_i0 is −matrix @ bias. A table for people and for controllers whose
firmware has this form.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.composed_covariance import compute_composed_covariance
from agonic.exports.banner import write_banner
from agonic.exports.convert import Export, hold_sources, reduce
from agonic.exports.fixed_temperature import hold_temperature
from agonic.exports.table import format_rows

NAMES = tuple(f"MR{i}{j}" for i in (1, 2, 3) for j in (0, 1, 2, 3))


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
    rows = zip(NAMES, numbers.tolist(), errors, units, strict=True)
    text = format_rows(write_banner(calibration, formula, warnings), rows)
    return Export(path=write_atomically(path, text), target="mr", warnings=warnings)


def _find_errors(calibration: Calibration, bias: Array, matrix: Array) -> list[float | None]:
    """Standard errors of the twelve numbers, in the order of `NAMES`."""
    covariance = compute_composed_covariance(calibration)
    if covariance is None:
        return [None] * len(NAMES)
    slope = np.zeros((12, 12))
    for i in range(3):
        slope[4 * i, :3] = -matrix[i]
        slope[4 * i, 3 + 3 * i : 6 + 3 * i] = -bias
        slope[4 * i + 1 : 4 * i + 4, 3 + 3 * i : 6 + 3 * i] = np.eye(3)
    spread = np.sqrt(np.diag(slope @ covariance @ slope.T))
    return [float(sd) if sd > 0 else None for sd in spread]
