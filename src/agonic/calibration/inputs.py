"""What goes into a calibration: the readings, and what was recorded beside them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.sources import NAME, SOURCES, WIDTH, list_columns, parse_source
from agonic.errors import AgonicError
from agonic.samples import Samples


def measure_width(name: str) -> int:
    """How many numbers a row an input is: three for vectors, one for any other column."""
    return parse_source(name).width


def check_inputs(inputs: tuple[str, ...]) -> None:
    """Raise `AgonicError` where inputs of a network are none, named twice, or no columns.

    Beside those of `WIDTH` any column that tells what the vehicle does can be one. A network finds
    the form by itself, so powers, sums and delays have no place in it.
    """
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
    """The inputs (…, i), each in its form, of readings (…, 3), if any, and columns.

    A column that is one number is spread over the rows.
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
    """The names of the numbers that go in."""
    return tuple(
        signal
        for name in inputs
        for signal in ([f"{name}_{axis}" for axis in "xyz"] if WIDTH.get(name, 1) == 3 else [name])
    )
