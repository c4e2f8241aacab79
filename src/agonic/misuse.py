"""What a public function is given: taken in any form that says the same, and explained where it
cannot be."""

from __future__ import annotations

import re
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import fields
from functools import cache, wraps
from importlib import import_module
from inspect import getdoc, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, NamedTuple

from agonic.errors import AgonicError


class Form(NamedTuple):
    """What is taken for a noun, in words; the module and the function that make one of it."""

    words: str
    module: str
    function: str


FORMS = {
    "Samples": Form(
        "Samples, readings (n, 3), a table with named columns, or the path of a recording",
        "agonic.logs.any_form",
        "as_samples",
    ),
    "Reference": Form("a Reference, or magnitudes in nT", "agonic.reference", "as_reference"),
    "Calibration": Form(
        "a calibration, a fit, or the path of a calibration file",
        "agonic.files.calibration",
        "as_calibration",
    ),
    "Setup": Form(
        "a Setup, a calibration or a fit, or the path of a setup file",
        "agonic.files.setup",
        "as_setup",
    ),
}
"""The nouns that may be given in another form, wherever a public function takes one."""

_CAUGHT = (TypeError, AttributeError, ValueError, LookupError, NotImplementedError)
_ARRAYS = ("ndarray", "NDArray")
"""What an annotated array is called; from NumPy 2.5 on the alias keeps its own name."""


def explain_misuse(function: Callable[..., Any], package: str) -> Callable[..., Any]:
    """A function that takes nouns in any of their forms, and says so where it failed because of a
    type that it does not take.

    What was given is compared with the other annotations only then, so that nothing is paid for it.
    An error that has another cause stays what it is.
    """

    @wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        try:
            return function(*_as_meant(function, args, given), **given)
        except AgonicError:
            raise
        except _CAUGHT:
            said = _describe_misuse(function, args, given)
            if not said:
                raise
        raise AgonicError(said)

    call.__module__ = package  # so that it can be pickled by its public name
    call.__qualname__ = function.__name__
    return call


def _as_meant(function: Callable[..., Any], args: tuple[Any, ...], given: dict[str, Any]) -> Any:
    """The arguments, those by name replaced in place, each noun made of the form that it has."""
    nouns = _find_nouns(function)
    if not nouns:
        return args
    named = {name: _make_noun(given[name], *nouns[name]) for name in nouns.keys() & given.keys()}
    given |= named
    order = _list_parameters(function)[: len(args)]
    placed = (nouns.get(name, (None, None)) for name in order)
    rest = args[len(order) :]
    return *(_make_noun(value, *one) for value, one in zip(args, placed, strict=False)), *rest


