"""`Readable`: objects that say what they are in a few lines, as a page in notebooks, as a plot.

They can be pickled and copied deeply, though Python itself refuses to pickle a view of a mapping,
and forgets that an array was read-only.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from datetime import datetime
from functools import cache
from math import inf, isfinite
from types import MappingProxyType
from typing import Any, NamedTuple, get_type_hints

from agonic.misuse import explain_making

MOST_LINES = 12
_IN_RECORDS = {"°": "deg", "%": "percent"}


_shown_by: list[Callable[[], Any]] = []


def show_by(load: Callable[[], Any]) -> None:
    """Let every object be shown by what `load` gives: `write_summary`, `draw_page` and `plot`."""
    _shown_by.append(load)


class Readable:
    """What every public object can be asked for.

    `repr` is a few lines, `summary()` all that is to be said as text, `plot()` a figure of
    Matplotlib; notebooks show the page that the command line would write. What is said of a result
    stands above the wings, in what `show_by` was told of, and is loaded when it is asked for.
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
        return str(_shown_by[-1]().write_summary(self))

    def _repr_html_(self) -> str:
        return str(_shown_by[-1]().draw_page(self))

    def plot(self) -> Any:
        """What its page shows, as a figure of Matplotlib; needs agonic[plot]."""
        return _shown_by[-1]().plot(self)


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | tuple | Mapping) and not value)


def write_value(value: Any) -> str:
    """A value in half a line: small arrays whole, large ones by their shape."""
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
        if hasattr(value, "setflags"):
            value.setflags(write=False)
        elif isinstance(value, MappingProxyType):
            _lock_arrays(value.values())


class Shown(NamedTuple):
    """How a field or property is shown: its `label`, "" where it is for programs alone; the `unit`,
    or in braces the field that names it; how many significant `digits`; the field `sd` of its
    standard error; `most`, from which on nothing is known; its `key` for programs, None for its own
    name, "" where it is for people alone; `write`, what writes it where it is no plain number."""

    label: str = ""
    unit: str = ""
    digits: int = 3
    sd: str = ""
    most: float = inf
    key: str | None = None
    write: Callable[[Any], str] | None = None


@cache
def list_shown(kind: Any) -> dict[str, Shown]:
    """How the fields and properties of a class are shown, by their names."""
    hints = get_type_hints(kind, include_extras=True)
    for one in reversed(kind.__mro__):
        made = {name: of.fget for name, of in vars(one).items() if isinstance(of, property)}
        hints |= {
            name: get_type_hints(get, include_extras=True).get("return")
            for name, get in made.items()
            if "Shown" in str(getattr(get, "__annotations__", {}).get("return"))
        }
    return {
        name: how
        for name, hint in hints.items()
        for how in getattr(hint, "__metadata__", ())
        if isinstance(how, Shown)
    }


def make_record(result: Any) -> dict[str, Any]:
    """The result for programs, and what it holds: what could not be had is null."""
    return {
        name if how.key is None else how.key: _record(getattr(result, name))
        for name, how in list_shown(result.__class__).items()
        if how.key != ""
    }


def _record(value: Any) -> Any:
    """A value for programs."""
    if isinstance(value, float) and not isfinite(value):
        return None
    if isinstance(value, str):
        return _IN_RECORDS.get(value, value)
    if isinstance(value, Mapping):
        return {str(name): _record(one) for name, one in value.items()}
    if isinstance(value, datetime):
        return value.isoformat()
    if (is_dataclass(value) or hasattr(value, "_fields")) and list_shown(value.__class__):
        return make_record(value)
    return [_record(one) for one in value] if isinstance(value, tuple | list) else value


copyreg.pickle(MappingProxyType, lambda view: (restore_view, (dict(view),)))
