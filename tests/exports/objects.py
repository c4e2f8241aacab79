"""Objects of C sources; one that was made before, of the same text, is not compiled again.

Much of what is exported is the same from setup to setup, and the code of a board always is.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

_MADE: dict[tuple[str, ...], bytes] = {}


def compile_once(command: Sequence[str | Path], source: Path, target: Path) -> Path:
    """The object of a source at `target`, as a compiler with its flags makes it."""
    key = (*map(str, command), _read_whole(source))
    if key not in _MADE:
        subprocess.run([*command, "-c", source, "-o", target], check=True)
        _MADE[key] = target.read_bytes()
    target.write_bytes(_MADE[key])
    return target


def _read_whole(source: Path) -> str:
    """The text of a source, and of the files beside it that it includes."""
    text = source.read_text()
    names = re.findall(r'^\s*#\s*include "(.+)"', text, re.MULTILINE)
    beside = [source.parent / name for name in names]
    return text + "".join(_read_whole(path) for path in beside if path.is_file())
