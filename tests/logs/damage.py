"""Damage as it happens to files: cut off, overwritten, with bytes lost, with bytes put in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.log import Log


def damaged(data: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """The bytes of a file with damage of one kind, at a place of chance."""
    at = int(rng.integers(0, len(data)))
    noise = rng.integers(0, 256, int(rng.integers(1, 3000))).astype(np.uint8)
    kind = rng.integers(0, 4)
    if kind == 0:
        return data[:at]
    if kind == 1:
        changed = data.copy()
        some = noise[: len(noise) // 20 + 1]
        changed[rng.integers(0, len(data), len(some))] = some
        return changed
    return np.delete(data, slice(at, at + len(noise))) if kind == 2 else np.insert(data, at, noise)


def read_or_refused(load: Callable[[Path], Log], path: Path) -> Log | None:
    """The log, or nothing where one sentence says what is wrong and what to do."""
    try:
        return load(path)
    except LogError as error:
        refusal = str(error)
    assert "; " in refusal
    assert "\n" not in refusal
    return None
