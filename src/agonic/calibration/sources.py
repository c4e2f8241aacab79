"""A source of disturbance by its spelling: the column that tells of it, and how it counts.

heater_A            the column as it is
motor1_duty^1.5     its size to a power: the current of a motor by its duty
heater_A>0.5        1 where it is more, else 0: on or off
esc1_A+esc2_A       the sum of several, each in the form that follows: they share their effect
current_A@0.2       recorded 0.2 s late: its value then is what the log holds 0.2 s later
current_A~0.3       recorded through a filter with a time constant of 0.3 s, which is undone
rod_x_Am2~-2        the field follows it, with a time constant of 2 s
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.samples import Samples

SOURCES = {"current_A": 1, "throttle": 1, "second": 3}
"""The sources that a log may hold whatever the vehicle, and how many numbers each has a row."""

WIDTH = {"field": 3, "temperature": 1, "temperature_rate": 1, **SOURCES}
"""Numbers a row of what can be an input; one where it is not named. `field` is the reading."""

NAME = r"[^\W\d]\w*"
_SPELLED = re.compile(
    rf"({NAME}(?:\+{NAME})*)(?:([\^>])([-+\d.eE]+))?(?:@([-+\d.eE]+))?(?:~([-+\d.eE]+))?",
    re.ASCII,
)
MEMBER = re.compile(r"\d+|(?<=_)[xyz](?=_)")
"""What tells the members of a family apart: motor1_duty, motor2_duty; torquer_x_Am2."""
_PARTS = re.compile(f"({MEMBER.pattern})")


class Source(NamedTuple):
    """Columns that tell of a disturbance, and the form in which each counts before they add up."""

    columns: tuple[str, ...]
    form: str = ""
    value: float = 0.0
    late_s: float = 0.0
    time_constant_s: float = 0.0

    @property
    def width(self) -> int:
        """How many numbers it is a row."""
        return WIDTH.get(self.columns[0], 1)

    @property
    def off(self) -> float:
        """A value of its columns at which it counts nothing; at one more in a column, one."""
        return self.value if self.form == ">" else 0.0

    def evaluate(self, known: Mapping[str, ArrayLike]) -> Array:
        """What counts of the columns, (…) or (…, 3)."""
        values = (np.asarray(known[name], dtype=np.float64) for name in self.columns)
        return np.asarray(sum(self._count(x) for x in values))

    def _count(self, x: Array) -> Array:
        if self.form == "^":
            return np.asarray(np.abs(x) ** self.value)
        return np.asarray(x > self.value, dtype=np.float64) if self.form == ">" else x


@lru_cache(maxsize=256)
def parse_source(text: str) -> Source:
    """The source that a text spells: a column or a sum of some, to a power, or above a value."""
    found = _SPELLED.fullmatch(text.strip())
    try:
        columns, form, *numbers = found.groups() if found else ("", "")
        source = Source(tuple(columns.split("+")), form or "", *(float(x or 0.0) for x in numbers))
    except ValueError:
        source = Source(("",))
    if not source.columns[0] or (source.form == "^" and not 0.0 < source.value <= 8.0):
        raise AgonicError(
            f"{text!r} is not a source: give its column, a power of it as "
            "motor1_duty^1.5, a sum as battery1_A+battery2_A, where it is on as heater_A>0.5, how "
            "many seconds late it is recorded as current_A@0.2, or the time constant of its filter "
            "as current_A~0.3 (the field follows it: rod_x_Am2~-2)"
        )
    vectors = [name for name in source.columns if WIDTH.get(name, 1) > 1]
    if vectors and text.strip() != vectors[0]:
        raise AgonicError(f"{text!r}: {vectors[0]} is a vector and is used as it is")
    return source


def spell_source(source: Source) -> str:
    """The text that `parse_source` reads as a source."""
    form = f"{source.form}{source.value:g}" if source.form else ""
    late = f"@{source.late_s:g}" if source.late_s else ""
    filtered = f"~{source.time_constant_s:g}" if source.time_constant_s else ""
    return f"{'+'.join(source.columns)}{form}{late}{filtered}"


def list_columns(sources: Iterable[str]) -> tuple[str, ...]:
    """The columns that sources need, each once."""
    return tuple(dict.fromkeys(name for one in sources for name in parse_source(one).columns))


def describe_sources(sources: Sequence[str]) -> str:
    """Sources and what they do, for a sentence: "the current moves"."""
    if tuple(sources) == ("current_A",):
        return "the current moves"
    one = len(sources) == 1 and "+" not in sources[0]
    return f"{name_sources(sources)} {'moves' if one else 'move'}"


def name_sources(sources: Sequence[str]) -> str:
    """Sources by name, those that differ in a number together."""
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


def measure_width(name: str) -> int:
    """How many numbers a row an input is: three for vectors, one for any other column."""
    return parse_source(name).width


def check_inputs(inputs: tuple[str, ...]) -> None:
    """Raise `AgonicError` where inputs of a network are none, named twice, or no columns. Beside
    those of `WIDTH` any column that tells what the vehicle does can be one. A network finds the
    form by itself, so powers, sums and delays have no place in it."""
    plain = all(n in WIDTH or ("_" in n and re.fullmatch(NAME, n, re.ASCII)) for n in inputs)
    if not inputs or not plain or len(set(inputs)) < len(inputs):
        raise AgonicError(
            f"inputs must be some of {', '.join(WIDTH)}, or columns such as motor1_duty, each "
            f"once; given: {', '.join(inputs) or 'none'}"
        )


def list_disturbers(samples: Samples) -> tuple[str, ...]:
    """The columns of samples that may tell of a disturbance."""
    return tuple(n for n in samples.columns() if n in SOURCES or n in samples.disturbers)


def stack_inputs(
    inputs: tuple[str, ...], raw: ArrayLike | None, columns: Mapping[str, ArrayLike]
) -> Array:
    """The inputs (…, i), each in its form, of readings (…, 3), if any, and columns. A column that
    is one number is spread over the rows."""
    known = columns if raw is None else {**columns, "field": raw}
    sources = [parse_source(name) for name in inputs]
    missing = [name for name in list_columns(inputs) if name not in known]
    if missing:
        what = "calibration" if raw is None else "network"
        raise AgonicError(f"this {what} needs {', '.join(missing)} beside the readings")
    values = [one.evaluate(known) for one in sources]
    parts = [v if s.width == 3 else v[..., None] for s, v in zip(sources, values, strict=True)]
    rows = [part.shape[:-1] for part in parts] + ([] if raw is None else [np.shape(raw)[:-1]])
    shape = np.broadcast_shapes(*rows)
    return np.concatenate([np.broadcast_to(p, (*shape, p.shape[-1])) for p in parts], axis=-1)


def signals(inputs: tuple[str, ...]) -> tuple[str, ...]:
    """The names of the numbers that go in."""
    return tuple(
        signal
        for name in inputs
        for signal in ([f"{name}_{axis}" for axis in "xyz"] if WIDTH.get(name, 1) == 3 else [name])
    )
