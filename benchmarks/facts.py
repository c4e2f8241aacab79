"""What a table was made by: command, day, versions, machine.

python -m benchmarks.facts PACKAGE …, in the environment that is asked about.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

NOT_INSTALLED = "not installed"
ALWAYS = ("numpy", "scipy", "numba")


def describe(commands: Sequence[str], seconds: float, load: float, made_with: str) -> str:
    """The last lines of a table: how anyone makes it again, and what made this one."""
    typed = " and ".join(f"`python -m {command}`" for command in commands)
    return (
        f"Made by {typed} in {seconds:.0f} s on {datetime.now(UTC):%Y-%m-%d}.\n"
        f"{made_with}.\n"
        f"{machine()}, load {load:.1f} from other work when it began."
    )


def software(rivals: Sequence[str] = ()) -> str:
    """agonic with its commit, Python, what it computes with, and what it stands beside."""
    used = ", ".join(map(name_version, ALWAYS))
    beside = ", ".join(name_version(rival) for rival in rivals if rival not in ALWAYS)
    ours = f"agonic {version('agonic')}{_commit()}, Python {platform.python_version()}, {used}"
    return f"{ours}; beside {beside}" if beside else ours


def machine() -> str:
    """Cores, processor, memory, system."""
    return f"{os.cpu_count()} cores{_processor()}, {_memory()}{platform.system()}"


def name_version(package: str) -> str:
    """A package and its version, as `scipy 1.17.1`.

    >>> name_version("no-such-package")
    'no-such-package not installed'
    """
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return f"{package} {NOT_INSTALLED}"


def _commit() -> str:
    """The commit of the tree that was measured, where git knows it, and whether files differ from
    it; the tables that a run itself has written do not count."""
    head = _git("rev-parse", "--short=8", "HEAD")
    if not head:
        return ""
    changed = _git("status", "--porcelain", "--", ".", ":!benchmarks/results", ":!docs/_static")
    return f" ({head}{'-dirty' if changed else ''})"


def _git(*command: str) -> str:
    """What git prints about the repository of this file; nothing where there is none."""
    root = Path(__file__).parents[1]
    try:
        done = subprocess.run(["git", "-C", str(root), *command], capture_output=True, text=True)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _processor() -> str:
    """The name of the processor (Linux; elsewhere what Python knows)."""
    said = _read("/proc/cpuinfo", "model name") or platform.processor()
    return f" ({said})" if said else ""


def _memory() -> str:
    """The size of the memory."""
    said = _read("/proc/meminfo", "MemTotal")
    return f"{int(said.split()[0]) / 2**20:.0f} GB, " if said else ""


def _read(file: str, key: str) -> str:
    try:
        lines = Path(file).read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")


if __name__ == "__main__":
    print(software(sys.argv[1:]))
