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
