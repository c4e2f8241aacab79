"""Sheets of absolute measurements with a fluxgate theodolite, as MagPy keeps them.

# MagPy Absolutes
# Abs-TheoUnit: gon              of all angles, the mark's azimuth too: gon or deg
# Abs-AzimuthMark: 200.1524
# Abs-DeltaF: -0.8               the field at the pillar less that where F is measured
Miren:
86.9504  86.9504  286.949  286.949 …       to the mark, both faces, before and after
Positions:
2017-11-02_08:35:00  191.5182  100  0.4    time, horizontal circle, zenith, fluxgate
PPM:
2017-11-02_08:35:00  48826.1               total field
Result:
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.files.tables import GON_DEG
from agonic.alignment.session.laboratory import DiSheet
from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.provenance import Input, hash_file

MARK = "# MagPy Absolutes"
UNITS_DEG = {"gon": GON_DEG, "deg": 1.0}
_PARTS = ("Miren:", "Positions:", "PPM:", "Result:")


def is_di_flux(path: Path) -> bool:
    """Whether a file is such a sheet."""
    try:
        with path.open("rb") as stream:
            return stream.read(len(MARK)) == MARK.encode()
    except OSError:
        return False


def read_di_flux(path: Path | str) -> DiSheet:
    """The readings of a DI-flux sheet, angles in degrees.

    Parameters: `path` of the sheet.

    Raises `LogError` naming what the sheet lacks, or the row that cannot be read.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "sheet.txt")
    ...     _ = file.write_text("# MagPy Absolutes\\n# Abs-TheoUnit: gon\\nMiren:\\n10 210\\n"
    ...                         "Positions:\\n2020-01-01_10:00:00 100 100 0.5\\n")
    ...     read_di_flux(file).mark_deg.tolist()
    [9.0, 189.0]
    """
    file = Path(path)
    head, parts = _parts(file)
    factor = UNITS_DEG.get(head.get("TheoUnit", "").lower())
    missing = [] if factor else [f"Abs-TheoUnit ({' or '.join(UNITS_DEG)})"]
    missing += [name.rstrip(":") for name in ("Miren:", "Positions:") if not parts[name]]
    if missing or factor is None:
        raise LogError(f"the sheet lacks {', '.join(missing)}", path=file)
    marks = [_number(word, file, row) for row, line in parts["Miren:"] for word in line.split()]
    time, table = _rows(parts["Positions:"], 4, file)
    angles = table[:, :2] * factor
    azimuth = _said(head, "AzimuthMark", file)
    magnitude, note = _magnitude(parts["PPM:"], float(time.mean()), file)
    if magnitude is not None:
        magnitude += _said(head, "DeltaF", file) or 0.0
    return DiSheet(
        mark_deg=np.array(marks) * factor,
        mark_azimuth_deg=None if azimuth is None else azimuth * factor,
        horizontal_deg=angles[:, 0],
        zenith_deg=angles[:, 1],
        reading=table[:, 2],
        setting=_settings(angles),
        time=time,
        magnitude=magnitude,
        pillar=head.get("Pillar", ""),
        theodolite=head.get("Theodolite", ""),
        sensor=head.get("FGSensor", ""),
        name=file.stem,
        sources=(Input(name=file.name, sha256=hash_file(file), count=len(table)),),
        notes=note,
    )


def _parts(file: Path) -> tuple[dict[str, str], dict[str, list[tuple[int, str]]]]:
    """The head by key, and the numbered lines of each part."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror or error}", path=file) from error
    except UnicodeDecodeError:
        raise LogError("this is no text", path=file) from None
    head: dict[str, str] = {}
    parts: dict[str, list[tuple[int, str]]] = {name: [] for name in _PARTS}
    now = ""
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if text.startswith("# Abs-"):
            key, _, value = text.removeprefix("# Abs-").partition(":")
            head[key.strip()] = value.strip()
        elif text in parts:
            now = text
        elif text and not text.startswith("#") and now:
            parts[now].append((number, text))
    return head, parts


def _rows(lines: Iterable[tuple[int, str]], width: int, file: Path) -> tuple[Array, Array]:
    """Unix times (n,) and numbers (n, width − 1)."""
    times, table = [], []
    for row, line in lines:
        words = line.split()
        if len(words) != width:
            raise LogError(f"{len(words)} cells where {width} are needed", path=file, row=row)
        try:
            moment = datetime.fromisoformat(words[0].replace("_", "T"))
        except ValueError:
            raise LogError(f"{words[0]!r} is no time", path=file, row=row) from None
        times.append(moment.replace(tzinfo=UTC).timestamp())
        table.append([_number(word, file, row) for word in words[1:]])
    return np.array(times), np.array(table).reshape(len(table), width - 1)


def _number(word: str, file: Path, row: int) -> float:
    value = to_number(word)
    if not np.isfinite(value):
        raise LogError(f"{word!r} is not a number", path=file, row=row)
    return value


def _said(head: dict[str, str], key: str, file: Path) -> float | None:
    """A number of the head; empty and None mean that it is not known."""
    words = head.get(key, "").split()
    if not words or words[0] == "None":
        return None
    with suppress(ValueError):
        return float(words[0])
    raise LogError(f"Abs-{key} is {words[0]!r}, not a number", path=file)


def _settings(angles: Array) -> NDArray[np.int64]:
    """Numbers of the settings: a new one wherever a circle moved."""
    moved = np.abs(np.diff(angles, axis=0)).max(axis=1) > 0.01  # less is one setting, set anew
    return np.concatenate([[0], np.cumsum(moved)]).astype(np.int64)


def _magnitude(
    lines: list[tuple[int, str]], when: float, file: Path
) -> tuple[float | None, tuple[str, ...]]:
    """The total field near a moment, and a note where it was not measured then."""
    if not lines:
        return None, ()
    time, field = _rows(lines, 2, file)
    away = np.abs(time - when)
    if away.min() > 6 * 3600.0:  # farther away in time it says nothing of the readings
        return None, ("the total field was measured at another time and is left out",)
    near = np.argsort(away, kind="stable")[:10]
    late = away[near].min()
    note = f"the total field is that of {late / 60:.0f} min from the measurement"
    return float(np.median(field[near, 0])), (note,) if late > 900 else ()
