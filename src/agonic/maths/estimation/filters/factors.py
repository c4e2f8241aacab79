"""U D Uᵀ of a covariance, one source for lists and for numba: a variance more, and a reading.

Python is faster on lists than NumPy on arrays this small. Every function works in place; `columns`
has the columns of U, `room` is a place for as many numbers.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast


def add_variance(i: int, variance: float, columns: Any, diagonal: Any, a: Any) -> None:
    """A variance added to number i of the state (Agee and Turner 1972); `a` is room for ten."""
    for j in range(i):
        a[j] = 0.0
    a[i] = 1.0
    for k in range(i, -1, -1):
        known, part = diagonal[k], a[k]
        total = known + variance * part * part
        if total > 0.0:
            diagonal[k] = total
            share = variance * part / total
            column = columns[k]
            for j in range(k):
                entry = column[j]
                rest = a[j] - part * entry
                a[j], column[j] = rest, entry + share * rest
            variance *= known / total


def predict(h: Any, noise: float, columns: Any, diagonal: Any, f: Any) -> float:
    """The variance of a residual, h P hᵀ + noise², and f = Uᵀ h."""
    variance = noise * noise
    for j in range(len(diagonal)):
        column = columns[j]
        total = h[j]
        for i in range(j):
            total += column[i] * h[i]
        f[j] = total
        variance += diagonal[j] * total * total
    return variance


def absorb(noise: float, columns: Any, diagonal: Any, f: Any, gain: Any) -> None:
    """U and D after a reading, and its gain (Bierman 1977, V.3.2), from f = Uᵀ h."""
    variance = noise * noise
    for j in range(len(diagonal)):
        v = diagonal[j] * f[j]
        total = variance + v * f[j]
        diagonal[j] *= variance / total
        share = f[j] / variance
        column = columns[j]
        for i in range(j):
            entry = column[i]
            column[i] = entry - share * gain[i]
            gain[i] += v * entry
        gain[j] = v
        variance = total
    for j in range(len(diagonal)):
        gain[j] /= variance


def variance_of(i: int, columns: Any, diagonal: Any) -> float:
    """The variance of number i."""
    total = float(diagonal[i])
    for j in range(i + 1, len(diagonal)):
        total += columns[j][i] * columns[j][i] * diagonal[j]
    return total


PARTS = (add_variance, predict, absorb, variance_of)
"""What numba has to compile, each after what it calls."""


def compile_parts(
    whole: Callable[..., tuple[int, bool]], parts: Sequence[Callable[..., Any]]
) -> Callable[..., tuple[int, bool]] | None:
    """A function and those that it calls compiled by numba, or `None` without it.

    What numba keeps on the disk it compiles anew where the file of `whole` has changed; a change of
    any other part has to be seen here.
    """
    try:
        numba = importlib.import_module("numba")
        extending = importlib.import_module("numba.extending")
    except ImportError:
        return None
    for part in parts:
        extending.register_jitable(part)
    kernel: Any
    try:
        kernel = numba.njit(cache=True)(whole)
    except RuntimeError:  # no folder that numba may write to
        kernel = numba.njit(whole)
        return cast(Callable[..., tuple[int, bool]], kernel)
    files = {Path(part.__code__.co_filename) for part in parts}
    changed = max((file.stat().st_mtime for file in files if file.is_file()), default=0.0)
    for index in Path(kernel.stats.cache_path).glob(f"*.{whole.__name__}-*.nbi"):
        if index.stat().st_mtime < changed:
            index.unlink(missing_ok=True)
    return cast(Callable[..., tuple[int, bool]], kernel)
