"""Two examples of every command, as its help shows them: `examples.toml`."""

from __future__ import annotations

import tomllib
from pathlib import Path

EXAMPLES: dict[str, tuple[str, str]] = {
    command: (first, second)
    for command, (first, second) in tomllib.loads(
        Path(__file__).with_suffix(".toml").read_text("utf-8")
    ).items()
}
"""By the words that call a command: examples that are copied as they stand."""
