"""How commands speak: JSON on stdout for programs, text for people, nothing half-written."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def print_json(schema: str, values: Mapping[str, Any]) -> None:
    """One JSON object with its schema's name first."""
    speaks_unicode = (sys.stdout.encoding or "utf-8").lower().replace("-", "") == "utf8"
    record = plain({"schema": schema, **values})
    print(json.dumps(record, ensure_ascii=not speaks_unicode, allow_nan=False))


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, paths as text, no number as null."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def finish_made(
    n: int,
    what: str,
    out: Path,
    *lines: str,
    record: Mapping[str, Any],
    as_json: bool,
    next_step: str = "",
    schema: str = "agonic/simulate@1",
) -> int:
    """Say that so many things were written to a file, what else is beside it, and a command to
    type; for programs, the record. Returns the exit status."""
    from agonic.console.terminal import find_width
    from agonic.report.digits import group_digits
    from agonic.report.text import wrap_command

    if as_json:
        print_json(schema, record)
        return 0
    say("\n".join([f"{group_digits(n)} {what}: {out}", *lines]))
    if next_step:
        say("\n" + wrap_command(next_step, width=find_width(), label="Next      "))
    return 0


def write_truth(kind: str, values: Mapping[str, Any], folder: Path) -> Path:
    """Write what is true of something simulated, as JSON in a folder of its own."""
    from agonic.atomic import make_folder, write_atomically

    record = plain({"schema": f"agonic/{kind}-truth@1", **values})
    text = json.dumps(record, indent=1, ensure_ascii=False)
    return write_atomically(make_folder(folder) / "truth.json", text + "\n")


def fit_lines(text: str, width: int) -> str:
    """Text whose lines are no longer than `width`, but for words that are. What goes on stands
    under where it began, after a label and two spaces."""
    import re
    import textwrap

    def fit(line: str) -> str:
        if len(line) <= width or line.rstrip().endswith("\\"):
            return line
        found = re.match(r"\s*(?:\S+ )*?\S+ {2,}(?=\S)|\s*", line)
        label = found[0] if found and len(found[0]) < width / 2 else ""
        return textwrap.fill(
            line[len(label) :],
            width,
            initial_indent=label,
            subsequent_indent=" " * len(label),
            break_long_words=False,
            break_on_hyphens=False,
        )

    return "\n".join(map(fit, text.split("\n")))


def say(text: str) -> None:
    """A line or more for people, as wide as the terminal, its verdicts coloured there."""
    from agonic.console.terminal import find_width

    text = fit_lines(text, find_width())
    if not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    painted = Text(text)
    for word, style in (("good", "bold green"), ("check", "bold yellow"), ("refused", "bold red")):
        painted.highlight_regex(rf"(?m)^[✓!✗] [^:\n]+: {word}\b", style)
    Console(highlight=False).print(painted, soft_wrap=True)
