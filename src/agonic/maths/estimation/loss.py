"""Robust losses ρ(z) of residuals over their noise: least squares, Cauchy, Tukey (Huber 1981)."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array


class Loss(NamedTuple):
    """A robust loss ρ(z): its value, weight ρ'(z)/z and curvature ρ''(z) as functions of z²."""

    value: Callable[[Array], Array]
    weight: Callable[[Array], Array]
    curvature: Callable[[Array], Array]


def squares() -> Loss:
    """ρ = z²/2: least squares, every reading counts."""
    return _SQUARES


@lru_cache(maxsize=16)
def cauchy(c: float = 2.385) -> Loss:
    """ρ = c²/2 · ln(1 + z²/c²): far readings count little but always pull back; 95 % efficient."""
    return Loss(*(partial(each, c=c) for each in (_cauchy_value, _cauchy_weight, _cauchy_curve)))


@lru_cache(maxsize=16)
def tukey(c: float = 6.0) -> Loss:
    """The biweight (Beaton & Tukey 1974): beyond c standard deviations nothing counts.

    c = 6 keeps 98.1 % of the efficiency of least squares on clean readings.
    """
    return Loss(*(partial(each, c=c) for each in (_tukey_value, _tukey_weight, _tukey_curve)))


def _half(q: Array) -> Array:
    return q / 2


_SQUARES = Loss(_half, np.ones_like, np.ones_like)


def _cauchy_value(q: Array, c: float) -> Array:
    return c**2 / 2 * np.log(1 + q / c**2)  # log1p would be several times slower


def _cauchy_weight(q: Array, c: float) -> Array:
    return 1 / (1 + q / c**2)


def _cauchy_curve(q: Array, c: float) -> Array:
    return (1 - q / c**2) / (1 + q / c**2) ** 2


def _tukey_left(q: Array, c: float) -> Array:
    return np.maximum(1 - q * (1 / c**2), 0)


def _tukey_value(q: Array, c: float) -> Array:
    some = _tukey_left(q, c)
    return c**2 / 6 * (1 - some * some * some)  # a power would be several times slower


def _tukey_weight(q: Array, c: float) -> Array:
    return _tukey_left(q, c) ** 2


def _tukey_curve(q: Array, c: float) -> Array:
    return _tukey_left(q, c) * (1 - q * (5 / c**2))


@lru_cache(maxsize=16)
def expected_square(loss: Loss) -> float:
    """Σ w(z) z² / Σ w(z) of Gaussian residuals over their standard deviation."""
    z = np.linspace(-8, 8, 1601)
    density = np.exp(-(z**2) / 2) * loss.weight(z**2)
    return float((density * z**2).sum() / density.sum())
