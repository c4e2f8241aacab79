"""Tables of columns as CSV: angles of a circle, attitudes of a star sensor, directions of a field.

The table of a star sensor has

time_s, epoch_unix      seconds and what they count from; or Unix seconds; or utc, ISO 8601
orientation             the number of the static orientation (also station)
ra_deg, dec_deg, rot_deg                  R3(Rot) R2(90° − Dec) R3(Ra), J2000; or
quat_w, quat_x, quat_y, quat_z            Hamilton, unit
across_sd_arcsec, about_sd_arcsec         of one attitude, across and about the boresight; or
cov_xx_arcsec2, cov_yy_…, cov_zz_…, cov_xy_…, cov_xz_…, cov_yz_…
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.session.session import NOT_UNIT, StarReadings, make_diagonal
from agonic.arrays import Array
from agonic.errors import LogError
from agonic.exports.csv import write_table
from agonic.logs.clocks.clock import read_clock
from agonic.logs.contents import read_text
from agonic.logs.rows.auxiliary import to_numbers
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg, rot_ci

GON_DEG = 0.9


@dataclass(frozen=True)
class Table:
    """The columns of a table as text, by header, and where it was read."""

    columns: Mapping[str, list[str]]
    path: Path

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def wrong(self, what: str, row: int | None = None) -> LogError:
        """The error that something is wrong, in a row of numbers or in all of the table."""
        return LogError(what, path=self.path, row=None if row is None else row + 2)

    def read_numbers(self, name: str) -> Array:
        """A column of numbers; the first that is none is an error."""
        values = to_numbers(np.array(self.columns[name]))
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            row = int(bad[0])
            raise self.wrong(f"{name} is {self.columns[name][row]!r}, not a number", row)
        return values

    def read_angles(self, names: Iterable[str]) -> dict[str, Array]:
        """Columns of numbers by name; those in degrees may stand in gon. All missing are named."""
        in_gon = {name: name.replace("_deg", "_gon") for name in names}
        missing = [name for name, gon in in_gon.items() if not {name, gon} & set(self.columns)]
        if missing:
            among = ", ".join(self.columns)
            raise self.wrong(f"has no column {', '.join(missing)} among {among}")
        return {
            name: self.read_numbers(name) if name in self else GON_DEG * self.read_numbers(gon)
            for name, gon in in_gon.items()
        }

    def find(self, names: tuple[str, ...], what: str) -> str:
        """The first of several names that is there."""
        found = next((name for name in names if name in self), None)
        if found is None:
            among = ", ".join(self.columns)
            raise self.wrong(f"no column with {what} ({' or '.join(names)}) among {among}")
        return found


def read_table(path: Path, needed: str) -> Table:
    """The columns by header; `needed` says what the table should be, for an error."""
    text = read_text(path, needed)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(lines))
    if len(rows) < 2:
        raise LogError(f"there is no row below a header; {needed} is needed", path=path)
    header = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise LogError(f"{len(row)} cells below {len(header)} columns", path=path, row=number)
    return Table(
        {name: [row[k].strip() for row in rows[1:]] for k, name in enumerate(header)}, path
    )


Turns = Literal["ci", "ic"]

TIMES = ("time_s", "utc", "time", "unix_s")
NUMBERS = ("orientation", "station")
ANGLES = ("ra_deg", "dec_deg", "rot_deg")
QUATERNION = ("quat_w", "quat_x", "quat_y", "quat_z")
SDS = ("across_sd_arcsec", "about_sd_arcsec")
COVARIANCE = tuple(f"cov_{pair}_arcsec2" for pair in ("xx", "yy", "zz", "xy", "xz", "yz"))


def read_stars(path: Path, turns: Turns = "ci", **stated: Any) -> StarReadings:
    """The attitudes in a table, times as they stand there. Raises `LogError` naming the row or the
    columns that are missing."""
    return parse_stars(read_table(path, "a CSV table of attitudes"), turns, **stated)


def parse_stars(
    table: Table,
    turns: Turns = "ci",
    *,
    errors: tuple[float | None, float | None] = (None, None),
    numbered: bool = True,
    **stated: Any,
) -> StarReadings:
    """The attitudes in a table that was read, with what else is `stated` of them. `turns` says what
    a quaternion does to components: "ci" takes inertial ones into the star sensor's, "ic" the other
    way; `errors` the standard deviations across and about the boresight where the table has none. A
    table that is not `numbered` may lack the orientations: all rows are then one."""
    return StarReadings(
        time=_times(table),
        orientation=_orientations(table, numbered),
        rot_ci=_attitudes(table, turns),
        covariance=_covariances(table, errors),
        **stated,
    )


def _orientations(table: Table, numbered: bool) -> NDArray[np.int64]:
    """The number of each row's orientation; 0 throughout where the table may lack it."""
    if not numbered and not any(name in table for name in NUMBERS):
        return np.zeros(len(table), dtype=np.int64)
    number = table.read_numbers(table.find(NUMBERS, "the orientation's number"))
    if (number != np.round(number)).any():
        raise table.wrong("orientations are whole numbers")
    return number.astype(np.int64)


