"""What the page's sphere is drawn from: points, cells, and both in words."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.equation.coverage import icosphere
from agonic.maths.one_pass import find_length, median
from agonic.recording.calibrated import Calibrated
from agonic.recording.residuals import Residuals, find_level

MOST_POINTS = 50_000
"""Points that a report holds, over all its sensors; more are thinned evenly."""

_REACH = 4.0  # in radii: what lies farther is drawn there, so that one stray costs no resolution
_STEPS = 32767  # of an int16


def list_corners() -> list[float]:
    """The corners of the 80 cells, nine numbers a cell."""
    return [float(v) for v in icosphere()[1].round(4).ravel()]


def pack_sphere(result: Calibrated, residuals: Residuals, most: int) -> dict[str, Any]:
    """All that the page's script needs to draw one sensor.

    Points are raw − bias as base64 int16 in `step`s of raw units; `matrix` turns them into the
    field, `bias` back into readings. Magnitudes are coloured up to the relative `deviation` from
    `levelRaw` before and `level` after; `counts` and `means` (null where few) are per cell.
    """
    calibration = result.fit.calibration
    centred = (result.cleaned - calibration.bias)[thin(len(result.samples), most)]
    radius = median(find_length(centred)) or 1.0
    middle, extent = find_middle(centred)
    points, step = _quantise(centred, radius)
    return {
        "points": base64.b64encode(points.tobytes()).decode(),
        "step": step,
        "radius": extent,
        "middle": middle.tolist(),
        "bias": calibration.bias.tolist(),
        "matrix": calibration.matrix.ravel().tolist(),
        "levelRaw": float(np.mean(np.linalg.norm(centred + calibration.bias, axis=1))),
        "level": find_level(result),
        "deviation": find_deviation_limit(result),
        "counts": result.fit.coverage.cells.tolist(),
        "means": [None if np.isnan(m) else float(m) for m in residuals.means],
        "meanLimit": residuals.mean_limit,
    }


def find_middle(centred: Array) -> tuple[Array, float]:
    """Where the cloud of readings is shown about, (3,) from the bias, and how far it reaches.

    About the bias, or where that lies outside the cloud, as of a refused fit, about its middle.
    """
    middle = np.median(centred, axis=0)
    reach = float(np.percentile(np.linalg.norm(centred - middle, axis=1), 90)) or 1.0
    if float(np.linalg.norm(middle)) > 1.5 * reach:
        return middle, reach
    return np.zeros(3), median(find_length(centred)) or 1.0


def thin(n: int, most: int) -> NDArray[np.int64]:
    """Rows that are shown: all, or `most` of them evenly."""
    return np.linspace(0, n, min(n, most), endpoint=False).astype(np.int64)


def find_deviation_limit(result: Calibrated) -> float:
    """The relative deviation of the magnitude at which colour is full, to one digit.

    It covers 98 % of the readings before the correction, and is the same before and after.
    """
    magnitude = result.verification.magnitude_before
    relative = np.abs(magnitude / max(float(magnitude.mean()), np.finfo(float).tiny) - 1.0)
    reach = max(float(np.percentile(relative, 98)), 1e-4)
    power = 10.0 ** np.floor(np.log10(reach))
    return float(np.ceil(reach / power) * power)


def describe_coverage(result: Calibrated) -> str:
    """How many of the 80 cells were visited."""
    cells = result.fit.coverage.cells
    visited = int(np.count_nonzero(cells))
    return f"{visited} of {len(cells)} directions were visited"


def _quantise(centred: Array, radius: float) -> tuple[NDArray[np.int16], float]:
    size = np.linalg.norm(centred, axis=1, keepdims=True)
    inside = centred * np.minimum(1.0, _REACH * radius / np.maximum(size, radius))
    step = max(float(np.abs(inside).max()), radius) / _STEPS
    return np.round(inside / step).astype("<i2"), step
