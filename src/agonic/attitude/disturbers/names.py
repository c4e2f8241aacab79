"""Sources of disturbance by name, for sentences: `motor1…4_duty^1.5`."""

from __future__ import annotations

import re
from collections.abc import Sequence

from agonic.calibration.sources import parse_source

MEMBER = re.compile(r"\d+|(?<=_)[xyz](?=_)")
"""What tells the members of a family apart: motor1_duty, motor2_duty; torquer_x_Am2."""


_PARTS = re.compile(f"({MEMBER.pattern})")


def describe_sources(sources: Sequence[str]) -> str:
    """Sources and what they do, for a sentence: "the current moves".

    >>> describe_sources(("current_A",))
    'the current moves'
    >>> describe_sources(("motor1_duty^1.5", "motor2_duty^1.5", "heater_A"))
    'motor1…2_duty^1.5, heater_A move'
    """
    if tuple(sources) == ("current_A",):
        return "the current moves"
    one = len(sources) == 1 and "+" not in sources[0]
    return f"{name_sources(sources)} {'moves' if one else 'move'}"


def name_sources(sources: Sequence[str]) -> str:
    """Sources by name, those that differ in a number together.

    >>> name_sources(("esc1_A+esc2_A+esc3_A",)), name_sources(("rod_x_Am2", "rod_z_Am2"))
    ('the sum of esc1…3_A', 'rod_x…z_Am2')
    """
    named: list[str] = []
    families: dict[str, list[str]] = {}
    for source in sources:
        if "+" in source:
            columns, form = _split_form(source)
            named.append(f"the sum of {_join_numbers(columns)}{form}")
        else:
            families.setdefault(MEMBER.sub("#", source), []).append(source)
    return ", ".join([*named, *(_join_numbers(family) for family in families.values())])


def _split_form(source: str) -> tuple[list[str], str]:
    """The columns of a sum, and the form in which they count."""
    columns = list(parse_source(source).columns)
    return columns, source.removeprefix("+".join(columns))


def _join_numbers(family: Sequence[str]) -> str:
    """Names that differ in one number or axis as one: motor1…4_duty, torquer_x…z_Am2."""
    first, last = (_PARTS.split(name) for name in (family[0], family[-1]))
    apart = [k for k, (one, other) in enumerate(zip(first, last, strict=False)) if one != other]
    if len(apart) != 1 or len(first) != len(last):
        return ", ".join(family)
    first[apart[0]] += f"…{last[apart[0]]}"
    return "".join(first)
