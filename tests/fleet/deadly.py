"""Work that ends the process it is done in."""

import os
import signal
from pathlib import Path


def squared(n: int) -> int:
    return n * n


def fatal(n: int) -> int:
    """The task itself, but for some that end the process each time."""
    if n in (7, 8, 31):
        os.kill(os.getpid(), signal.SIGKILL)
    return n


def deadly_once(n: int, folder: str) -> int:
    """The task itself, but some of them end the process when they are tried first."""
    mark = Path(folder, str(n))
    if n % 12 == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return n
