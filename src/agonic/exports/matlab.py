"""MATLAB: a `.mat` file with the variables of `magcal`.

    C = (D − b) * A   on rows,   in the unit of the calibration,   so A is the matrix transposed

Where it changes with temperature, A and b are those of `temperature_C`, and beside them stand

    A(T) = Σ A_T(:,:,k) xᵏ⁻¹,   b(T) = Σ b_T(k,:) xᵏ⁻¹,   x = (T − centre_C) / half_range_C

Source: MathWorks, `magcal` (Sensor Fusion and Tracking Toolbox).
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.steps import find_magnitude
from agonic.exports.banner import write_banner
from agonic.exports.convert import Export, hold_sources, reduce
from agonic.exports.temperature import (
    RATE,
    changes_with_temperature,
    find_range_C,
    fit_polynomials,
    hold_temperature,
)

HEADER_BYTES = 116  # bytes of free text at the start of a MAT-file, version 5
FORMULA = "C = (D - b) * A, a reading a row"
OVER_TEMPERATURE = (
    f"{FORMULA}, at temperature_C; at others b = sum of b_T(k,:) x^(k-1) + rate dT/dt, A = sum of "
    "A_T(:,:,k) x^(k-1), x = (T - centre_C) / half_range_C"
)
WARM = ("A_T", "b_T", "rate", "centre_C", "half_range_C", "range_C", "temperature_C")


def write_matlab(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write `A`, `b` and `expmfs` as MATLAB's `magcal` returns them, with units and origin.

    Parameters: `calibration`; `path` of the file; `temperature_C`. The numbers are in the units of
    the calibration, nT or raw; `about` holds the rest in words. One that changes with temperature
    is held at `temperature_C`, default the middle of its range, and its polynomials are written
    beside that.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> from scipy.io import loadmat
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_matlab(mag, folder + "/mag.mat")
    ...     loadmat(export.path)["b"]
    array([[3000.,    0.,    0.]])
    """
    warm: dict[str, Any] = {}
    if changes_with_temperature(calibration):
        if temperature_C is None:
            temperature_C = float(np.mean(find_range_C(calibration)))
        warm = _over_temperature(calibration) | {"temperature_C": temperature_C}
    one, _ = hold_temperature(calibration, temperature_C)
    one, held = hold_sources(one)
    bias, matrix = reduce(one)
    magnitude = find_magnitude(calibration)
    unknown = "the field magnitude is not known: expmfs is NaN"
    warnings = (*held, *((unknown,) if magnitude is None else ()))
    variables = {
        **warm,
        "A": matrix.T,
        "b": bias[np.newaxis],
        "expmfs": np.nan if magnitude is None else magnitude,
        "unit_in": calibration.unit_in,
        "unit_out": calibration.unit_out,
        "about": "\n".join(
            write_banner(calibration, OVER_TEMPERATURE if warm else FORMULA, warnings)
        ),
    }
    stream, text = BytesIO(), f"MATLAB 5.0 MAT-file, magnetometer calibration, {FORMULA}"
    savemat(stream, variables)  # type: ignore[arg-type]  # the stubs know names only
    # the free text at its head would hold the time of writing
    written = write_atomically(
        path, text.encode("ascii").ljust(HEADER_BYTES) + stream.getvalue()[HEADER_BYTES:]
    )
    return Export(path=written, target="matlab", warnings=warnings)


def _over_temperature(calibration: Calibration) -> dict[str, Array | float]:
    """The polynomials, with the power in the last index of the matrices."""
    found = fit_polynomials(calibration)
    lagging = RATE in found.signals
    rate = found.coefficients[0, :, found.signals.index(RATE)] if lagging else np.zeros(3)
    return {
        "A_T": found.matrix.transpose(2, 1, 0),
        "b_T": found.bias,
        "rate": rate[np.newaxis],
        "centre_C": found.centre_C,
        "half_range_C": found.half_range_C,
        "range_C": np.array([[found.low_C, found.high_C]]),
    }
