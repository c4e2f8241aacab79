"""Resolution: the steps that readings come in, and whether they are too coarse for a heading."""

from __future__ import annotations

from functools import partial, reduce

import numpy as np

from agonic.arrays import Array
from agonic.coverage import OPEN_DEG
from agonic.health.evidence import MOST_ROWS
from agonic.health.finding import Finding, figure

FEWEST_LEVELS, FEW_LEVELS = 30, 6
"""Levels of an axis across the field below which rounding is to be looked at, and is refused."""

_SOME_STEPS = 200


def find_quantisation(field: Array) -> float | None:
    """The step of quantised readings, in their unit; None where they are finer than noise.

    >>> find_quantisation(np.round(np.random.default_rng(0).normal(size=(500, 3)) * 10) * 100.0)
    100.0
    """
    size = float(find_steps(field).max())
    return size if size > 0 else None


def find_steps(field: Array) -> Array:
    """The smallest step between distinct readings of each axis, (3,); 0 where there is none.

    Every difference is a multiple of it, and readings repeat.

    >>> find_steps(np.array([[0.0, 1.0, 5.0], [4.0, 2.0, 5.0], [8.0, 1.0, 5.0], [4.0, 4.0, 5.0]]))
    array([4., 1., 0.])
    """
    some = field[:: 1 + len(field) // MOST_ROWS]
    return np.array([_find_step(column) for column in some.T])


def find_rounding(field: Array) -> float:
    """What rounding to these steps scatters a reading on an axis, rms over the axes.

    >>> round(find_rounding(np.tile([[0.0, 0.0, 0.0], [12.0, 12.0, 12.0]], (9, 1))), 3)
    3.464
    """
    return float(np.sqrt(np.mean(find_steps(field) ** 2) / 12))


def _find_step(column: Array) -> float:
    near = 1e-9 * float(np.abs(column).max(initial=0.0))
    levels = np.sort(column)
    levels = levels[np.r_[True, np.diff(levels) > near]]  # the same to rounding of a unit
    if len(levels) < 2 or len(levels) > 0.8 * len(column):
        return 0.0
    steps = np.unique(np.diff(levels))
    common = reduce(partial(_find_divisor, least=100 * near), steps[:_SOME_STEPS].tolist())
    for size in (float(steps[0]), common):
        multiples = (levels - levels[0]) / size
        if size > 100 * near and np.abs(multiples - multiples.round()).max() < 0.1:
            return size
    return 0.0


def _find_divisor(a: float, b: float, *, least: float) -> float:
    """The greatest common divisor of two lengths, by Euclid's algorithm, above `least`."""
    while b > least:
        a, b = b, abs(a - b * round(a / b))
    return a


def check_resolution(field: Array, radius: float, unit: str) -> Finding | None:
    """Steps so coarse that few levels lie across the field, of this radius in the raw readings.

    Rounding to so few is no noise that more readings average out.

    >>> turned = np.random.default_rng(0).normal(size=(900, 3))
    >>> turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    >>> check_resolution(np.round(turned * 50_000, -4), 50_000, "nT").severity
    'check'
    >>> check_resolution(np.round(turned * 50_000, -4), 1e-200, "nT").what.split("leaves ")[1]
    'the heading undetermined'
    """
    steps = find_steps(field)
    levels = 2 * radius / max(float(steps.max()), 1e-300)
    if levels >= FEWEST_LEVELS:
        return None
    axes = [letter for letter, step in zip("xyz", steps, strict=True) if step == steps.max()]
    whose = f"axis {axes[0]} reads" if len(axes) == 1 else f"axes {' and '.join(axes)} read"
    open_deg = _degrees_of_step(levels)
    left = f"uncertain by {figure(open_deg)}°" if open_deg < OPEN_DEG else "undetermined"
    return Finding(
        "resolution",
        "refuse" if levels < FEW_LEVELS else "check",
        f"{whose} in steps of {figure(float(steps.max()))} {unit}, {int(levels) + 1} across the "
        f"field: one reading leaves the heading {left}",
        "choose a finer range of the sensor, or log all the digits that it has",
    )


def _degrees_of_step(levels: float) -> float:
    """Standard error of a heading by rounding to so many levels across the field, at 60° of dip."""
    levels = max(levels, 1e-12)
    return float(np.degrees(2 / levels / np.sqrt(12) / np.cos(np.radians(60.0))))
