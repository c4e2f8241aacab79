"""`write_headings`: headings as a CSV table."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.headings.result import Heading

COLUMNS = (
    "time_s",
    "compass_deg",
    "magnetic_deg",
    "true_deg",
    "sd_deg",
    "tilt_sd_deg",
    "disagreement_deg",
    "sensor",
    "flags",
)
"""Of the table that is written."""


def write_headings(found: Heading, file: Path) -> Path:
    """Write a row a reading; a number that there is not is left empty."""
    time = found.time
    columns = (
        [""] * len(found) if time is None else [repr(t) for t in time.tolist()],
        _format_angles(found.compass_deg),
        _format_angles(found.magnetic_deg),
        _format_angles(found.true_deg),
        _format(found.sd_deg, len(found)),
        _format(found.tilt_sd_deg, len(found)),
        _format(found.disagreement_deg, len(found)),
        [found.sensors[k] for k in found.used.tolist()],
        found.flag_names(),
    )
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(zip(*columns, strict=True))
    return write_atomically(file, stream.getvalue())


def _format(values: Array | None, n: int) -> list[str]:
    if values is None:
        return [""] * n
    return ["" if np.isnan(value) else f"{value:.3f}" for value in values.tolist()]


def _format_angles(values: Array) -> list[str]:
    """Angles from 0 to less than 360°, which rounding must not make 360."""
    return _format(np.round(values, 3) % 360.0, len(values))
