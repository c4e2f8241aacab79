"""Bayesian model averaging of a term that may or may not be there, instead of deciding.

Leaving a term out where a test does not see it makes standard errors several times too small just
below the limit of the test; keeping it always costs half of the accuracy where it is not there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.estimation.leastsq import inverse


class ModelAverage(NamedTuple):
    """All parameters with their covariance, and the probability of the term."""

    params: Array
    covariance: Array
    probability: float


def average_over_term(
    params: Array, covariance: Array, term: slice | Index, prior: float
) -> ModelAverage:
    """Parameters (p,) averaged over models with the term and without (Hoeting et al. 1999).

    With k numbers d in the term, their covariance V and q = dᵀV⁻¹d, a term of a size about which
    nothing is known but what d tells is, against none, as likely as

        B = (q/k)^(−k/2) exp((q − k)/2)  where q > k,   else 1

    and d is then d (1 − k/q). The others follow d along C_od V⁻¹.

    >>> spread = np.array([[2.0, 1.0], [1.0, 1.0]])
    >>> found = average_over_term(np.array([1.0, 0.5]), spread, slice(1, 2), 0.1)
    >>> found.params.tolist(), found.covariance.tolist()  # half a standard error is nothing
    ([0.5, 0.0], [[1.0, 0.0], [0.0, 0.0]])
    """
    d, spread = params[term], covariance[:, term][term]
    k = len(d)
    q = float(d @ inverse(spread) @ d)
    odds = prior / (1 - prior)
    if q > k:
        odds *= float(np.exp(min((q - k - k * np.log(q / k)) / 2, 700.0)))
    there, left = odds / (1 + odds), max(1 - k / max(q, 1e-300), 0.0)
    by = covariance[:, term] @ inverse(spread)  # of the term itself, one
    known = there * left * spread + there * (1 - there) * left**2 * np.outer(d, d)
    return ModelAverage(
        params - by @ d * (1 - there * left),
        covariance + by @ (known - spread) @ by.T,
        there,
    )
