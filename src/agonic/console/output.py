"""How commands speak: JSON on stdout for programs, text for people, nothing half-written."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def print_json(schema: str, values: Mapping[str, Any]) -> None:
    """One JSON object with its schema's name first."""
    speaks_unicode = (sys.stdout.encoding or "utf-8").lower().replace("-", "") == "utf8"
    record = plain({"schema": schema, **values})
    print(json.dumps(record, ensure_ascii=not speaks_unicode, allow_nan=False))


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, what is not a number as null."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def say_made(n: int, what: str, out: object, *lines: str, next_step: str = "") -> None:
    """That so many things were written to a file, what else is beside it, and a command to type."""
    from agonic.console.width import find_width
    from agonic.report.digits import group_digits
    from agonic.report.text import wrap_command

    say("\n".join([f"{group_digits(n)} {what}: {out}", *lines]))
    if next_step:
        say("\n" + wrap_command(next_step, width=find_width(), label="Next      "))


def say(text: str) -> None:
    """A line or more for people, its verdicts coloured on a terminal."""
    if not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    painted = Text(text)
    for word, style in (("good", "bold green"), ("check", "bold yellow"), ("refused", "bold red")):
        painted.highlight_regex(rf"(?m)^[✓!✗] [^:\n]+: {word}\b", style)
    Console(highlight=False).print(painted, soft_wrap=True)
