"""The record of a swing: compass headings with what they should have been, and the blank form.

A text table with a header. Columns (case, blanks and `_deg` do not count):

    compass      what the compass read: 45, 045°, NE
    magnetic     the magnetic heading then (also reference), or
    true         the true heading then (also heading), or
    deviation    magnetic less compass: 10.5E, W 1.2, -1.2
    roll, pitch  the tilt then (roll also heel); may be missing

Lines with # are remarks; `# power_state: engine on` and its like tell what the card belongs to.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.deviation import POINTS
from agonic.errors import LogError
from agonic.logs.contents import read_text
from agonic.provenance import Input, hash_file

ALIASES = {
    "compass": "compass compassheading headingcompass compassreading magcompass psi",
    "magnetic": "magnetic magneticheading headingmagnetic mag reference referenceheading ref",
    "true": "true trueheading headingtrue heading yaw gnssheading gpsheading",
    "deviation": "deviation dev delta",
    "roll": "roll heel list",
    "pitch": "pitch trim",
}
"""What a column may be called, after case, punctuation and a unit of degrees are taken off."""

REMARKS = {
    "power_state": "what is switched on",
    "current_A": "the current it draws, A",
    "compass": "which compass",
    "noise_deg": "how well one reading can be taken, degrees",
    "drift_deg": "how far the reference may drift from first to last, degrees; 0 for a line",
    "declination_deg": "east positive; needed where the reference is true",
    "date": "",
    "place": "",
}
"""What the remark lines of a form ask for."""

_REFERENCES = ("magnetic", "true", "deviation")
_COLUMN_OF = {alias: name for name, aliases in ALIASES.items() for alias in aliases.split()}
_POINT_DEG = {point: 22.5 * k for k, point in enumerate(POINTS)}
_NUMBER = re.compile(r"[-+−]?\d+(?:\.\d*)?|[-+−]?\.\d+")


@dataclass(frozen=True, kw_only=True, eq=False)
class Swing:
    """Readings of a swing, (n,) each, degrees, in the order they were taken.

    `reference_deg` is the magnetic or the true heading, as `reference` says; `blank` counts rows
    that were not filled in; `estimated` says that the reference is an estimate that follows a
    compass itself; `remarks` holds what the # lines tell, by the names of `REMARKS`.
    """

    compass_deg: Array
    reference_deg: Array
    reference: Literal["magnetic", "true"]
    roll_deg: Array | None = None
    pitch_deg: Array | None = None
    blank: int = 0
    estimated: bool = False
    remarks: Mapping[str, str]
    source: Input

    @property
    def heel(self) -> Array | None:
        """Roll (n,), or roll and pitch (n, 2), where they were noted."""
        if self.roll_deg is None or self.pitch_deg is None:
            return self.roll_deg
        return np.stack([self.roll_deg, self.pitch_deg], 1)

    def number(self, remark: str) -> float | None:
        """A remark that is a number, or `None` where it was not made.

        Raises `LogError` where it is no number.
        """
        text = self.remarks.get(remark, "").replace(",", ".")
        if not text:
            return None
        if remark.endswith("_deg"):
            value, example = _angle(text), "a number, or 4.5E"
        else:
            plain = text.rstrip("A ")
            value = float(plain.replace("−", "-")) if _NUMBER.fullmatch(plain) else None
            example = "a number"
        if value is None or value != value:
            raise LogError(f"{remark} is {text!r}; write {example}", path=self.source.name)
        return value


def read_swing(path: Path | str) -> Swing:
    """The swing that a text table records.

    Parameters: `path` of the table.

    Raises `LogError` where it cannot be read, a column is missing, a cell cannot be understood or
    no row is filled in.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "swing.csv")
    ...     _ = path.write_text("compass,deviation\\nN,10.5E\\n135,1.2 W\\n")
    ...     read_swing(path).reference_deg.tolist()
    [10.5, 133.8]
    """
    path = Path(path)
    lines = read_text(path).splitlines()
    kept = [(k, line) for k, line in enumerate(lines, start=1) if line.strip()[:1] not in ("", "#")]
    if len(kept) < 2:
        raise LogError("a swing is a header and a row for each heading", path=path)
    separator = next((s for s in (";", "\t", ",") if s in kept[0][1]), ",")
    table = [  # each line on its own: an open quote must not take the next one
        (number, [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])])
        for number, line in kept
    ]
    columns = _columns(table[0][1], path)
    values = {name: _values(table[1:], at, name, separator, path) for name, at in columns.items()}
    compass = values["compass"]
    name = next(n for n in _REFERENCES if n in values)
    reference = values[name] if name != "deviation" else compass + values[name]
    filled = np.isfinite(compass) & np.isfinite(reference)
    if not filled.any():
        raise LogError(f"no row has both compass and {name}; fill in the form", path=path)
    tilt = {n: values[n][filled] for n in ("roll", "pitch") if n in values}
    noted = {n: v for n, v in tilt.items() if np.isfinite(v).any()}
    return Swing(
        compass_deg=compass[filled],
        reference_deg=reference[filled],
        reference="true" if name == "true" else "magnetic",
        roll_deg=noted.get("roll"),
        pitch_deg=noted.get("pitch"),
        blank=int((~filled).sum()),
        remarks=_remarks(lines),
        source=Input(name=path.name, sha256=hash_file(path), count=int(filled.sum())),
    )


def make_form(compass_deg: ArrayLike, *, roll_deg: ArrayLike | None = None) -> str:
    """The form of a swing to fill in, a row a heading.

    `read_swing` reads it back once it is filled in; rows left blank are passed over.
    """
    compass = np.asarray(compass_deg, dtype=np.float64).tolist()
    head = [
        "# Steer each heading in turn until the compass is at rest. Write what the compass reads",
        "# and the magnetic heading from a better source (call the column true_deg if it is true).",
        "# At the end steer the first heading again: if it reads otherwise, the reference drifts.",
        *(f"# {name}: {f'({hint})' if hint else ''}".rstrip() for name, hint in REMARKS.items()),
    ]
    if roll_deg is None:
        rows = ["compass_deg,magnetic_deg", *(f"{c:g}," for c in compass)]
    else:
        tilt = np.asarray(roll_deg, dtype=np.float64).tolist()
        rows = ["compass_deg,roll_deg,magnetic_deg"]
        rows += [f"{c:g},{r:g}," for c, r in zip(compass, tilt, strict=True)]
    return "\n".join([*head, *rows]) + "\n"


def _columns(header: Sequence[str], path: Path) -> dict[str, int]:
    """Where each quantity stands, or what is missing."""
    found: dict[str, int] = {}
    for at, name in enumerate(header):
        plain = re.sub(r"[^a-z]", "", name.lower())
        column = _COLUMN_OF.get(plain) or _COLUMN_OF.get(re.sub("(degrees|deg)$", "", plain))
        if column in found:
            raise LogError(f"two columns could be the {column} heading; rename one", path=path)
        if column is not None:
            found[column] = at
    references = [name for name in _REFERENCES if name in found]
    if "compass" not in found or not references:
        raise LogError(
            f"the columns are {', '.join(header)}; a swing needs compass_deg and one of "
            "magnetic_deg, true_deg or deviation_deg",
            path=path,
        )
    if len(references) > 1:
        named = " and ".join(header[found[name]] for name in references)
        raise LogError(
            f"{named} hold the same quantity twice; keep one of these columns", path=path
        )
    return found


def _values(
    rows: Sequence[tuple[int, list[str]]], at: int, name: str, separator: str, path: Path
) -> Array:
    """A column as numbers, NaN where it is blank."""
    read = _angle if name in ("deviation", "roll", "pitch") else _heading
    values = []
    for number, row in rows:
        cell = row[at] if at < len(row) else ""
        value = read(cell if separator == "," else cell.replace(",", "."))
        if value is None:
            raise LogError(f"{cell!r} is not a {name} in degrees", path=path, row=number)
        values.append(value)
    return np.array(values)


def _heading(cell: str) -> float | None:
    """A heading: a number or a point of the compass; NaN for a blank."""
    text = cell.upper().rstrip("° ")
    if not text:
        return float("nan")
    if text in _POINT_DEG:
        return _POINT_DEG[text]
    return float(text.replace("−", "-")) if _NUMBER.fullmatch(text) else None


def _angle(cell: str) -> float | None:
    """An angle with its sign or its side: east and starboard are positive; NaN for a blank."""
    text = re.sub(r"[°\s]", "", cell.upper())
    if not text or text in ("NAN", "-", "–"):
        return float("nan")
    side = next((s for s in "EWSP" if s in (text[0], text[-1])), "")
    number = text.strip(side) if side else text
    if not _NUMBER.fullmatch(number) or (side and number[0] in "+-−"):
        return None
    return float(number.replace("−", "-")) * (-1 if side in ("W", "P") else 1)


def _remarks(lines: Sequence[str]) -> dict[str, str]:
    """The remarks whose names are known; the hints of a blank form are none."""
    said = {}
    for line in lines:
        name, colon, text = line.lstrip("# ").partition(":")
        plain = re.sub(r"\s+", "_", name.strip().lower())
        known = next(
            (r for r in REMARKS if plain in (r.lower(), r.lower().removesuffix("_deg"))), ""
        )
        if line.startswith("#") and colon and known:
            said[known] = text.strip().rstrip(",;").removeprefix(f"({REMARKS[known]})").strip()
    return {name: text for name, text in said.items() if text}
