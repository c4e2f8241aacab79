"""Readings at known places, and the map as a table."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.errors import LogError, UnitError
from agonic.logs.read import read
from agonic.logs.rows.auxiliary import to_numbers
from agonic.logs.text.csv_text import read_table
from agonic.maths.rotations.attitude import rot_nb
from agonic.provenance import Input
from agonic.region.result import FieldAt

PLACE = ("x_m", "y_m", "z_m")


class RegionReadings(NamedTuple):
    """Readings `field` (n, 3), nT, at `position` (n, 3), m, and whether an attitude turned them
    from the sensor's axes into those of the region."""

    position: Array
    field: Array
    turned: bool
    source: Input


def read_region(path: Path, unit: str | None = None) -> RegionReadings:
    """The readings of a table with columns x_m, y_m, z_m and a calibrated field.

    With roll_deg, pitch_deg and heading_deg they are turned from the sensor's axes into those of
    the region: x where the heading is 0, y to the right of it, z down. Raises `LogError` where a
    column is missing or a row is not whole, `UnitError` without a unit.
    """
    samples = read(path, unit=unit)
    if samples.unit != "nT":
        raise UnitError(f"{path.name} names no unit of the field; give it with --unit")
    table, _ = read_table(path)
    missing = [name for name in PLACE if name not in table]
    if missing:
        raise LogError(
            f"has no column {', '.join(missing)}: a map needs where each reading was taken, in "
            "metres along axes that stand still",
            path=path,
        )
    position = np.stack([to_numbers(np.asarray(table[name])) for name in PLACE], axis=1)
    if len(position) != len(samples) or not np.isfinite(position).all():
        raise LogError(
            f"{len(position)} rows have {len(samples)} readings and "
            f"{int(np.isfinite(position).all(axis=1).sum())} places; leave out what is not whole",
            path=path,
        )
    angles = (samples.roll_deg, samples.pitch_deg, samples.heading_deg)
    if any(angle is None for angle in angles):
        return RegionReadings(position, samples.field, False, samples.origin)
    roll, pitch, heading = (np.asarray(angle) for angle in angles)
    turned = np.einsum("nij,nj->ni", rot_nb(roll, pitch, heading), samples.field)
    return RegionReadings(position, turned, True, samples.origin)


def write_map(path: Path, at: Array, found: FieldAt) -> Path:
    """Write the field, its gradient and their standard errors at places (n, 3) as a table."""
    pairs = [(i, k) for i in range(3) for k in range(3)]
    columns = {
        **{name: at[:, k] for k, name in enumerate(PLACE)},
        **{f"mag_{a}_nT": found.field[:, k] for k, a in enumerate("xyz")},
        **{f"mag_{a}_sd_nT": found.sd[:, k] for k, a in enumerate("xyz")},
        **{f"gradient_{'xyz'[i]}{'xyz'[k]}_nT_m": found.gradient[:, i, k] for i, k in pairs},
        **{f"gradient_{'xyz'[i]}{'xyz'[k]}_sd_nT_m": found.gradient_sd[:, i, k] for i, k in pairs},
    }
    rows = np.stack(list(columns.values()), axis=1)
    lines = [",".join(columns), *(",".join(f"{v:.7g}" for v in row) for row in rows.tolist())]
    return write_atomically(path, "\n".join(lines) + "\n")