def _times(table: Table) -> Array:
    """Seconds since 1970, in the time scale of the table."""
    name = table.find(TIMES, "times")
    texts = np.array(table.columns[name])
    plain = to_numbers(texts)
    if name != "utc" and np.isfinite(plain).all():
        if "epoch_unix" in table:
            return np.asarray(plain + table.read_numbers("epoch_unix"))
        if np.median(plain) > 1e8:
            return plain
    seconds, epoch, _ = read_clock(texts if not np.isfinite(plain).all() else plain, 1.0)
    if seconds is None or epoch is None or not np.isfinite(seconds).all():
        raise table.wrong(
            f"column {name} has no dates; give utc as 2024-03-12T20:00:00Z, Unix seconds, or "
            "epoch_unix beside it"
        )
    return np.asarray(seconds + epoch.timestamp())


def _attitudes(table: Table, turns: Turns) -> Array:
    """Inertial components into the star sensor's, (n, 3, 3)."""
    if all(name in table for name in QUATERNION):
        w, x, y, z = (table.read_numbers(name) for name in QUATERNION)
        quaternions = np.stack([x, y, z, w], axis=1)
        length = np.linalg.norm(quaternions, axis=1)
        off = int(np.abs(length - 1).argmax())
        if abs(length[off] - 1) > NOT_UNIT:
            raise table.wrong(f"the quaternion has the length {length[off]:.4g}, not 1", off)
        turned = Rotation.from_quat(quaternions)
        return np.asarray((turned if turns == "ci" else turned.inv()).as_matrix())
    missing = [name for name in ANGLES if name not in table]
    if missing:
        wanted = f"there is no {', '.join(missing)}, nor {', '.join(QUATERNION)}"
        raise table.wrong(f"no attitudes: {wanted}")
    ra, dec, rot = (table.read_numbers(name) for name in ANGLES)
    high = int(np.abs(dec).argmax())
    if abs(dec[high]) > 90:
        given = f"dec_deg is {dec[high]:g}"
        where = "a declination lies between −90 and 90, and is no polar distance"
        raise table.wrong(f"{given}: {where}", high)
    return rot_ci(ra, dec, rot)


def _covariances(table: Table, errors: tuple[float | None, float | None]) -> Array | None:
    """Covariances (n, 3, 3), rad², or `None` where neither the table nor anybody states them."""
    if all(name in table for name in COVARIANCE):
        six = np.stack([table.read_numbers(name) for name in COVARIANCE], axis=-1)
        return unpack_symmetric(six) * ARCSEC_RAD**2
    if all(name in table for name in SDS):
        across, about = (table.read_numbers(name) for name in SDS)
        return make_diagonal(across, about)
    if errors[0] is None or errors[1] is None:
        return None
    return np.broadcast_to(make_diagonal(errors[0], errors[1]), (len(table), 3, 3))


def list_star_columns(star: StarReadings) -> dict[str, Any]:
    """The columns of attitudes as `read_stars` reads them back, to a tenth of a microarcsecond."""
    alpha, beta, gamma = angles_323_deg(star.rot_ci).T
    columns = {
        "unix_s": [f"{t:.6f}" for t in star.time],
        "orientation": [str(number) for number in star.orientation.tolist()],
        "ra_deg": [f"{value % 360:.14g}" for value in alpha],
        "dec_deg": [f"{90 - value:.14g}" for value in beta],
        "rot_deg": [f"{value % 360:.14g}" for value in gamma],
    }
    if star.covariance is not None:
        parts = pack_symmetric(star.covariance).T
        cells = [[f"{v:.12g}" for v in part / ARCSEC_RAD**2] for part in parts]
        columns |= dict(zip(COVARIANCE, cells, strict=True))
    return columns


DIGITS = {"unix_s": 6, "nT": 4, "deg": 7, "arcsec": 3}
"""Decimals of a column, by the unit that its name ends in: a tenth of what can be known."""


def write_direction(found: FieldDirection, file: Path) -> Path:
    """Write a row a reading that has an attitude, its columns those of `FieldDirection.columns`."""
    cells = {
        name: [f"{value:.{digits}f}" for value in values.tolist()]
        for name, values in found.columns().items()
        for unit, digits in DIGITS.items()
        if name.endswith(unit)
    }
    return write_table(cells, file)
