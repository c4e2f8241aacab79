"""Positions of a satellite from two-line elements, with sgp4, for logs that have only times."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicWarning, LogError, MissingExtraError
from agonic.logs.contents import read_bytes
from agonic.maths.earth.earth_rotation import rotate_about_third, sidereal_rad
from agonic.maths.earth.geodesy import geodetic
from agonic.units import DAY_S

LINE = 69
"""Characters of a line of elements, the checksum included."""
FRESH_DAYS = 7.0
"""So long the elements of a low orbit are good to some ten kilometres."""

_UNIX_JULIAN_DATE = 2_440_587.5


def positions_from_tle(
    tle: Path | str, time: ArrayLike, epoch: datetime, *, satellite: int | None = None
) -> dict[str, Array]:
    """Where a satellite was, by SGP4 from its two-line elements.

    Of several sets of elements of one satellite each row takes the one that is nearest in time.
    Positions are good to a kilometre or so near the time of the elements, and lose about one
    more each day in a low orbit.

    Parameters
    ----------
    tle : the lines themselves, with or without names between them, or the path of a file of them.
    time : (n,) seconds since `epoch`, as in `Samples`.
    epoch : UTC moment of time zero.
    satellite : catalogue number, where the lines are of several satellites.

    Returns
    -------
    The columns latitude_deg, longitude_deg and altitude_m, (n,), geodetic, ready for
    `samples.with_columns(**positions)`. TEME is turned into Earth-fixed axes by mean sidereal
    time (Vallado et al., AIAA 2006-6753), without polar motion.

    Raises
    ------
    LogError for lines that are no elements, or that SGP4 cannot carry to these times;
    MissingExtraError without sgp4. Warns where elements are older than a week.

    Examples
    --------
    >>> lines = '''ISS (ZARYA)
    ... 1 25544U 98067A   21107.58244333  .00000946  00000-0  25412-4 0  9990
    ... 2 25544  51.6445 282.4828 0002680 236.8482 199.8666 15.48892929279202'''
    >>> where = positions_from_tle(lines, [0.0, 60.0], datetime(2021, 4, 17, 14, 0, tzinfo=UTC))
    >>> where["latitude_deg"].round(1).tolist(), (where["altitude_m"] / 1e3).round().tolist()
    ([51.0, 51.6], [428.0, 428.0])
    """
    try:
        from sgp4.api import Satrec
    except ImportError:
        raise MissingExtraError("positions from two-line elements", "space") from None
    sets = [Satrec.twoline2rv(*pair) for pair in _choose(_pairs(_text(tle)), satellite)]
    start = epoch.replace(tzinfo=UTC) if epoch.tzinfo is None else epoch
    unix = start.timestamp() + np.asarray(time, dtype=np.float64)
    made = np.array([s.jdsatepoch + s.jdsatepochF - _UNIX_JULIAN_DATE for s in sets]) * DAY_S
    nearest = np.abs(unix[:, None] - made).argmin(axis=1) if len(sets) > 1 else np.zeros(len(unix))
    if (age := np.abs(unix - made[nearest.astype(int)]).max(initial=0.0) / DAY_S) > FRESH_DAYS:
        warnings.warn(
            f"the elements are {age:.0f} days off: positions may be wrong by tens of kilometres; "
            "take elements of the same week",
            AgonicWarning,
            stacklevel=2,
        )
    position_i = np.empty((3, len(unix)))
    for k, elements in enumerate(sets):
        rows = nearest == k
        position_i[:, rows] = _propagate(elements, unix[rows])
    places = geodetic(rotate_about_third(position_i, sidereal_rad(unix)))
    return dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), places, strict=True))


_NUMBERS = (
    ((18, 32), (33, 43)),
    ((8, 16), (17, 25), (26, 33), (34, 42), (43, 51), (52, 63)),
)
"""Where numbers stand in the first and second line (CelesTrak, "NORAD two-line element set")."""


def _holds_numbers(line: str) -> bool:
    """Whether printable letters alone are there, and numbers where numbers belong."""
    try:
        for start, stop in _NUMBERS[int(line[0]) - 1]:
            float(line[start:stop])
    except ValueError:
        return False
    return line.isascii() and line.isprintable()


def _text(tle: Path | str) -> str:
    """The lines, read from the file where a path was given."""
    if isinstance(tle, str) and "\n" in tle.strip():
        return tle
    return read_bytes(tle).decode(errors="replace")


def _pairs(text: str) -> list[tuple[str, str]]:
    """The first and second lines that belong together, checked by their checksums."""
    lines = [line.rstrip() for line in text.splitlines()]
    pairs = [
        (one[:LINE], two[:LINE])
        for one, two in pairwise(lines)
        if one.startswith("1 ") and two.startswith("2 ") and one[2:7] == two[2:7]
    ]
    if not pairs:
        raise LogError(
            "no two-line elements found; give two lines that begin with 1 and 2 and the same "
            "catalogue number"
        )
    from sgp4.io import compute_checksum

    for line in (line for pair in pairs for line in pair):
        if len(line) < LINE or line[-1] != str(compute_checksum(line)):
            raise LogError(f"the checksum of {line!r} is wrong; copy the elements again")
        if not _holds_numbers(line):
            raise LogError(f"{line!r} has letters where numbers belong; copy the elements again")
    return pairs


def _choose(pairs: Sequence[tuple[str, str]], satellite: int | None) -> list[tuple[str, str]]:
    """The elements of one satellite; an error naming those there are where that is not clear."""
    numbers = {one[2:7].strip().lstrip("0") for one, _ in pairs}
    wanted = str(satellite) if satellite is not None else next(iter(numbers))
    if wanted not in numbers or (satellite is None and len(numbers) > 1):
        raise LogError(f"elements of the satellites {', '.join(sorted(numbers))}; choose one")
    return [pair for pair in pairs if pair[0][2:7].strip().lstrip("0") == wanted]


def _propagate(elements: Any, unix: Array) -> Array:
    """Positions (3, n), m, in TEME."""
    days = np.floor(unix / DAY_S)
    errors, positions_km, _ = elements.sgp4_array(
        days + _UNIX_JULIAN_DATE, (unix - days * DAY_S) / DAY_S
    )
    if errors.any():
        from sgp4.api import SGP4_ERRORS

        why = SGP4_ERRORS.get(int(errors[errors > 0][0]), "SGP4 failed")
        raise LogError(
            f"the elements do not hold at {int((errors > 0).sum())} of {len(unix)} times ({why}); "
            "take elements of the same week"
        )
    return np.asarray(positions_km, dtype=np.float64).T * 1e3
