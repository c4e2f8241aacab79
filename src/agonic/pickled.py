"""Pickles and deep copies of objects that hold views of mappings and read-only arrays.

Python itself refuses to pickle a view of a mapping, and forgets that an array was read-only.
"""

from __future__ import annotations

import copyreg
from collections.abc import Iterable
from types import MappingProxyType
from typing import Any

import numpy as np


def restore_view(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """The read-only view of values that came out of a pickle."""
    return MappingProxyType(values)


def lock_arrays(values: Iterable[Any]) -> None:
    """Make the arrays among values read-only, also those in views of mappings."""
    for value in values:
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        elif isinstance(value, MappingProxyType):
            lock_arrays(value.values())


copyreg.pickle(MappingProxyType, lambda view: (restore_view, (dict(view),)))
