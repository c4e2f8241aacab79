"""MATLAB: a `.mat` file with the variables of `magcal`.

    C = (D − b) * A   on rows,   in the unit of the calibration,   so A is the matrix transposed

Source: MathWorks, `magcal` (Sensor Fusion and Tracking Toolbox).
"""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.io import loadmat, savemat
from scipy.io.matlab import MatReadError

from agonic.calibration.base import Calibration
from agonic.errors import LogError
from agonic.io.atomic import write_atomically
from agonic.io.calfile import read_bytes
from agonic.io.export import Export, banner, left_out, reduced, scaled_to

HEADER = 116  # bytes of free text at the start of a MAT-file, version 5
FORMULA = "C = (D - b) * A, a reading a row"


def write_matlab(calibration: Calibration, path: Path | str) -> Export:
    """Write `A`, `b` and `expmfs` as MATLAB's `magcal` returns them, with units and origin.

    The numbers are in the units of the calibration, nT or raw; `about` holds the rest in words.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_matlab(mag, folder + "/mag.mat")
    ...     parse_matlab(export.path)["b"]
    array([[3000.,    0.,    0.]])
    """
    bias, matrix = reduced(calibration)
    magnitude = scaled_to(calibration)
    unknown = "the field magnitude is not known: expmfs is NaN"
    warnings = (*left_out(calibration), *((unknown,) if magnitude is None else ()))
    variables = {
        "A": matrix.T,
        "b": bias[np.newaxis],
        "expmfs": np.nan if magnitude is None else magnitude,
        "unit_in": calibration.unit_in,
        "unit_out": calibration.unit_out,
        "about": "\n".join(banner(calibration, FORMULA, warnings)),
    }
    written = write_atomically(path, _without_clock(variables))
    return Export(path=written, target="matlab", warnings=warnings)


def parse_matlab(path: Path | str) -> dict[str, NDArray[np.float64]]:
    """`A` (3, 3), `b` (1, 3) and `expmfs` (1, 1) of a file."""
    data = read_bytes(path)
    try:
        held = loadmat(BytesIO(data), variable_names=["A", "b", "expmfs"])  # type: ignore[arg-type]
        return {name: np.asarray(held[name], dtype=float) for name in ("A", "b", "expmfs")}
    except (MatReadError, NotImplementedError, KeyError, TypeError, ValueError) as error:
        raise LogError(f"not a MAT-file with A, b and expmfs ({error})", path=path) from None


def apply_matlab(variables: Mapping[str, Any], raw: ArrayLike) -> NDArray[np.float64]:
    """The field that MATLAB makes of readings (n, 3), (D − b) * A."""
    return np.asarray((np.asarray(raw) - variables["b"]) @ variables["A"])


def _without_clock(variables: Mapping[str, Any]) -> bytes:
    """The bytes of a MAT-file whose free text does not hold the time of writing."""
    stream = BytesIO()
    savemat(stream, dict(variables))  # type: ignore[arg-type]  # the stubs know names only
    text = f"MATLAB 5.0 MAT-file, magnetometer calibration, {FORMULA}"
    return text.encode("ascii").ljust(HEADER) + stream.getvalue()[HEADER:]
