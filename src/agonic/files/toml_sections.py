"""Sections of a TOML description as structs, every mistake in them named in plain words."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes
from agonic.logs.formats import name_content


def write_value(value: Any) -> str:
    """A text, number or list as a value of TOML: as in JSON, but for the delete character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


Made = TypeVar("Made")


def read_toml(path: Path, needed: str = "a description in TOML is needed") -> dict[str, Any]:
    """The tables of a TOML file, or a `LogError` that says why there are none. `needed` says what
    the file should be."""
    data = read_bytes(path)
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        written = path.suffix == ".toml" and data.strip()
        what = f"not TOML ({error})" if written else name_content(data)
        raise LogError(f"this is {what}, and {needed}", path=path) from None


def read_section(
    table: Any, kind: type[Any], where: str, mistakes: list[str], beside: Sequence[str] = ()
) -> Any:
    """A section as it should be, or `None` with every mistake in it noted. `kind` is a `Struct` or
    a dataclass; `beside` are the sections that may stand in the same place, for the list of what is
    known."""
    if table is None:
        return None
    if not isinstance(table, Mapping):
        mistakes.append(f"{where} must be a section with keys, not {table!r}")
        return None
    before = len(mistakes)
    hints = get_type_hints(kind)
    unknown = [key for key in table if key not in hints]
    if unknown:
        shown = ", ".join(f"`{key}`" for key in unknown)
        known = ", ".join([*hints, *(f"[{name}]" for name in beside)])
        mistakes.append(f"{where} has no key {shown} (its keys: {known})")
    for key in (key for key in table if key in hints):
        try:
            msgspec.convert(table[key], hints[key])
        except msgspec.ValidationError as error:
            mistakes.append(f"{where} `{key}` {_word_mistake(table[key], hints[key], error)}")
    known_fields = msgspec.inspect.type_info(kind).fields  # type: ignore[attr-defined]
    needed = [f.name for f in known_fields if f.required and f.name not in table]
    if needed:
        mistakes.append(f"{where} needs {', '.join(f'`{key}`' for key in needed)}")
    if len(mistakes) > before:
        return None
    return try_to_make(lambda: msgspec.convert(dict(table), kind), where, mistakes)


def _word_mistake(value: Any, hint: Any, error: msgspec.ValidationError) -> str:
    """A value that cannot be, with the choices where there are some."""
    hints = (hint, *get_args(hint))
    choices = [one for kind in hints if get_origin(kind) is Literal for one in get_args(kind)]
    if choices:
        choices = ["a number"] * (float in hints) + choices
        return f"{value!r} is not known; use one of {', '.join(map(str, choices))}"
    return str(error).replace("Expected", "expected").replace(" | null", "")


def try_to_make(make: Callable[[], Made], where: str, mistakes: list[str]) -> Made | None:
    """What is made, or `None` and its mistake noted."""
    try:
        return make()
    except (AgonicError, msgspec.ValidationError) as error:
        mistakes.append(f"{where}: {error}")
        return None
