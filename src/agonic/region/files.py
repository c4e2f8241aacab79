"""Readings at known places, and the map as a table."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError, UnitError
from agonic.exports.csv import write_table
from agonic.logs.headers.column_names import names_for
from agonic.logs.read import unpack
from agonic.logs.rows.auxiliary import to_numbers
from agonic.logs.table import build_log
from agonic.logs.text.csv_text import read_table
from agonic.maths.rotations.attitude import rot_nb
from agonic.provenance import Input, hash_file
from agonic.region.result import FieldMap
from agonic.samples import Samples

PLACE = ("x_m", "y_m", "z_m")


def read_region(path: Path, unit: str | None = None) -> tuple[Array, Samples]:
    """Places (n, 3), m, and readings of a table with columns x_m, y_m, z_m and a calibrated
    field."""
    try:
        with unpack(path) as (plain, _), names_for(path, None) as names:
            table, facts = read_table(plain)
            source = Input(name=path.name, sha256=hash_file(path), count=0)
            stated = unit or (names.unit if names else None)
            samples = build_log(table, path=path, source=source, unit=stated, **facts).sensors[0]
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror or error}", path=path) from error
    except LogError as error:
        raise error if error.path else LogError(str(error), path=path) from error
    if samples.unit != "nT":
        raise UnitError(f"{path.name} names no unit of the field; give it with --unit")
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
    return position, samples


def turn_level(samples: Samples) -> Array | None:
    """Readings (n, 3) that the roll, pitch and heading beside them turn from the sensor's axes into
    those of the region: x where the heading is 0, y to the right of it, z down."""
    roll, pitch, heading = samples.roll_deg, samples.pitch_deg, samples.heading_deg
    if roll is None or pitch is None or heading is None:
        return None
    return np.asarray(np.einsum("nij,nj->ni", rot_nb(roll, pitch, heading), samples.field))


def write_map(path: Path, region: FieldMap) -> Path:
    """Write the field, its gradient and their standard errors on a grid of 9 × 9 × 9 as a table."""
    ends = zip(region.low, region.high, strict=True)
    at = np.array(list(product(*(np.linspace(a, b, 9 if b > a else 1) for a, b in ends))))
    found = region.at(at)
    pairs = [(i, k) for i in range(3) for k in range(3)]
    columns = {
        **{name: at[:, k] for k, name in enumerate(PLACE)},
        **{f"mag_{a}_nT": found.field[:, k] for k, a in enumerate("xyz")},
        **{f"mag_{a}_sd_nT": found.sd[:, k] for k, a in enumerate("xyz")},
        **{f"gradient_{'xyz'[i]}{'xyz'[k]}_nT_m": found.gradient[:, i, k] for i, k in pairs},
        **{f"gradient_{'xyz'[i]}{'xyz'[k]}_sd_nT_m": found.gradient_sd[:, i, k] for i, k in pairs},
    }
    return write_table({k: [f"{v:.7g}" for v in one] for k, one in columns.items()}, path)
