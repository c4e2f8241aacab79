"""The columns of a text table without a line of names: named in a comment, or by what they do."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.headers.column_names import number_columns
from agonic.logs.headers.header import identify_column

_MOMENT = ((1900, 2100), (1, 13), (1, 32), (0, 25), (0, 60), (0, 61))
"""What a year, a month, a day, an hour, a minute and a second can be."""
_STEPS = 20
"""So many steady steps are those of a clock: what is measured goes up and down."""
_TIMED = ["time", *"xyz"]
_TIMED_NOTE = (
    "there is no header: the first column grows steadily and is taken as the time, the others as "
    "x, y and z of a magnetometer"
)


def name_columns(
    above: list[str], comment: list[str], rows: Sequence[Sequence[str]], *, hashed: bool
) -> tuple[list[str], tuple[str, ...]]:
    """The header of rows, from the words of the line above them or of the last comment before
    them, else x, y, z; and notes.

    One of one more cell above is taken where no column can be behind it ("Comment"); in a comment
    that a hash and a blank begin (`hashed`) the hash may be the name of a count of rows.
    """
    header = _name_columns(above, comment, rows, hashed=hashed)
    return header, (_TIMED_NOTE,) * (header == _TIMED)


def _name_columns(
    above: list[str], comment: list[str], rows: Sequence[Sequence[str]], *, hashed: bool
) -> list[str]:
    width = len(rows[0])
    if len(above) == width + 1 and identify_column(above[-1]) is None:
        return above[:-1]
    if hashed and len(comment) == width - 1 and _counts_rows(rows):
        return ["#", *comment]
    if comment and len(comment) == width:
        return comment
    if numbers := number_columns(width):
        return numbers
    if 2 * len(above) == width:
        raise LogError(
            f"the header has {len(above)} names and the rows have {width} cells: with decimal "
            "commas, cells must be separated by something else (a semicolon)"
        )
    if width == 4 and (name := _name_first(rows)):
        return [name, *"xyz"]
    if width != 3:
        raise LogError(
            f"{width} columns and no header; name them in a first line such as "
            "time_s,mag_x_uT,mag_y_uT,mag_z_uT (three columns alone are taken as x, y, z), or say "
            "by their numbers which are which, as in --columns "
            f"{_example_of(width, rows[0])} --unit uT"
        )
    return list("xyz")


def _name_first(rows: Sequence[Sequence[str]]) -> str:
    """What the first of four columns is without a name: a clock by its steady steps from row to
    row, a count of rows by steps of one; "" where it may be anything.

    >>> _name_first([[f"{0.04 * k:.2f}"] for k in range(30)])
    'time'
    >>> _name_first([[f"{k + 1}"] for k in range(30)]), _name_first([["1"], ["3"], ["2"]])
    ('row', '')
    """
    values = [to_number(row[0]) for row in rows if len(row) == len(rows[0])]
    steps = sorted(after - before for before, after in pairwise(values))
    if len(steps) < _STEPS or not steps[0] > 0:
        return ""
    if _counts_rows(rows):
        return "row"
    usual = steps[len(steps) // 2]
    steady = sum(usual / 2 < step < 2 * usual for step in steps)
    return "time" if steady > 0.9 * len(steps) else ""


def _counts_rows(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column counts the rows, from zero or one."""
    values = [to_number(row[0]) for row in rows if row]
    return bool(values) and values[0] in (0.0, 1.0) and all(b - a == 1 for a, b in pairwise(values))


def _example_of(width: int, first: Sequence[str]) -> str:
    """What to write of a table of so many columns, and with such a first row."""
    parts = [to_number(cell) for cell in first[:6]]
    if width > 8 and all(
        low <= part < end for part, (low, end) in zip(parts, _MOMENT, strict=True)
    ):
        return "year=1,month=2,day=3,hour=4,minute=5,second=6,x=7,y=8,z=9"
    if width == 4:
        return "time=1,x=2,y=3,z=4"
    if width == 9:
        return "acc_x_g=1,acc_y_g=2,acc_z_g=3,x=7,y=8,z=9"
    return "time=…,x=…,y=…,z=…"
