"""Lines that name each of their numbers, as sketches print them: `mx: 12.5, my=-3, mz: 44 uT`.

A record may take several lines, until a name comes again. A unit at the end of a line is that of
its numbers, and a time of day before it, as the Arduino's monitor writes it, is its time.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.logs.columns import find_columns, identify_column
from agonic.logs.text.layout import SAMPLE

_NUMBER = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d++)?+"  # possessive: long digits cost once
_LABELLED = re.compile(
    rf"(?<![\w.])[\"']?([^\W\d][\w.\[\]/ ]{{0,40}}?)[\"']?\s*[:=]\s*({_NUMBER})(?![\w:])"
)
_QUOTED = re.compile(r'"[^"]*[:=][^"]*"')
_UNIT = re.compile(rf"{_NUMBER}\s*([^\W\d_][\w/^²]*)[\s,;.]*$")
_TAIL = 80
_STAMP = re.compile(r"\s*\[?(\d\d:\d\d:\d\d[.,]\d+)\]?\s*(?:->|:|,|\s)")

Record = dict[str, str]


def is_labelled(rows: Sequence[str]) -> bool:
    """Whether one line of three, or more of them, names three numbers or more.

    >>> is_labelled(["X: 1.5 Y: 2 Z: 3 uT", "Heading: 12"]), is_labelled(["1,2,3"])
    (True, False)
    """
    named = sum(len(_LABELLED.findall(_QUOTED.sub("", row))) >= 3 for row in rows)
    return bool(rows) and 3 * named >= len(rows)


def read_labelled(rows: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The columns of lines that name each of their numbers, with units that end the lines.

    >>> read_labelled(["mx: 1 my: 2 mz: 3 uT", "mx: 4 my: 5 mz: 6 uT"])["mx (uT)"].tolist()
    [1.0, 4.0]
    """
    records, stamps = _gather(rows)
    names = list(dict.fromkeys(name for record in records[:SAMPLE] for name in record))
    units = _find_units(rows[: 3 * SAMPLE])
    headers = [f"{name} ({units[name]})" if units.get(name) else name for name in names]
    wanted = find_columns(headers)
    table: dict[str, NDArray[Any]] = {
        header: np.array([float(record.get(names[i], "nan")) for record in records])
        for i, header in wanted.items()
    }
    timed = any((c := identify_column(h)) and c.quantity.column == "time" for h in table)
    if not timed and 2 * sum(map(bool, stamps)) > len(stamps):
        table["time"] = np.array(stamps, dtype=object)
    return table


def _gather(rows: Sequence[str]) -> tuple[list[Record], list[str]]:
    """The numbers by name, a record until a name comes again, and the time of day before each."""
    records: list[Record] = []
    stamps: list[str] = []
    for row in rows:
        stamp = _STAMP.match(row)
        pairs = _LABELLED.findall(row[stamp.end() :] if stamp else row)
        if not pairs:
            continue
        if not records or any(name.strip() in records[-1] for name, _ in pairs):
            records.append({})
            stamps.append(stamp[1] if stamp else "")
        records[-1] |= {name.strip(): number for name, number in pairs}
    return records, stamps


def _find_units(rows: Sequence[str]) -> dict[str, str]:
    """The unit that ends the lines of each name, where it is one of what the name stands for."""
    found: dict[str, Counter[str]] = {}
    for row in rows:
        unit = _UNIT.search(row[-_TAIL:])
        for name, _ in _LABELLED.findall(row):
            found.setdefault(name.strip(), Counter())[unit[1] if unit else ""] += 1
    units = {}
    for name, counts in found.items():
        unit_of_most = counts.most_common(1)[0][0]
        plain = identify_column(name)
        column = identify_column(f"{name} ({unit_of_most})") if unit_of_most else None
        if plain is not None and plain.unit is None and column is not None and column.unit:
            units[name] = unit_of_most
    return units
