"""Logs of a logger whose files begin with PIGEON, and calibrations in a line for its firmware."""

from pathlib import Path

import numpy as np

from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.exports.convert import Export, require_physical
from agonic.exports.targets import Target
from agonic.exports.temperature import hold_temperature
from agonic.logs.formats import Format
from agonic.logs.log import Log
from agonic.logs.table import build_log
from agonic.provenance import Input

READER = Format(
    "Pigeon (.pgn)", "agonic_pigeon", lambda head: head.startswith(b"PIGEON"), package=""
)
TARGET = Target("agonic_pigeon:write_pigeon", ".pgn", package="")


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """Read a PIGEON file: four numbers a line, seconds and the field."""
    rows = np.loadtxt(path, skiprows=1)
    names = ("time_s", "mag_x_uT", "mag_y_uT", "mag_z_uT")
    table = dict(zip(names, rows.T, strict=True))
    return build_log(table, path=path, source=source, format="PIGEON", unit=unit)


def write_pigeon(
    calibration: Calibration, path: Path | str, *, temperature_C: float | None = None
) -> Export:
    """Write bias and matrix in a line."""
    one, warnings = hold_temperature(calibration, temperature_C)
    bias, matrix = require_physical(one, "nT")
    line = " ".join(map(repr, [*bias.tolist(), *matrix.ravel().tolist()]))
    return Export(path=write_atomically(path, line), target="pigeon", warnings=tuple(warnings))
