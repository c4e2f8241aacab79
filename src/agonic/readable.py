"""`Readable`: objects that say what they are in a few lines, as a page in notebooks, as a plot.

They can be pickled and copied deeply, though Python itself refuses to pickle a view of a mapping,
and forgets that an array was read-only.
"""

from __future__ import annotations

import copyreg
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import MappingProxyType
from typing import Any

import numpy as np

from agonic.misuse import explain_making

MOST_LINES = 12


class Readable:
    """What every public object can be asked for.

    `repr` is a few lines, `summary()` all that is to be said as text, `plot()` a figure of
    Matplotlib; notebooks show the page that the command line would write. What is said of a result
    stands above the wings, in `agonic.display`, and is loaded when it is asked for.
    """

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        if "__repr__" not in vars(cls):  # so that a dataclass makes none of its own
            cls.__repr__ = Readable.__repr__  # type: ignore[method-assign]
        if "__post_init__" in vars(cls):
            cls.__post_init__ = explain_making(vars(cls)["__post_init__"])  # type: ignore[attr-defined]

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state)
        _lock_arrays(state.values())  # a pickle and a copy are as read-only as what they are of

    def __repr__(self) -> str:
        head, *lines = self._say()
        return "\n  ".join([head, *lines[:MOST_LINES]])

    def _say(self) -> list[str]:
        """What it is, and a line for each thing to know of it."""
        name = type(self).__name__
        if not is_dataclass(self):
            return [name]
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        shown = {k: v for k, v in values.items() if not _is_empty(v)}
        wide = max(map(len, shown), default=0)
        return [name, *(f"{k:<{wide}}  {write_value(v)}" for k, v in shown.items())]

    def summary(self) -> str:
        """All that is to be said of it, as text."""
        return str(import_module("agonic.display").write_summary(self))

    def _repr_html_(self) -> str:
        return str(import_module("agonic.display").draw_page(self))

    def plot(self) -> Any:
        """What its page shows, as a figure of Matplotlib; needs agonic[plot]."""
        return import_module("agonic.display").plot(self)


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple | Mapping) and not value)


def write_value(value: Any) -> str:
    """A value in half a line: small arrays whole, large ones by their shape.

    >>> write_value([1.0, 2.5]), write_value("north"), write_value(None)
    ('[1.0, 2.5]', 'north', 'None')
    """
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        small = len(shape) == 1 and shape[0] <= 6
        numbers = (f"{float(one):.6g}" for one in value) if small else ()
        return f"[{', '.join(numbers)}]" if small else f"array {shape}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Sequence | Mapping) and not isinstance(value, str) and len(value) > 6:
        return f"{len(value)} items"
    if is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__
    if isinstance(value, tuple | list) and any(map(is_dataclass, value)):
        return ", ".join(type(one).__name__ for one in value)
    return str(value).splitlines()[0] if str(value) else ""


def restore_view(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """The read-only view of values that came out of a pickle."""
    return MappingProxyType(values)


def _lock_arrays(values: Iterable[Any]) -> None:
    """Make the arrays among values read-only, also those in views of mappings."""
    for value in values:
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        elif isinstance(value, MappingProxyType):
            _lock_arrays(value.values())


copyreg.pickle(MappingProxyType, lambda view: (restore_view, (dict(view),)))
