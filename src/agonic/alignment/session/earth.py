"""`EarthRotation`: polar motion and UT1 as the IERS publishes them, from an installed table."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from agonic.arrays import Array
from agonic.errors import AgonicError, ValidityError
from agonic.maths.earth.earth_rotation import rot_ei, tai_utc_s
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.units import DAY_S

ARCSEC_PER_S = 15.041067
"""How far the Earth turns in a second of UT1."""
_FIELDS = {
    "mjd": slice(7, 15),
    "kind": slice(16, 17),
    "x": slice(18, 27),
    "x_sd": slice(27, 36),
    "y": slice(37, 46),
    "y_sd": slice(46, 55),
    "ut1_kind": slice(57, 58),
    "ut1": slice(58, 68),
    "ut1_sd": slice(68, 78),
}
"""Columns of finals2000A, Bulletin A (the file's own readme)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EarthRotation:
    """Daily polar motion and UT1 − TAI (without leap seconds, so it can be interpolated), (n,) rows
    at UTC midnights, their standard errors, and the last moment that is measured, not predicted."""

    unix_s: Array
    ut1_tai_s: Array
    pole_x_rad: Array
    pole_y_rad: Array
    ut1_sd_s: Array
    pole_sd_rad: Array
    measured_until: float
    source: str

    @property
    def ends(self) -> float:
        """The last moment that the table knows, UTC seconds since 1970."""
        return float(self.unix_s[-1])

    def at(self, unix_s: ArrayLike) -> tuple[Array, Array, Array]:
        """UT1 − TAI, s, and the pole's x and y, rad, (n,) by cubic splines between the days. Raises
        `ValidityError` outside the table."""
        when = np.atleast_1d(np.asarray(unix_s, dtype=np.float64))
        outside = (when < self.unix_s[0]) | (when > self.ends)
        if outside.any():
            raise ValidityError(self._refusal(float(when[outside][0])), mask=outside)
        first, last = np.searchsorted(self.unix_s, (when.min(), when.max()))
        rows = slice(max(int(first) - 6, 0), int(last) + 6)
        daily = np.stack([self.ut1_tai_s, self.pole_x_rad, self.pole_y_rad], axis=1)[rows]
        values = CubicSpline(self.unix_s[rows], daily)(when)
        return values[:, 0], values[:, 1], values[:, 2]

    def rot_ei(self, unix_s: ArrayLike) -> Array:
        """Inertial components into Earth-fixed ones at UTC moments, (n, 3, 3)."""
        return rot_ei(unix_s, *self.at(unix_s))

    def sd_arcsec(self, unix_s: float) -> float:
        """How far the Earth's orientation may be off at a moment, by the table's own errors."""
        turned = np.interp(unix_s, self.unix_s, self.ut1_sd_s) * ARCSEC_PER_S
        return float(
            np.hypot(turned, np.interp(unix_s, self.unix_s, self.pole_sd_rad) / ARCSEC_RAD)
        )

    def _refusal(self, unix_s: float) -> str:
        """Why a moment outside the table is refused, and what to do."""
        if unix_s < self.unix_s[0]:
            return (
                f"{_date(unix_s)} is before the Earth rotation table begins "
                f"({_date(float(self.unix_s[0]))}); check the date"
            )
        return (
            f"{_date(unix_s)} is after the end of the Earth rotation table ({_date(self.ends)}; "
            f"measured until {_date(self.measured_until)}); every second by which UT1 is wrong "
            "turns the sky by 15″. Install a newer table: pip install -U astropy-iers-data"
        )


def _date(unix_s: float) -> str:
    """The date of a moment; its year where no calendar goes so far."""
    try:
        return datetime.fromtimestamp(unix_s, UTC).date().isoformat()
    except (ValueError, OverflowError, OSError):
        return f"the year {1970 + unix_s / 31_556_952:.0f}"


@lru_cache(maxsize=1)
def load_earth_rotation() -> EarthRotation:
    """The table finals2000A of the IERS that is installed (package astropy-iers-data), offline.

    Source: IERS Rapid Service, Bulletin A: measured from 1973, predicted for a year.
    """
    from astropy_iers_data import IERS_A_FILE, __version__

    table = _columns(Path(IERS_A_FILE).read_text(encoding="ascii"))
    unix = (table["mjd"] - 40_587.0) * DAY_S  # 1970-01-01
    measured = unix[(table["kind"] == "I") & (table["ut1_kind"] == "I")]
    return EarthRotation(
        unix_s=unix,
        ut1_tai_s=table["ut1"] - tai_utc_s(unix),
        pole_x_rad=table["x"] * ARCSEC_RAD,
        pole_y_rad=table["y"] * ARCSEC_RAD,
        ut1_sd_s=table["ut1_sd"],
        pole_sd_rad=np.hypot(table["x_sd"], table["y_sd"]) * ARCSEC_RAD,
        measured_until=float(measured[-1]),
        source=f"IERS finals2000A, astropy-iers-data {__version__}",
    )


def _columns(text: str) -> dict[str, NDArray[Any]]:
    """The columns of the rows that have values."""
    rows = [line for line in text.splitlines() if line[_FIELDS["ut1"]].strip()]
    if len(rows) < 10:
        raise AgonicError(
            "the installed Earth rotation table cannot be read; reinstall astropy-iers-data"
        )
    return {
        name: np.array([line[at] for line in rows], dtype="U1" if "kind" in name else np.float64)
        for name, at in _FIELDS.items()
    }
