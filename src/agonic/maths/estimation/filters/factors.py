"""U D Uᵀ of a covariance, one source for lists and for numba: a variance more, and a reading.

Python is faster on lists than NumPy on arrays this small. Every function works in place; `columns`
has the columns of U, `room` is a place for as many numbers.
"""

from __future__ import annotations

from typing import Any


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
