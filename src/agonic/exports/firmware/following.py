"""C for columns that go through a filter: one step of a first-order recursion for each reading."""

from __future__ import annotations

from collections.abc import Iterable

from agonic.calibration.sources import parse_source
from agonic.errors import AgonicError
from agonic.exports.firmware.c_text import fill_template, write_literal

FILTERED = """\
    {{ /* {column} is recorded through a filter, which is undone */
        const float given = in->{column};
        const float grown = expf(step_s / {constant}) - 1.0f;
        if (memory->begun && grown > 0.0f) {{
            in->{column} += (given - memory->last[{k}]) / grown;
        }}
        memory->last[{k}] = given;
    }}"""
FOLLOWED = """\
    {{ /* the field follows {column} */
        if (memory->begun) {{
            in->{column} -= (in->{column} - memory->last[{k}]) * expf(-step_s / {constant});
        }}
        memory->last[{k}] = in->{column};
    }}"""


def find_time_constants(sources: Iterable[str]) -> dict[str, float]:
    """The time constants of columns that have one, s.

    Raises `AgonicError` where compasses take a column with different ones.

    >>> find_time_constants(("current_A~0.3", "motor1_duty^1.5"))
    {'current_A': 0.3}
    """
    found: dict[str, float] = {}
    for source in map(parse_source, sources):
        for column in source.columns:
            if found.setdefault(column, source.time_constant_s) != source.time_constant_s:
                raise AgonicError(
                    f"the compasses take {column} with different time constants, and the "
                    "controller gets it once: export a setup for each compass"
                )
    return {column: constant for column, constant in found.items() if constant}


def write_following_header(constants: dict[str, float], name: str) -> str:
    """What the header declares; nothing where no column goes through a filter."""
    if not constants:
        return ""
    values = {"name": name, "count": str(len(constants)), "columns": ", ".join(constants)}
    return fill_template("follow.h.in", values)


def write_following(constants: dict[str, float], name: str) -> str:
    """The function that the header declares."""
    steps = [
        (FILTERED if constant > 0 else FOLLOWED).format(
            column=column, constant=write_literal(abs(constant)), k=k
        )
        for k, (column, constant) in enumerate(constants.items())
    ]
    return fill_template("follow.c.in", {"name": name, "steps": "\n".join(steps)})
