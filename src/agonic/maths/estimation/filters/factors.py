"""U D Uᵀ of a covariance, one source for lists and for numba: a variance more, and a reading.

Python is faster on lists than NumPy on arrays this small. Every function works in place; `columns`
has the columns of U, `room` is a place for as many numbers.
"""

from __future__ import annotations

from typing import Any


def walk(
    rate: float, elapsed: float, first: int, last: int, columns: Any, diagonal: Any, a: Any
) -> None:
    """Numbers from first to before last walk at random: the variance rate² elapsed is added to each
    (Agee and Turner 1972)."""
    added = rate * rate * elapsed
    for i in range(first, last if added > 0.0 else first):
        known, variance = diagonal[i], added
        total = known + variance
        diagonal[i], share = total, variance / total
        column = columns[i]
        for j in range(i):
            entry = column[j]
            a[j], column[j] = -entry, entry - share * entry
        variance *= known / total
        for k in range(i - 1, -1, -1):
            known, part = diagonal[k], a[k]
            total = known + variance * part * part
            if total > 0.0:
                diagonal[k], share = total, variance * part / total
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
