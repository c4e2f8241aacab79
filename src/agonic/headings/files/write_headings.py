"""`write_headings`: headings as a CSV table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.exports.csv import write_table
from agonic.headings.result import Heading


def write_headings(found: Heading, file: Path) -> Path:
    """Write a row a reading; a number that there is not is left empty."""
    time, n = found.time, len(found)
    table = {
        "time_s": [""] * n if time is None else [repr(t) for t in time.tolist()],
        "compass_deg": _format_angles(found.compass_deg),
        "magnetic_deg": _format_angles(found.magnetic_deg),
        "true_deg": _format_angles(found.true_deg),
        "sd_deg": _format(found.sd_deg, n),
        "tilt_sd_deg": _format(found.tilt_sd_deg, n),
        "disagreement_deg": _format(found.disagreement_deg, n),
        "sensor": [found.sensors[k] for k in found.used.tolist()],
        "flags": found.flag_names(),
    }
    return write_table(table, file)


def _format(values: Array | None, n: int) -> list[str]:
    if values is None:
        return [""] * n
    return ["" if np.isnan(value) else f"{value:.3f}" for value in values.tolist()]


def _format_angles(values: Array) -> list[str]:
    """Angles from 0 to less than 360°, which rounding must not make 360."""
    return _format(np.round(values, 3) % 360.0, len(values))
