"""Wald's test that estimated numbers are zero, where few independent readings tell their errors."""

from __future__ import annotations

from typing import NamedTuple

from scipy.special import fdtrc

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse


class Wald(NamedTuple):
    """The statistic xᵀ C⁻¹ x, and how often chance makes it as large."""

    statistic: float
    p_value: float


def wald(found: Array, covariance: Array, independent: float) -> Wald:
    """Whether k numbers (k,) with covariance (k, k) differ from zero.

    xᵀ C⁻¹ x / k follows F(k, m − k) where the errors' size itself is known from `independent` = m
    readings: the effective sample size, smaller than their number where errors are correlated.

    >>> import numpy as np
    >>> wald(np.array([0.1, 0.0, 0.0]), np.eye(3), 100.0).p_value > 0.9
    True
    >>> few, many = (wald(np.full(3, 3.0), np.eye(3), m).p_value for m in (6.0, 1e6))
    >>> bool(few > 0.02 > 1e-5 > many)
    True
    """
    k = len(found)
    statistic = float(found @ inverse(covariance) @ found)
    return Wald(statistic, float(fdtrc(k, max(independent - k, 1.0), statistic / k)))
