"""`Valued`: calibrations that are equal where what they hold is, and that can be called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from agonic.readable import Readable

_DIGITS = 12  # of a rotation, which a file holds as a quaternion


class Valued(Readable):
    """Equal where all that it holds is equal, to the last bit of every number.

    >>> from agonic.calibration.affine import Affine
    >>> one, other = (Affine(bias=[1, 0, 0], matrix=np.eye(3)) for _ in range(2))
    >>> one == other, one == Affine(bias=[2, 0, 0], matrix=np.eye(3)), len({one, other})
    (True, False, 1)
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return bool(_key(self) == _key(other))

    def __hash__(self) -> int:
        return hash(_key(self))


def _key(value: Any) -> Any:
    """A value as what can be compared and hashed."""
    if hasattr(value, "as_matrix"):  # a Rotation; what only reads a log loads no SciPy
        return _key(value.as_matrix().round(_DIGITS))
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0.0).tobytes()  # the sum turns −0 into 0
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__, tuple(_key(getattr(value, f.name)) for f in fields(value))
    if isinstance(value, Mapping):
        return tuple(sorted((str(name), _key(one)) for name, one in value.items()))
    if isinstance(value, list | tuple):
        return tuple(map(_key, value))
    return value
