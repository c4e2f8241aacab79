"""What goes into a calibration: the readings, and what was recorded beside them.

A source of disturbance is spelled as the column that tells of it, and the form in which it counts:

    heater_A            the column as it is
    motor1_duty^1.5     its size to a power: the current of a motor by its duty
    heater_A>0.5        1 where it is more, else 0: on or off
    esc1_A+esc2_A       the sum of several, each in the form that follows: they share their effect
    current_A@0.2       recorded 0.2 s late: its value then is what the log holds 0.2 s later
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
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

_NAME = r"[^\W\d]\w*"
_SPELLED = re.compile(
    rf"({_NAME}(?:\+{_NAME})*)(?:([\^>])([-+\d.eE]+))?(?:@([-+\d.eE]+))?", re.ASCII
)
_LARGEST_POWER = 8.0


class Source(NamedTuple):
    """Columns that tell of a disturbance, and the form in which each counts before they add up."""

    columns: tuple[str, ...]
    form: str = ""
    value: float = 0.0
    late_s: float = 0.0

    @property
    def width(self) -> int:
        """How many numbers it is a row."""
        return WIDTH.get(self.columns[0], 1)

    @property
    def off(self) -> float:
        """A value of its columns at which it counts nothing; at one more in a column, one."""
        return self.value if self.form == ">" else 0.0

    def evaluate(self, known: Mapping[str, ArrayLike]) -> Array:
        """What counts of the columns, (…) or (…, 3).

        >>> parse_source("motor1_duty^2").evaluate({"motor1_duty": [0.5, -0.5]}).tolist()
        [0.25, 0.25]
        >>> parse_source("heater_A>0.5").evaluate({"heater_A": [0.2, 3.0]}).tolist()
        [0.0, 1.0]
        """
        values = (np.asarray(known[name], dtype=np.float64) for name in self.columns)
        return np.asarray(sum(self._count(x) for x in values))

    def _count(self, x: Array) -> Array:
        if self.form == "^":
            return np.asarray(np.abs(x) ** self.value)
        return np.asarray(x > self.value, dtype=np.float64) if self.form == ">" else x


def parse_source(text: str) -> Source:
    """The source that a text spells: a column or a sum of some, to a power, or above a value.

    Raises `AgonicError` where it spells none.

    >>> parse_source("motor1_duty+motor2_duty^1.5")
    Source(columns=('motor1_duty', 'motor2_duty'), form='^', value=1.5, late_s=0.0)
    """
    found = _SPELLED.fullmatch(text.strip())
    try:
        columns, form, value, late = found.groups() if found else ("", "", "", "")
        numbers = (float(value or 0.0), float(late or 0.0))
        source = Source(tuple(columns.split("+")), form or "", *numbers)
    except ValueError:
        source = Source(("",))
    if not source.columns[0] or (source.form == "^" and not 0.0 < source.value <= _LARGEST_POWER):
        raise AgonicError(
            f"{text!r} names no source: give the column that tells of it, a power of it as "
            "motor1_duty^1.5, a sum as battery1_A+battery2_A, where it is on as heater_A>0.5, or "
            "how many seconds late it is recorded as current_A@0.2"
        )
    vectors = [name for name in source.columns if WIDTH.get(name, 1) > 1]
    if vectors and text.strip() != vectors[0]:
        raise AgonicError(f"{text!r}: {vectors[0]} is a vector and counts as it is")
    return source


def measure_width(name: str) -> int:
    """How many numbers a row an input is: three for vectors, one for any other column.

    >>> measure_width("field"), measure_width("motor1_duty")
    (3, 1)
    """
    return parse_source(name).width


def check_inputs(inputs: tuple[str, ...]) -> None:
    """Raise `AgonicError` where inputs of a network are none, named twice, or no columns.

    Beside those of `WIDTH` any column that tells what the vehicle does can be one. A network finds
    the form by itself, so powers, sums and delays have no place in it.
    """
    plain = all(n in WIDTH or ("_" in n and re.fullmatch(_NAME, n, re.ASCII)) for n in inputs)
    if not inputs or not plain or len(set(inputs)) < len(inputs):
        raise AgonicError(
            f"inputs must be some of {', '.join(WIDTH)}, or columns such as motor1_duty, each "
            f"once; given: {', '.join(inputs) or 'none'}"
        )


def list_columns(sources: Iterable[str]) -> tuple[str, ...]:
    """The columns that sources need, each once.

    >>> list_columns(("motor1_duty^1.5", "heater_A", "motor1_duty"))
    ('motor1_duty', 'heater_A')
    """
    return tuple(dict.fromkeys(name for one in sources for name in parse_source(one).columns))


def list_disturbers(samples: Samples) -> tuple[str, ...]:
    """The columns of samples that may tell of a disturbance.

    >>> list_disturbers(Samples(field=np.ones((2, 3)), disturbers={"heater_A": [0.0, 1.0]}))
    ('heater_A',)
    """
    return tuple(n for n in samples.columns() if n in SOURCES or n in samples.disturbers)


def find_delays(sources: Iterable[str]) -> dict[str, float]:
    """How late each column of sources is recorded, s, where it is.

    Raises `AgonicError` where a column would be late in two ways.

    >>> find_delays(("current_A@0.2", "throttle"))
    {'current_A': 0.2}
    """
    found: dict[str, float] = {}
    for source in map(parse_source, sources):
        for name in source.columns:
            if found.setdefault(name, source.late_s) != source.late_s:
                raise AgonicError(f"{name} is taken with two delays; it can have one")
    return {name: late for name, late in found.items() if late}


def undelay(columns: Mapping[str, Array], delays: Mapping[str, float]) -> dict[str, Array]:
    """The columns with those that are recorded late, s, brought to their moments by `time`.

    At the end, where nothing later is recorded, the last value holds.

    >>> log = {"time": np.array([0.0, 1.0, 2.0]), "heater_A": np.array([0.0, 1.0, 3.0])}
    >>> undelay(log, {"heater_A": 0.5})["heater_A"].tolist()
    [0.5, 2.0, 3.0]
    """
    late = {name: by for name, by in delays.items() if by and name in columns}
    if late and "time" not in columns:
        raise AgonicError(f"{', '.join(late)} is recorded late, which needs times; there are none")
    moved = {
        name: np.interp(columns["time"] + by, columns["time"], columns[name])
        for name, by in late.items()
    }
    return {**columns, **moved}


def stack_inputs(
    inputs: tuple[str, ...], raw: ArrayLike | None, columns: Mapping[str, ArrayLike]
) -> Array:
    """The inputs (…, i), each in its form, of readings (…, 3), if any, and columns.

    A column that is one number is spread over the rows.

    >>> stack_inputs(("field", "temperature"), [[1.0, 2.0, 3.0]], {"temperature": 20.0}).tolist()
    [[1.0, 2.0, 3.0, 20.0]]
    """
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
    """The names of the numbers that go in.

    >>> signals(("field", "current_A"))
    ('field_x', 'field_y', 'field_z', 'current_A')
    """
    return tuple(
        signal
        for name in inputs
        for signal in ([f"{name}_{axis}" for axis in "xyz"] if WIDTH.get(name, 1) == 3 else [name])
    )