@cache
def _list_parameters(function: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(signature(function).parameters)


@cache
def _find_nouns(function: Callable[..., Any]) -> dict[str, tuple[Any, str]]:
    """The annotation of each parameter that is one of the nouns, and which; but of those that take
    paths by themselves."""
    try:
        hints = typing.get_type_hints(function)
    except (TypeError, NameError):
        return {}
    found = {name: (hint, _name_noun(hint)) for name, hint in hints.items() if name != "return"}
    return {name: one for name, one in found.items() if one[1] and Path not in _list_parts(one[0])}


def _name_noun(hint: Any) -> str:
    """The noun that an annotation, or a part of it, asks for; "" where none is."""
    for one in _list_parts(hint):
        for base in getattr(one, "__mro__", ()):
            name = "Calibration" if base.__name__ == "Correction" else base.__name__
            if name in FORMS:
                return name
    return ""


def _list_parts(hint: Any) -> tuple[Any, ...]:
    """The annotations that a union is of; of another, itself."""
    is_union = typing.get_origin(hint) in (typing.Union, UnionType)
    return typing.get_args(hint) if is_union else (hint,)


def _make_noun(value: Any, hint: Any, noun: str | None) -> Any:
    """The noun that was meant; the value itself where it says none."""
    if noun is None or value is None or is_a(value, hint):
        return value
    fitted = getattr(getattr(value, "fit", value), "calibration", None)
    own = type(value).__module__.startswith("agonic.")
    if (own and fitted is None) or (own and noun in ("Samples", "Reference")):
        return value
    if isinstance(value, float | int) and noun != "Reference":
        return value
    form = FORMS[noun]
    return getattr(import_module(form.module), form.function)(value if fitted is None else fitted)


def explain_making(check: Callable[[Any], None]) -> Callable[[Any], None]:
    """The same for `check`, the `__post_init__` of a class."""

    @wraps(check)
    def made(self: Any) -> None:
        try:
            check(self)
        except AgonicError:
            raise
        except _CAUGHT:
            given = {one.name: getattr(self, one.name, None) for one in fields(self)}
            said = _describe_misuse(type(self), (), given)
            if not said:
                raise
        else:
            return
        raise AgonicError(said)

    return made


def _describe_misuse(
    function: Callable[..., Any], args: tuple[Any, ...], given: dict[str, Any]
) -> str:
    """What is wrong with the arguments, in a sentence; nothing where none is found."""
    try:
        bound = signature(function).bind(*args, **given).arguments
        hints = typing.get_type_hints(getattr(function, "__wrapped__", function))
    except (TypeError, NameError):
        return ""
    wrong = [name for name, value in bound.items() if not is_a(value, hints.get(name, Any))]
    return "; ".join(
        f"{function.__name__}: {name} was given as {describe_kind(bound[name])}; needed: "
        f"{_describe_parameter(function, name, hints[name])}"
        for name in wrong
    )


def describe_kind(value: Any) -> str:
    """What a value is, in a word or two."""
    if value is None:
        return "None"
    short = isinstance(value, bool | int | float | str) and len(repr(value)) < 40
    shape = getattr(value, "shape", None)
    more = f" ({value!r})" if short else f" of shape {shape}" if isinstance(shape, tuple) else ""
    return f"{type(value).__name__}{more}"


def _describe_parameter(function: Callable[..., Any], name: str, hint: Any) -> str:
    """What a parameter is: in the words of its noun, as the docstring says it, or its type."""
    if noun := _name_noun(hint):
        return FORMS[noun].words
    said = (getdoc(function) or "").partition("\nExamples")[0].split(">>>")[0]
    found = re.search(rf"\b{name}\b[^:\n]* : (.+?)(?:[.;]\s|\n\s*\n|\n\S|$)", said, re.DOTALL)
    words = " ".join(found[1].split()) if found else ""
    return words or getattr(hint, "__name__", str(hint)).replace("typing.", "")


def is_a(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated type, as far as that can be told."""
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any or isinstance(hint, typing.TypeVar):
        return True
    if hint is None or hint is NoneType:
        return value is None
    if origin is typing.Union or origin is UnionType:
        words_are_paths = any(one is Path for one in inside)
        numbers = any(_is_of_numpy(one) for one in inside)
        if isinstance(value, str) and numbers and not words_are_paths:  # what ArrayLike would take
            return False
        return any(is_a(value, one) for one in inside)
    if origin is typing.Literal:
        return value in inside
    if origin is typing.Annotated:
        return is_a(value, inside[0])
    if _is_of_numpy(hint):
        return _is_numeric(value, scalar=getattr(origin, "__name__", "") not in _ARRAYS)
    if origin is not None:
        return _is_made_of(value, origin, inside)
    if not isinstance(hint, type):
        return True
    if hint in (float, int, complex):
        return not isinstance(value, str) and hasattr(value, "__float__") and value is not True
    if getattr(hint, "_is_protocol", False):
        wanted = {*vars(hint), *getattr(hint, "__annotations__", {})}
        return all(hasattr(value, one) for one in wanted if not one.startswith("_"))
    return isinstance(value, hint)


def _is_of_numpy(hint: Any) -> bool:
    module = getattr(typing.get_origin(hint) or hint, "__module__", "")
    return str(module).startswith("numpy")


def _is_numeric(value: Any, *, scalar: bool) -> bool:
    """Whether a value becomes an array of numbers, or where that will do a single one."""
    import numpy as np

    try:
        array = np.asarray(value, dtype=np.float64)
        return value is not None and bool(array.size) and (scalar or array.ndim > 0)
    except (TypeError, ValueError, AgonicError):
        return False


def _is_made_of(value: Any, origin: Any, inside: tuple[Any, ...]) -> bool:
    """Whether a value is a container of what it should hold."""
    if not isinstance(origin, type) or not isinstance(value, origin):
        return not isinstance(origin, type)
    if issubclass(origin, Mapping) or not issubclass(origin, Iterable) or not inside:
        return True
    if isinstance(value, str | bytes):
        return False
    if not isinstance(value, Collection):
        return True
    kinds = [one for one in inside if one is not ...]
    return all(any(is_a(one, kind) for kind in kinds) for one in list(value)[:3])
