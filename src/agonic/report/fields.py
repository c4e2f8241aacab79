"""Results that describe themselves: each field of a dataclass with its label, unit and digits.

Screen, page and JSON show such results from these alone, so that a value is described once:

    @dataclass(frozen=True, kw_only=True)
    class Found:
        name: str = shown("Fit")
        error_deg: float = shown("Heading error", "°", 2, sd="error_sd_deg")
        error_sd_deg: float = shown()
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, fields
from math import inf, isfinite
from typing import Any, NamedTuple

from agonic.report.digits import group_digits, percent, quantity, with_sd
from agonic.report.section import Table
from agonic.report.tables import NOTHING

FRACTION = "fraction"
"""Unit of what is shown in per cent."""
_IN_RECORDS = {"°": "deg", "%": "percent"}


class Shown(NamedTuple):
    """How a field is shown: its `label`, "" where it is for programs alone; the `unit`, or in
    braces the field that names it; how many significant `digits`; the field `sd` of its standard
    error; `most`, from which on nothing is known; whether it is part of the `record`."""

    label: str = ""
    unit: str = ""
    digits: int = 3
    sd: str = ""
    most: float = inf
    record: bool = True


def shown(
    label: str = "",
    unit: str = "",
    digits: int = 3,
    *,
    sd: str = "",
    most: float = inf,
    record: bool = True,
    **given: Any,
) -> Any:
    """A field of a dataclass that is shown so; `given` as for `dataclasses.field`."""
    return field(metadata={"shown": Shown(label, unit, digits, sd, most, record)}, **given)


def list_shown(kind: Any) -> dict[str, Shown]:
    """How the fields of a dataclass, or of one of its kind, are shown, by their names."""
    return {one.name: one.metadata.get("shown", Shown()) for one in fields(kind)}


def write_field(result: Any, name: str) -> str:
    """The value of a field as it is shown.

    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Found:
    ...     error: float = shown("Error", "°", sd="sd")
    ...     sd: float = shown()
    >>> write_field(Found(1.234, 0.0), "error"), write_field(Found(float("nan"), 0.1), "error")
    ('1.23°', '–')
    """
    how, value = list_shown(type(result))[name], getattr(result, name)
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return group_digits(value)
    if value is None or not isfinite(value) or value >= how.most:
        return NOTHING
    if how.unit == FRACTION:
        return percent(value)
    unit = how.unit.format_map(vars(result))
    sd = getattr(result, how.sd) if how.sd else 0.0
    if sd > 0.01 * abs(value):  # or it would not be seen
        return f"{with_sd(value, sd)}{unit if unit == '°' else f' {unit}'}"
    return quantity(value, unit, how.digits)


def make_table(
    results: Sequence[Any],
    *,
    taken: Callable[[Any], bool] = lambda _: False,
    style: str = "numbers",
    scrolls: bool = False,
) -> Table:
    """The results of one kind, a row each; those that are `taken` have a tick."""
    heads = {name: how.label for name, how in list_shown(type(results[0])).items() if how.label}
    rows = [[write_field(one, name) for name in heads] for one in results]
    for row, one in zip(rows, results, strict=True):
        row[0] = f"{'✓ ' if taken(one) else ''}{row[0]}"
    return Table([*heads.values()], rows, style, scrolls)


def make_record(result: Any) -> dict[str, Any]:
    """The result for programs: what could not be had is null."""
    record = {}
    for name, how in list_shown(type(result)).items():
        value = getattr(result, name)
        if isinstance(value, float) and not isfinite(value):
            value = None
        if isinstance(value, str):
            value = _IN_RECORDS.get(value, value)
        if how.record:
            record[name] = value
    return record
