"""Results that describe themselves: what is shown of a class, with label, unit and digits.

Screen, page and JSON show such results from the annotations of their fields and properties, so that
a value is described once:

    @dataclass(frozen=True, kw_only=True)
    class Found:
        name: Annotated[str, Shown("Fit")]
        error_deg: Annotated[float, Shown("Heading error", "°", 2, sd="error_sd_deg")]
        error_sd_deg: Annotated[float, Shown()]

What says nothing of itself is not shown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

from agonic.readable import list_shown
from agonic.report.digits import group_digits, percent, quantity, with_sd
from agonic.report.section import Table
from agonic.report.tables import NOTHING

FRACTION = "fraction"
"""Unit of what is shown in per cent."""


def write_field(result: Any, name: str) -> str:
    """The value of a field as it is shown; a dash for what could not be had."""
    how, value = list_shown(result.__class__)[name], getattr(result, name)
    if value is None:
        return NOTHING
    if how.write is not None:
        return how.write(value)
    if isinstance(value, str):
        return value
    if isinstance(value, int) and not how.unit:
        return group_digits(value)
    if not isfinite(value) or value >= how.most:
        return NOTHING
    if how.unit == FRACTION:
        return percent(value)
    unit = getattr(result, how.unit[1:-1]) if how.unit.startswith("{") else how.unit
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
    heads = {name: how.label for name, how in list_shown(results[0].__class__).items() if how.label}
    rows = [[write_field(one, name) for name in heads] for one in results]
    for row, one in zip(rows, results, strict=True):
        row[0] = f"{'✓ ' if taken(one) else ''}{row[0]}"
    return Table([*heads.values()], rows, style, scrolls)
