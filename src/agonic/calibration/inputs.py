"""What goes into a calibration: the readings, and what was recorded beside them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError

SOURCES = {"current_A": 1, "throttle": 1, "second": 3}
"""The columns of samples that can tell of a disturbance, and how many numbers each has a row."""

WIDTH = {"field": 3, "temperature": 1, "temperature_rate": 1, **SOURCES}
"""What can be an input of a network, and how many numbers it has a row; `field` is the reading."""


def stack_inputs(
    inputs: tuple[str, ...], raw: ArrayLike | None, columns: Mapping[str, ArrayLike]
) -> Array:
    """The inputs (…, i) as they are, from readings (…, 3), if any, and columns; numbers are spread.

    >>> stack_inputs(("field", "temperature"), [[1.0, 2.0, 3.0]], {"temperature": 20.0}).tolist()
    [[1.0, 2.0, 3.0, 20.0]]
    """
    known = columns if raw is None else {**columns, "field": raw}
    missing = [name for name in inputs if name not in known]
    if missing:
        what = "calibration" if raw is None else "network"
        raise AgonicError(f"this {what} needs {', '.join(missing)} beside the readings")
    values = [np.asarray(known[name], dtype=np.float64) for name in inputs]
    parts = [v if WIDTH[n] == 3 else v[..., None] for n, v in zip(inputs, values, strict=True)]
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
        for signal in ([f"{name}_{axis}" for axis in "xyz"] if WIDTH.get(name) == 3 else [name])
    )
