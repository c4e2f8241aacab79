"""`write_headings`: headings as a CSV table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.exports.csv import write_table
from agonic.headings.result import Heading


def write_headings(found: Heading, file: Path) -> Path:
    """Write a row a reading; a number that there is not is left empty."""
    time, n = found.time, len(found)
    angles = ("compass_deg", "magnetic_deg", "true_deg")  # which rounding must not make 360°
    numbers = {name: np.round(getattr(found, name), 3) % 360.0 for name in angles}
    others = ("sd_deg", "tilt_sd_deg", "disagreement_deg")
    numbers |= {name: getattr(found, name) for name in others}
    table = {"time_s": [""] * n if time is None else [repr(t) for t in time.tolist()]}
    for name, values in numbers.items():
        cells = [np.nan] * n if values is None else values.tolist()
        table[name] = ["" if value != value else f"{value:.3f}" for value in cells]
    table["sensor"] = [found.sensors[k] for k in found.used.tolist()]
    table["flags"] = found.flag_names()
    return write_table(table, file)
