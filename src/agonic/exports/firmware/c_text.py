"""C text: numbers, arrays and templates."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.resources import files
from textwrap import wrap
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from agonic.calibration.sources import parse_source
from agonic.errors import AgonicError
from agonic.exports.banner import format_float32

WIDTH = 96


def write_literal(value: float) -> str:
    """A float constant that reads back as the same float32."""
    size = abs(np.float32(value))
    if size == 0.0 or 1e-7 < size < 1e9:
        return f"{format_float32(value)}f"
    return f"{np.format_float_scientific(np.float32(value), unique=True, trim='0')}f"


def write_integer(value: float) -> str:
    """An integer constant."""
    return str(round(value))


def write_array(
    values: ArrayLike, indent: str = "", *, write: Callable[[float], str] = write_literal
) -> str:
    """The initialiser of an array of any depth, a line for each row."""
    array = np.asarray(values, dtype=np.float64)
    inner = indent + "    "
    if array.ndim > 1:
        rows = "".join(f"{inner}{write_array(row, inner, write=write)},\n" for row in array)
        return f"{{\n{rows}{indent}}}"
    flat = ", ".join(map(write, array.tolist()))
    if len(indent) + len(flat) + 3 <= WIDTH:
        return f"{{{flat}}}"
    lines = wrap(flat, WIDTH - len(inner), initial_indent=inner, subsequent_indent=inner)
    return "{\n" + "\n".join(lines) + f"\n{indent}}}"


def write_comment(lines: Iterable[str]) -> str:
    """Lines of a block comment, plain ASCII, that nothing in them can end."""
    safe = (" ".join(line.split()).replace("/*", "/ *").replace("*/", "* /") for line in lines)
    plain = (line.encode("ascii", "backslashreplace").decode() for line in safe)
    return "\n".join(f" * {line}".rstrip() for line in plain)


_TAG = re.compile(
    r"^@([#^])(\w+)@\n(.*?)^@/\2@\n|@([#^])(\w+)@(.*?)@/\5@|@(\w+)@", re.MULTILINE | re.DOTALL
)


def fill_template(template: str, values: Mapping[str, Any]) -> str:
    """A template of this package with each @key@ replaced: text as it is, numbers and arrays as C.

    What is between @#key@ and @/key@ is there where the value is neither empty nor 0, once for
    each mapping of a list, with its values; what is between @^key@ and @/key@ is there where it is.
    Where they are not given, @GUARD@ is the name in capitals, and @flash@ the macros by which
    tables stay in flash on processors that else copy them to RAM.
    """
    usual = {"GUARD": str(values.get("name", "")).upper(), "flash": _read_template("flash.h.in")}
    return _expand(_read_template(template), usual | dict(values))


def fill_files(
    stem: str, folder: str, parts: Iterable[str], values: Mapping[str, Any]
) -> dict[str, str]:
    """The text of a header and of a source in parts, by file, from the templates of a folder."""
    sources = (fill_template(f"{folder}/{part}.c.in", values) for part in parts)
    header = fill_template(f"{folder}/header.h.in", values)
    return {f"{stem}.h": header, f"{stem}.c": "\n".join(sources)}


@cache
def _read_template(template: str) -> str:
    home = files("agonic.exports.firmware").joinpath("templates")
    return home.joinpath(template).read_text("utf-8")


def _expand(text: str, values: Mapping[str, Any]) -> str:
    """A text with its keys and sections replaced."""

    def find(tag: re.Match[str]) -> str:
        if tag[7]:
            return _write_value(values[tag[7]])
        kind, key, inner = tag.group(1, 2, 3) if tag[1] else tag.group(4, 5, 6)
        value = values[key]
        each = value if isinstance(value, list) else [value] if value else []
        if kind == "^":
            each = [] if each else [None]
        owned = (one if isinstance(one, Mapping) else {} for one in each)
        return "".join(_expand(inner, {**values, **own}) for own in owned)

    return _TAG.sub(find, text)


def _write_value(value: Any) -> str:
    """Text as it is, an integer, a float, or an array."""
    if isinstance(value, str | int):
        return str(value)
    return write_literal(value) if isinstance(value, float) else write_array(value)


def make_c_name(sensor: str) -> str:
    """What the identifiers of a sensor's C begin with, so that several go in one program. Where
    letters had to be replaced, a checksum of the name follows."""
    plain = re.sub(r"\[(\d+)\]$", r"_\1", sensor).lower()
    name = re.sub(r"[^a-z0-9_]", "_", plain)
    if name != plain:
        name += f"_{crc32(sensor.encode('utf-8', 'surrogatepass')):08x}"
    return name if name[:1].isalpha() else f"mag_{name}"


def require_identifier(name: str) -> str:
    """The name, where C takes it as one."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise AgonicError(f"name is a C identifier such as compass, not {name!r}")
    return name


def find_time_constants(sources: Iterable[str]) -> dict[str, float]:
    """The time constants of columns that have one, s."""
    found: dict[str, float] = {}
    for source in map(parse_source, sources):
        for column in source.columns:
            if found.setdefault(column, source.time_constant_s) != source.time_constant_s:
                raise AgonicError(
                    f"the compasses take {column} with different time constants, and the "
                    "controller gets it once: export a setup for each compass"
                )
    return {column: constant for column, constant in found.items() if constant}


def list_followed(constants: Mapping[str, float]) -> dict[str, Any]:
    """What the templates take of columns that go through a filter."""
    steps = [
        {"column": column, "constant": abs(constant), "k": k, "filtered": constant > 0}
        for k, (column, constant) in enumerate(constants.items())
    ]
    return {"steps": steps, "count": len(steps), "columns": ", ".join(constants)}
